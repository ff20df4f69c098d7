"""Tension from equilibrium; see README.md, "Tension"."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from galerkin import kernels
from galerkin.bases.kink import Array, KinkedBasis
from galerkin.models import FullCable

if TYPE_CHECKING:
    from galerkin.observe import Measures


BATCH = 64  # instants whose forces along the cable are computed at once


class Equilibrium(NamedTuple):
    """Internal forces N t at n instants."""

    behind: Array  # (n, 2) at the mass
    ahead: Array
    left: Array  # (n, 2) at the supports
    right: Array
    along: Array  # (k, m, 2) at the frames; at s = s_o the side behind
    strain: Array  # (n,) int W ds
    min_tension: Array  # (n,) smallest tension and its s
    min_tension_at: Array


def rope_forces_from_equilibrium(x: Measures, s: Array, frames: Array) -> Equilibrium:
    """Internal forces at the car, the supports, and along s in these frames, by integrating the balance of forces.

    x : states of the run;  s : stations (m,);  frames : indices of states (k,).
    N' follows from w.. + c_d w. , whose primitives the basis knows, so no derivative of the strain enters.
    """
    cable = x.system.cable
    basis = x.system.basis.basis
    damping = x.system.damping
    side_forces, strain = side_force_and_energy_integrals(x)
    s_o = x.inside[:, None]  # length of the sides (n, 1)
    rest = 1.0 - x.inside[:, None]
    A = (x.a + damping * x.v)[..., :-1]  # w.. + c_d w. without the hat (n, fields, N)
    first = basis.phi(x.inside, -1)
    second = basis.phi(x.inside, -2)
    ends = np.array([0.0, 1.0])
    second_left, second_right = basis.phi(ends, -2)
    rates = zip(x.hat_slope_rates(2), x.hat_slope_rates(1), strict=True)  # behind, ahead
    ray_behind, ray_ahead = (twice + damping * once for twice, once in rates)
    # int s w.. ds behind and int (1 - s) w.. ds ahead of the mass, with damping
    moment_behind = sum_of_functions(A, s_o * first - second + second_left) + ray_behind * s_o**3 / 3.0
    moment_ahead = sum_of_functions(A, second_right - second - rest * first) + ray_ahead * rest**3 / 3.0
    behind = (side_forces[:, 0] + moment_behind) / s_o
    ahead = (side_forces[:, 1] - moment_ahead) / rest
    at_mass = sum_of_functions(A, first)

    def along(s: Array) -> Callable[[Array], Array]:
        """N t (k, m, 2) at stations s (m,), as a function of the instants (k,)."""
        functions = basis.phi(s, -1)

        def force(k: Array) -> Array:
            smooth = np.einsum("kfm,sm->ksf", A[k], functions, optimize=True) - at_mass[k, None]
            triangle_behind = 0.5 * (s_o[k] ** 2 - s**2)[..., None]
            triangle_ahead = 0.5 * (rest[k] ** 2 - (1.0 - s) ** 2)[..., None]
            before = behind[k, None] - triangle_behind * ray_behind[k, None]
            after = ahead[k, None] + triangle_ahead * ray_ahead[k, None]
            is_behind = (s <= s_o[k])[..., None]
            return smooth + np.where(is_behind, before, after) + static_rope_force(cable, s)

        return force

    instants = np.arange(x.s_o.size)
    count = 60  # for the smallest tension
    stations = np.concatenate([[0.0], s[:: 1 + s.size // count], [1.0]])
    force = along(stations)
    static = static_rope_force(cable, stations)
    batches = np.array_split(instants, 1 + instants.size // BATCH)
    T = np.concatenate([signed_tension(force(k), static) for k in batches])
    left, right = along(ends)(instants).swapaxes(0, 1)
    static_at_mass = static_rope_force(cable, x.inside)
    return Equilibrium(
        behind=behind + static_at_mass, ahead=ahead + static_at_mass, left=left, right=right,
        along=along(s)(frames), strain=strain, min_tension=T.min(axis=1), min_tension_at=stations[T.argmin(axis=1)],
    )  # fmt: skip


def side_force_and_energy_integrals(x: Measures) -> tuple[Array, Array]:
    """int (N t - T t_static) ds by sides and fields, (n, 2, 2), and int W ds, (n,)."""
    system = x.system
    Q = x.q
    n = x.s_o.size
    side_forces = np.empty((n, 2, 2))
    strain = np.empty(n)
    if system.has_compiled_steps:
        for k, sines in system.runs_with_equal_quadrature(x.inside):
            kernels.set_side_forces_and_strain_energies(sines, x.inside[k], Q[k], side_forces[k], strain[k])
        return side_forces, strain
    cable = system.cable
    kink = system.basis if system.kink else KinkedBasis(system.basis.basis, kink=True)
    for i, s_o in enumerate(x.inside.tolist()):
        points = cable.tables_at(kink, s_o)
        w_s = Q[i] @ points.phi
        rows = kernels.force_energy_and_tangent(points.T, points.static_slope, w_s, cable.alpha, cable.law)
        strain[i] = points.weights @ rows[1]
        force = rows[2:4] * points.weights
        behind = points.phi[-1] > 0.0
        side_forces[i] = np.stack([behind, ~behind]) @ force.T
    return side_forces, strain


def static_rope_force(cable: FullCable, s: Array) -> Array:
    """T X' at s (m,), (m, 2)."""
    T, xp, yp = cable.groups.tension_and_slope(s)
    return np.stack([T * xp, T * yp], axis=1)


def signed_tension(force: Array, slope: Array) -> Array:
    """|N t| with the sign it has along r', (...,)."""
    return np.copysign(np.hypot(force[..., 0], force[..., 1]), np.sum(force * slope, axis=-1))


def slopes_from_forces(force: Array, slopes_if_slack: Array, T: Any, alpha: float) -> Array:
    """r' (..., 2) from forces N t; where the cable is slack, those by the basis, which converge slowly at the mass."""
    N = np.hypot(force[..., 0], force[..., 1])
    along = np.sum(force * slopes_if_slack, axis=-1)
    taut = (N > kernels.MIN_TENSION) & (along > 0.0)
    stretch_over_tension = (1.0 + (N - T) / alpha) / np.where(taut, N, 1.0)
    return np.where(taut[..., None], stretch_over_tension[..., None] * force, slopes_if_slack)


def sum_of_functions(coefficients: Array, functions: Array) -> Array:
    """sum_m c_nfm phi_nm, (n, fields)."""
    return np.einsum("nfm,nm->nf", coefficients, functions)
