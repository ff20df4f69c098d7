"""Observation: paths, energies, and tensions and reactions from the balance of momentum.

The time is the last axis: unknowns are (n_scalar, fields, n), values at the mass (fields, n).
Kinematics (3, n) are s_o, ds_o, dds_o.  The mesh moves with c = ds_o chi: README.md, 1.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cablefem.elements.forms import Section, length_from_components, section_state, strain, tension_stiffness_energy
from cablefem.newmark import Array, States
from cablefem.response import Observation

if TYPE_CHECKING:
    from cablefem.elements.cable import CableElements

BLOCK = 1 << 13  # numbers in an array of a block


def observe(system: CableElements, states: States, s: Array, frames: NDArray[np.intp]) -> Observation:
    """Measurements of a history; fields at stations s (m,) for the rows `frames` (k,)."""
    g = system.groups
    kinematics = system._mass_kinematics(states)
    s_o, ds, dds = kinematics.T
    w, w_t, w_tt, w_s_behind, w_s_ahead = (x.T for x in system._cable_motion_at_mass(states, kinematics))
    position, slope, bend = (x.T for x in system.static_shape_and_derivatives(s_o))
    velocity = w_t + ds * slope
    acceleration = w_tt + dds * slope + ds**2 * bend
    force = system.inertia * acceleration - system.weight[:, None]
    mean_slope = slope + 0.5 * (w_s_behind + w_s_ahead)
    power = ds * np.sum(force * mean_slope, axis=0)

    node_kinematics = system._moving_node_kinematics(kinematics).T
    cable = observe_cable(system, node_kinematics, states)
    lost = 2.0 * g.damping * cable.kinetic
    powers = {"lost_viscous": -lost} if g.damping else {}
    kinetic = cable.kinetic + 0.5 * system.inertia * np.sum(velocity**2, axis=0)
    potential = cable.potential - system.weight @ (position + w)

    T, xp, yp, xpp, ypp = g.tension_and_shape_derivatives(s_o)
    static = np.stack([xp, yp])
    bend = np.stack([xpp, ypp])
    direction = system.direction.T
    behind = static + direction @ w_s_behind
    ahead = static + direction @ w_s_ahead
    history = HistoryWithForces(states, kinematics, cable.forces_at_side_ends, force)
    history = history._replace(forces_at_side_ends=system._forces_at_side_ends_with_mass(history))
    if system.fields == 2:
        law = system._law[0], system._law[3]
        sections = [section_state(static, T, r_s - static, *law) for r_s in (behind, ahead)]
        beside = _BesideMass(static, T, behind, ahead, *sections)
        at_mass = _tensions_and_reactions(system, history.forces_at_side_ends, node_kinematics[1], beside)
        power += ds * _kink_force(beside)
    else:
        at_mass = _chord_tensions_and_reactions(system, history.forces_at_side_ends, cable.rise, T)
    power -= lost
    for name, values in at_mass.items():
        if "behind" in name:  # at the left support there is no cable behind
            at_mass[name] = np.where(s_o > 0.0, values, np.nan)
    path_velocity = direction @ w_t + ds * static
    path_acceleration = direction @ w_tt + dds * static + ds**2 * bend
    blocks = []
    for rows in _row_blocks(frames, s.size):
        along = system._fields_at_stations(history, s, rows)
        blocks.append(_station_fields(system, along, s, cable.rise[rows]))
    return Observation(
        path=(direction @ w).T,
        path_velocity=path_velocity.T,
        path_acceleration=path_acceleration.T,
        slope_behind=behind.T,
        slope_ahead=ahead.T,
        energy=kinetic + cable.strain + potential,
        power=power,
        kinetic=kinetic,
        strain=cable.strain,
        potential=potential,
        tension_min=cable.tension_min,
        tension_min_at=cable.tension_min_at,
        t=states.t,
        s_o=s_o,
        contact=-(direction @ force).T,
        powers=powers,
        **at_mass,
        **_joined_blocks(blocks),
    )


def _row_blocks(rows: NDArray[np.intp], width: int) -> list[NDArray[np.intp]]:
    """Rows of arrays of a width in blocks, at least one, that stay in a processor's cache."""
    length = max(1, BLOCK // max(1, width))
    return [rows[begin : begin + length] for begin in range(0, max(1, rows.size), length)]


def _joined_blocks(blocks: list[dict[str, Array]]) -> dict[str, Array]:
    """Fields of all rows, from those of consecutive ones."""
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}


class MotionAtMass(NamedTuple):
    """Displacement w of the cable at the mass, w(s_o(t), t), (n, fields) each."""

    w: Array
    velocity: Array  # d/dt of it
    acceleration: Array
    slope_behind: Array  # w'
    slope_ahead: Array


class HistoryWithForces(NamedTuple):
    """A history, n instants, and the forces that fields at stations follow from."""

    states: States
    mass_kinematics: Array  # (n, 3) s_o, ds_o, dds_o
    forces_at_side_ends: Array  # see `CableState`
    contact_force: Array  # of the cable on the mass (fields, n)


class CableState(NamedTuple):
    """Of the cable alone, n instants; the time is the last axis."""

    kinetic: Array  # (n,)
    potential: Array
    strain: Array
    tension_min: Array
    tension_min_at: Array  # its s
    rise: Array  # of the uniform tension of one field; 0 of the full cable
    # f - c^2 w' at the left support, behind and ahead of the mass, at the right support
    forces_at_side_ends: Array  # (4, fields, n)


def observe_cable(system: CableElements, node_kinematics: Array, states: States) -> CableState:
    """The cable in a history; node_kinematics (3, n) : of the node between both sides of the mesh."""
    size = system.fields * system.n_scalar
    columns = np.concatenate(system._moments, axis=1).T  # (4 sides, n_scalar)
    parts = []
    for block in _row_blocks(np.arange(states.t.size), system._at_inertia.x.size):
        rows = slice(block[0], block[-1] + 1)
        at = node_kinematics[:, rows]
        x = np.empty((system.n_scalar, 3, system.fields, at.shape[1]))
        for i, history in enumerate((states.q, states.v, states.a)):
            of_cable = history[rows, :size].T
            x[:, i] = of_cable.reshape(system.n_scalar, system.fields, -1)
        q = np.ascontiguousarray(x[:, 0])
        v = np.ascontiguousarray(x[:, 1])
        kinetic = kinetic_energy(system, at, q, v)
        strained = strain_energy_and_smallest_tension(system, at, q)
        parts.append((kinetic, *strained, _matrix_times_unknowns(columns, x)))
    kinetic, *arrays, moments = (np.concatenate(values, axis=-1) for values in zip(*parts, strict=True))
    strained = StrainState(*arrays)
    of_sides = moments.reshape(-1, 4, *moments.shape[1:])
    potential = np.zeros_like(kinetic)
    if system.fields == 2:
        sides = _sides_with_lengths_and_signs(of_sides, node_kinematics[0])
        depth = sum(h * x[0, 0, 1] for x, h, _ in sides)  # int v ds
        potential -= system.groups.sigma * depth
    ends = _forces_at_side_ends(system, node_kinematics, of_sides, states.v, strained.force)
    energy, tension_min, tension_min_at, rise, _ = strained
    return CableState(kinetic, potential, energy, tension_min, tension_min_at, rise, ends)


def _sides_with_lengths_and_signs(values: Array, s_o: Array) -> list[tuple[Array, Array, float]]:
    """Values of the sides, each with the length h and dh/ds_o of its side; a fixed mesh has one."""
    return list(zip(values, (s_o, 1.0 - s_o), (1.0, -1.0), strict=False))


def _matrix_times_unknowns(matrix: Any, unknowns: Array) -> Array:
    """A matrix (p, n_scalar) times unknowns (n_scalar, ...)."""
    product = matrix @ unknowns.reshape(len(unknowns), -1)
    return np.asarray(product).reshape(-1, *unknowns.shape[1:])


def kinetic_energy(system: CableElements, node_kinematics: Array, q: Array, v: Array) -> Array:
    """int |w.|^2/2 ds (n,), w. = dv/dt at fixed s = v - c w'."""
    s_o, ds, _ = node_kinematics
    points = system._at_inertia
    xi = points.x
    h = np.where(points.behind, s_o, 1.0 - s_o)  # (p, n)
    rate = _matrix_times_unknowns(points.values, v)
    if np.any(ds):
        c = ds * np.where(points.behind, xi, 1.0 - xi)
        per_length = np.divide(c, h, out=np.zeros_like(h), where=h > 0.0)
        rate -= per_length[:, None] * _matrix_times_unknowns(points.slopes, q)
    squared = np.sum(rate * rate, axis=1)  # (p, n)
    return np.asarray(0.5 * np.sum(points.weights * h * squared, axis=0))


class StrainState(NamedTuple):
    energy: Array  # (n,)
    tension_min: Array  # (n,)
    tension_min_at: Array  # (n,)
    rise: Array  # (n,) see `CableState`
    force: Array  # int f dxi of both sides (2, fields, n)


def strain_energy_and_smallest_tension(system: CableElements, node_kinematics: Array, q: Array) -> StrainState:
    """Strain energy, smallest tension and internal force of a history."""
    s_o = node_kinematics[0]
    points = system._at_force
    h = np.where(points.behind, s_o, 1.0 - s_o)  # (p, n)
    length = np.where(h > 0.0, h, 1.0)
    s = np.where(points.behind, 0.0, s_o) + h * points.x
    weight = points.weights * h
    w_s = np.moveaxis(_matrix_times_unknowns(points.slopes, q), 1, 0) / length  # (fields, p, n)
    if system.fields == 2:
        T, *slope = system.groups.tension_and_slope(s)
        X_s = np.array(slope)
        x = section_state(X_s, T, w_s, system._law[0], system._law[3])
        f = x.force
        N = T + system._law[0] * x.strain
        rise = np.zeros(s_o.size)
        N = np.where(h > 0.0, N, math.inf)
        energy = np.sum(weight * x.energy, axis=0)
        at = np.argmin(N, axis=0)[None]
        tension_min = np.take_along_axis(N, at, axis=0)[0]
        tension_min_at = np.take_along_axis(s, at, axis=0)[0]
    else:
        alpha, T_chord, curvature, lam, kap, kind = system._law
        (w_s,) = w_s
        y = curvature * (0.5 - s)
        local = y * w_s + 0.5 * kap * w_s * w_s
        eps = lam * np.sum(weight * local, axis=0)
        N, _, W = tension_stiffness_energy(eps, T_chord, alpha, kind)
        tension_min = T_chord + alpha * eps
        tension_min_at = np.full(s_o.size, 0.5)
        rise = N - T_chord
        transverse = 0.5 * T_chord * np.sum(weight * w_s * w_s, axis=0)
        energy = transverse + W - T_chord * eps
        f = (T_chord * w_s + rise * (y + kap * w_s))[None]
    behind = points.behind[:, 0]
    of_sides = np.where([behind, ~behind], points.weights[:, 0], 0.0)  # (2, p)
    force = np.tensordot(of_sides, f, (1, 1))
    return StrainState(energy, tension_min, tension_min_at, rise, force)


def _forces_at_side_ends(
    system: CableElements, node_kinematics: Array, moments: Array, v: Array, internal: Array
) -> Array:
    """`CableState.forces_at_side_ends` with f = N t - T X'.

    Momentum of a side, tested with phi = 1, and with phi = 1 at the mass and 0 at the support:
    int d(h w.)/dt phi dxi + int (c w. + f) phi' ds = [(f + c w.) phi].
    moments : of q, v, a on each side (sides, 4, 3, fields, n);  v : (n, n_dof);  internal : `StrainState.force`.
    """
    s_o, ds, dds = node_kinematics
    out = np.zeros((4, system.fields, s_o.size))
    c_d = system.groups.damping
    dds = dds + c_d * ds
    at_node = ds * system._nodal_values(v, system.node).T
    for side, (of_side, h, sign) in enumerate(_sides_with_lengths_and_signs(moments, s_o)):
        near = 1 + side  # the end at the mass
        support = 3 * side
        of_q, of_v, of_a = np.moveaxis(of_side, 1, 0)  # (4, fields, n)
        dh = sign * ds + c_d * h
        inertia = h * of_a[:2] + dh * of_v[:2]
        total, tested = inertia - dds * of_q[2:] - ds * of_v[2:]
        flux = np.divide(ds**2 * of_q[3], h, out=np.zeros_like(tested), where=h > 0.0)
        force = sign * tested + ds * of_v[1] - flux + internal[side]
        out[near] = force - at_node
        out[support] = force - sign * total
    entering = s_o == 0.0  # nothing is behind the mass
    out[:2, :, entering] = out[2, :, entering].T
    return out


class StationPoints:
    """Where stations s, (m,) or (k, m), are in the elements for positions s_o (k,) of the mass."""

    def __init__(self, s: Array, s_o: Array, knots: Array, n_left: int, fields: int) -> None:
        rows = s_o.size
        s_o = s_o[:, None]
        behind = (s <= s_o) & (s_o > 0.0)
        h = np.where(behind, s_o, 1.0 - s_o)
        self.x = np.clip((s - s_o) / h, -1.0, 1.0)  # (k, m) between the knots
        element = np.searchsorted(knots[1:-1], self.x)
        element = np.where(behind, element, np.maximum(element, n_left))
        self.inside = (self.x - knots[element]) / np.diff(knots)[element]  # (k, m) position in the element
        row = np.arange(rows)[:, None]
        self._numbers = np.stack([(element * fields + field) * rows + row for field in range(fields)])

    def evaluate(self, polynomials: Array) -> Array:
        """Polynomials (powers, elements, fields, k) at the stations, (fields, k, m)."""
        highest, *others = polynomials.reshape(len(polynomials), -1)[::-1]
        value = highest.take(self._numbers)
        for coefficients in others:
            value *= self.inside
            value += coefficients.take(self._numbers)
        return value


class StationFields(NamedTuple):
    """Fields of k frames at m stations, (fields, k, m) each; at s_o behind the mass."""

    w: Array
    rate: Array  # dw/dt at fixed s
    slope: Array  # w'
    force_less_flux: Array  # f - c^2 w'
    c: Array  # (k, m) speed of the mesh


def _station_fields(system: CableElements, along: StationFields, s: Array, rise: Array) -> dict[str, Array]:
    """Displacement, velocity and tension (k, m) at stations s (m,); rise : of the tension of one field (k,)."""
    g = system.groups
    direction = system.direction.T
    T, xp, yp = g.tension_and_slope(s)
    if system.fields == 1:
        u, v = np.tensordot(direction, along.w, 1)  # (k, m) each
        du, dv = np.tensordot(direction, along.rate, 1)
        tension = T + rise[:, None]
        return {"u": u, "v": v, "du": du, "dv": dv, "T": tension, "T_pointwise": tension}
    X_s = np.array([xp, yp])[:, None]  # (2, 1, m)
    r_s = X_s + along.slope
    eps = strain(X_s, along.slope, length_from_components(r_s))
    N, _, _ = tension_stiffness_energy(eps, T, system._law[0], system._law[3])
    tension = _tension_from_momentum(system, along.force_less_flux, along.c, (X_s, T, r_s))
    u, v = along.w
    du, dv = along.rate
    return {"u": u, "v": v, "du": du, "dv": dv, "T": tension, "T_pointwise": N}


class _BesideMass(NamedTuple):
    """The full cable beside the mass, n instants."""

    X_s: Array  # (2, n)
    T: Array  # (n,)
    r_s_behind: Array  # (2, n)
    r_s_ahead: Array
    behind: Section
    ahead: Section


def _kink_force(x: _BesideMass) -> Array:
    """<N t> . [r'] - [W] (n,) of the kink; times ds_o it is a part of the power."""
    mean = 0.5 * (x.behind.force + x.ahead.force) + x.T * x.X_s  # <N t>
    work = np.sum(mean * (x.r_s_ahead - x.r_s_behind), axis=0)
    return work - (x.ahead.energy - x.behind.energy)


def _tensions_and_reactions(
    system: CableElements, forces_at_side_ends: Array, mesh_speed: Array, x: _BesideMass
) -> dict[str, Any]:
    """Tensions at the mass and reactions of the full cable; mesh_speed : at the mass (n,)."""
    T_ends, x_ends, y_ends = system.groups.tension_and_slope(np.array([0.0, 1.0]))
    static_ends = np.stack([T_ends * x_ends, T_ends * y_ends])  # (2 fields, 2 ends)
    left = forces_at_side_ends[0] + static_ends[:, :1]
    right = forces_at_side_ends[3] + static_ends[:, 1:]
    return {
        "T_behind": _tension_from_momentum(system, forces_at_side_ends[1], mesh_speed, (x.X_s, x.T, x.r_s_behind)),
        "T_ahead": _tension_from_momentum(system, forces_at_side_ends[2], mesh_speed, (x.X_s, x.T, x.r_s_ahead)),
        "T_behind_pointwise": x.behind.N,
        "T_ahead_pointwise": x.ahead.N,
        "reaction_left": -left.T,
        "reaction_right": right.T,
    }


def _chord_tensions_and_reactions(
    system: CableElements, forces_at_side_ends: Array, rise: Array, T: Array
) -> dict[str, Any]:
    """`_tensions_and_reactions` for one field; its tension rises uniformly."""
    g = system.groups
    T_chord, curvature = system._law[1:3]
    chord = np.array([g.chord_cos, g.chord_sin])
    along = (T_chord + rise)[:, None] * chord
    across = 0.5 * T_chord * curvature
    left = along + (forces_at_side_ends[0].T + across) @ system.direction
    right = along + (forces_at_side_ends[3].T - across) @ system.direction
    at_mass = T + rise
    return {"T_behind": at_mass, "T_ahead": at_mass, "reaction_left": -left, "reaction_right": right}


def _tension_from_momentum(
    system: CableElements, force_less_flux: Array, mesh_speed: Array, static_and_slope: tuple[Array, Array, Array]
) -> Array:
    """N from `force_less_flux` = N t - T X' - c^2 w'; static_and_slope : X', T, r', components first.

    N t - c^2 r' = (N (1 - c^2/alpha) - c^2 (1 - T/alpha)) t; r' gives the sign.
    """
    static, T, slope = static_and_slope
    alpha = system._law[0]
    flux = mesh_speed * mesh_speed
    x, y = force_less_flux + (T - flux) * static  # N t - c^2 r'
    size = length_from_components((x, y))
    is_backward = x * slope[0] + y * slope[1] < 0.0
    size = np.where(is_backward, -size, size)
    N = (size + flux * (1.0 - T / alpha)) / (1.0 - flux / alpha)
    return np.maximum(N, 0.0) if system.law == "tension-only" else N
