"""What mass-following elements are, as scikit-fem forms: readable where `kernels` is fast.

The full cable, unknowns w = (u, v), on `skfem.ElementVector(element, 2)` over 0 <= s <= 1:

    int (N t - T X') . phi' ds,    r' = X' + w',  t = r'/|r'|,  N = T + alpha (|r'| - 1).

Fields come by name: `T`, `alpha`, `law` as in `kernels.law`, the static slope `X_s` (2, ...), the slope of the
displacement `w_s` (2, ...).
"""

import numpy as np
import skfem

from cablefem.elements.kernels.law import TENSION_ONLY


def tension(eps, T, alpha, law):
    """Return N, dN/deps and the energy W = int N deps."""
    N = T + alpha * eps
    pulls = (N > 0.0) | (law != TENSION_ONLY)
    slack = -0.5 * T * T / alpha  # all that it had stored is given back
    return np.where(pulls, N, 0.0), np.where(pulls, alpha, 0.0), np.where(pulls, (T + 0.5 * alpha * eps) * eps, slack)


def pull(X_s, T, w_s, alpha, law):
    """Return f = N t - T X' (2, ...), N, dN/deps and W."""
    r_s = X_s + w_s
    stretch = np.hypot(*r_s)
    eps = np.sum((2.0 * X_s + w_s) * w_s, axis=0) / (stretch + 1.0)  # |r'| - 1 without cancellation
    N, dN, W = tension(eps, T, alpha, law)
    return N / stretch * w_s + ((N - T) - T * eps) / stretch * X_s, N, dN, W


def stiffness(X_s, T, w_s, alpha, law):
    """Return df/dw' (2, 2, ...): dN/deps along the tangent t, N/|r'| across it."""
    r_s = X_s + w_s
    stretch = np.hypot(*r_s)
    _, N, dN, _ = pull(X_s, T, w_s, alpha, law)
    t, unit = r_s / stretch, np.eye(2).reshape(2, 2, *[1] * np.ndim(stretch))
    return N / stretch * unit + (dN - N / stretch) * t[:, None] * t[None]


@skfem.LinearForm
def internal_force(eta, w):
    """(N t - T X') . eta'."""
    return np.sum(pull(w["X_s"], w["T"], w["w_s"], w["alpha"], w["law"])[0] * eta.grad[:, 0], axis=0)


@skfem.BilinearForm
def internal_tangent(phi, eta, w):
    """df/dw' phi' . eta'."""
    K = stiffness(w["X_s"], w["T"], w["w_s"], w["alpha"], w["law"])
    return np.einsum("ij...,j...,i...->...", K, phi.grad[:, 0], eta.grad[:, 0])
