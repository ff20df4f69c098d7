"""The internal force of the full cable and its tangent as scikit-fem forms, readable where `kernels` is fast.

    int (N t - T X') . phi' ds,    r' = X' + w',  t = r'/|r'|,  N = T + alpha (|r'| - 1),

to be assembled on elements of two components, `skfem.ElementVector(element, 2)`, over 0 <= s <= 1; fields by name:
`T`, `alpha`, the static slope `X_s` (2, ...), the slope of the displacement `w_s` (2, ...), `law` as in `kernels.law`.
The inertia of a following mesh is `reference.mass_form`, `transport_form` and `convection_form`.
"""

import numpy as np
import skfem

from cablefem.elements.kernels.law import TENSION_ONLY


def _tension(stretch, w):
    """Return N and dN/deps."""
    N = w["T"] + w["alpha"] * (stretch - 1.0)
    pulls = (N > 0.0) | (w["law"] != TENSION_ONLY)
    return np.where(pulls, N, 0.0), np.where(pulls, w["alpha"], 0.0)


@skfem.LinearForm
def internal_force(eta, w):
    """(N t - T X') . eta'."""
    r_s = w["X_s"] + w["w_s"]
    stretch = np.hypot(*r_s)
    return np.sum((_tension(stretch, w)[0] / stretch * r_s - w["T"] * w["X_s"]) * eta.grad[:, 0], axis=0)


@skfem.BilinearForm
def internal_tangent(phi, eta, w):
    """d(N t)/dr' phi' . eta': dN/deps along the tangent t, N/|r'| across it."""
    r_s = w["X_s"] + w["w_s"]
    stretch = np.hypot(*r_s)
    (N, dN), along = _tension(stretch, w), np.sum(r_s * phi.grad[:, 0], axis=0) / stretch**2
    return np.sum((N / stretch * (phi.grad[:, 0] - along * r_s) + dN * along * r_s) * eta.grad[:, 0], axis=0)
