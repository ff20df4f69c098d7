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


def forces_from_equilibrium(x: Measures, s: Array, frames: Array) -> Equilibrium:
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
    ends = basis.phi(np.array([0.0, 1.0]), -2)
    rates = zip(x.hat_slope_rates(2), x.hat_slope_rates(1), strict=True)  # behind, ahead
    ray_behind, ray_ahead = (twice + damping * once for twice, once in rates)
    moment_behind = sum_of_functions(A, s_o * first - second + ends[0]) + ray_behind * s_o**3 / 3.0
    moment_ahead = sum_of_functions(A, ends[1] - second - rest * first) + ray_ahead * rest**3 / 3.0
    behind = (side_forces[:, 0] + moment_behind) / s_o
    ahead = (side_forces[:, 1] - moment_ahead) / rest
    at_frames = sum_of_functions(A, first)

    def along(s: Array) -> Callable[[Array], Array]:
        """N t (k, m, 2) at stations s (m,), as a function of the instants (k,)."""
        functions = basis.phi(s, -1)

        def force(k: Array) -> Array:
            smooth = np.einsum("kfm,sm->ksf", A[k], functions, optimize=True) - at_frames[k, None]
            before = behind[k, None] - 0.5 * (s_o[k] ** 2 - s**2)[..., None] * ray_behind[k, None]
            after = ahead[k, None] + 0.5 * (rest[k] ** 2 - (1.0 - s) ** 2)[..., None] * ray_ahead[k, None]
            return smooth + np.where((s <= s_o[k])[..., None], before, after) + static_force(cable, s)

        return force

    smallest, where = min_tension_and_position(cable, x.s_o.size, along, s)
    left, right = along(np.array([0.0, 1.0]))(np.arange(x.s_o.size)).swapaxes(0, 1)
    at_mass = static_force(cable, x.inside)
    return Equilibrium(behind + at_mass, ahead + at_mass, left, right, along(s)(frames), strain, smallest, where)


def min_tension_and_position(
    cable: FullCable, instants: int, force_along: Callable[[Array], Callable[[Array], Array]], s: Array
) -> tuple[Array, Array]:  # fmt: skip
    """Smallest tension of every instant and its s, (n,); force_along(s)(k): N t at stations s and instants k."""
    count = 60  # for the smallest tension
    stations = np.concatenate([[0.0], s[:: 1 + s.size // count], [1.0]])
    force = force_along(stations)
    T = evaluate_in_batches(lambda k: signed_tension(force(k), static_force(cable, stations)), np.arange(instants))
    return T.min(axis=1), stations[T.argmin(axis=1)]


def evaluate_in_batches(function: Callable[[Array], Array], instants: Array) -> Array:
    """function(k) (k, ...) for the indices of instants, computed for few at once."""
    batch = 64  # instants at once
    return np.concatenate([function(some) for some in np.array_split(instants, 1 + instants.size // batch)])


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
        behind = points.phi[-1] > 0.0
        strain[i] = points.weights @ rows[1]
        side_forces[i] = np.stack([behind, ~behind]) @ (rows[2:4] * points.weights).T
    return side_forces, strain


def static_force(cable: FullCable, s: Array) -> Array:
    """T X' at s (m,), (m, 2)."""
    T, xp, yp = cable.groups.tension_and_slope(s)
    return np.stack([T * xp, T * yp], axis=1)


def signed_tension(force: Array, slope: Array) -> Array:
    """|N t| with the sign it has along r', (...,)."""
    return np.copysign(np.hypot(force[..., 0], force[..., 1]), np.sum(force * slope, axis=-1))


def slopes_from_forces(force: Array, slopes: Array, T: Any, alpha: float) -> Array:
    """r' (..., 2) from forces N t; where the cable is slack, `slopes`, which converge slowly at the mass."""
    N = np.hypot(force[..., 0], force[..., 1])
    taut = (N > kernels.MIN_TENSION) & (np.sum(force * slopes, axis=-1) > 0.0)
    stretch = (1.0 + (N - T) / alpha) / np.where(taut, N, 1.0)
    return np.where(taut[..., None], stretch[..., None] * force, slopes)


def sum_of_functions(coefficients: Array, functions: Array) -> Array:
    """sum_m c_nfm phi_nm, (n, fields)."""
    return np.einsum("nfm,nm->nf", coefficients, functions)
