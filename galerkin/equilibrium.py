"""Tension from equilibrium: the internal force that a history of accelerations needs, instead of T + alpha eps.

The strain at a point is a small difference of the slopes of u and v, each good in the mean only, and alpha multiplies
what is left of it.  The balance of a piece of cable gives the force back.  With G = N t - T X' and w.. = G' off the
mass, weights s on the piece behind and 1 - s on the piece ahead,

    G(s_o-) = (1/s_o) [ int_0^s_o G ds + int_0^s_o s w.. ds ],
    G(s_o+) = (1/(1 - s_o)) [ int_s_o^1 G ds - int_s_o^1 (1 - s) w.. ds ],
    G(s) = G(s_o-) - int_s^s_o w.. ds behind, G(s_o+) + int_s_o^s w.. ds ahead of the mass,

w.. = sum phi a + psi a_hat + 2 psi_t v_hat + psi_tt q_hat at fixed s.  On either piece psi is a ray from its support:
the hat's share of w.. is s or 1 - s times a number; integrals of the standing functions are differences of their
primitives.  Only int G ds is by quadrature, and it takes means.  At the supports this is the balance of the whole
cable with weights 1 - s and s and the force of the mass, for the hat's own equation is the difference of the two.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from galerkin import kernels
from galerkin.bases.fourier import Fourier
from galerkin.bases.kink import Array, TravellingKink
from galerkin.bow import slopes
from galerkin.models import FullCable

if TYPE_CHECKING:
    from galerkin.equations import GalerkinSystem
    from galerkin.observe import History


@dataclass(frozen=True, slots=True)
class Equilibrium:
    """Internal forces N t of n instants, and what the same quadrature gives on the way."""

    behind: Array  # (n, 2) at the mass
    ahead: Array
    left: Array  # (n, 2) at the supports
    right: Array
    along: Array  # (k, m, 2) at frames x stations; at s = s_o the side behind
    strain: Array  # (n,) int W ds
    least: Array  # (n,) least N at the points, and its s
    least_at: Array


def recover(system: GalerkinSystem, x: History, s: Array, frames: Array) -> Equilibrium:
    """Solve the balances of both pieces at every instant, and go from the mass along the cable at the frames."""
    cable, basis = system.cable, system.basis.basis
    assert isinstance(cable, FullCable)
    s_o, rest = x.s_o[:, None], 1.0 - x.s_o[:, None]
    internal, told = np.empty((x.s_o.size, 2, 2)), np.empty((x.s_o.size, 3))
    Q = np.concatenate([x.Q, x.q_hat[:, :, None]], axis=2)
    bows = x.bows[0] / np.stack([s_o, rest], axis=-1)
    if isinstance(basis, Fourier):
        of = basis.grading, cable.groups.sigma, cable.groups.c, cable.alpha, cable.law
        for k, *rules in basis.alike(x.s_o):
            kernels.surveyed(*rules, *of, x.s_o[k], Q[k], bows[k], internal[k], told[k])
    else:
        moving = system.basis if isinstance(system.basis, TravellingKink) else TravellingKink(basis)
        for i, place in enumerate(x.s_o.tolist()):
            points = cable.at(moving, place)
            points = points._replace(bent=slopes(points.s, place, bows[i, :, 0], bows[i, :, 1]))
            told[i, 0], told[i, 1], at = kernels.survey(points, Q[i], cable.alpha, cable.law, internal[i])
            told[i, 2] = points.s[at]
    first, second = basis.phi(x.s_o, -1), basis.phi(x.s_o, -2)
    ends, ends_1 = (basis.phi(np.array([0.0, 1.0]), m) for m in (-2, -1))
    (ray_behind, bow_behind), (ray_ahead, bow_ahead) = x.pieces(2)
    moment_behind = (
        combined(x.A, s_o * first - second + ends[0]) + ray_behind * s_o**3 / 3.0 + bow_behind * s_o**4 / 4.0
    )
    moment_ahead = (
        combined(x.A, ends[1] - second - rest * first) + ray_ahead * rest**3 / 3.0 + bow_ahead * rest**4 / 4.0
    )
    behind = (internal[:, :, 0] + moment_behind) / s_o
    ahead = (internal[:, :, 1] - moment_ahead) / rest
    left = behind - combined(x.A, first - ends_1[0]) - ray_behind * s_o**2 / 2.0 - bow_behind * s_o**3 / 3.0
    right = ahead + combined(x.A, ends_1[1] - first) + ray_ahead * rest**2 / 2.0 + bow_ahead * rest**3 / 3.0
    return Equilibrium(
        behind + _static(cable, x.s_o), ahead + _static(cable, x.s_o),
        left + _static(cable, np.zeros(1)), right + _static(cable, np.ones(1)),
        _along(x, basis, behind, ahead, first, s, frames) + _static(cable, s), *told.T,
    )  # fmt: skip


def _static(cable: FullCable, s: Array) -> Array:
    """T X', (n, 2)."""
    T, xp, yp, _, _ = cable.groups.static(s)
    return np.stack([T * xp, T * yp], axis=1)


def _along(x: History, basis, behind: Array, ahead: Array, first: Array, s: Array, frames: Array) -> Array:
    """G at the stations, (k, m, 2)."""
    s_o, rays = x.s_o[frames, None], x.pieces(2)
    standing = np.einsum("kfm,sm->ksf", x.A[frames], basis.phi(s, -1)) - combined(x.A, first)[frames, None]
    left, right = (
        sum(((a**p - b**p) / p)[..., None] * y[frames, None] for p, y in zip((2, 3), ray, strict=True))
        for (a, b), ray in zip(((s_o, s), (1.0 - s_o, 1.0 - s)), rays, strict=True)
    )
    return standing + np.where((s <= s_o)[..., None], behind[frames, None] - left, ahead[frames, None] + right)


def combined(coefficients: Array, functions: Array) -> Array:
    """sum_m c_nfm phi_nm, (n, fields): functionals of the standing functions, or their values."""
    return np.einsum("nfm,nm->nf", coefficients, functions)
