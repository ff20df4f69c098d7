"""Measurements of a Galerkin system on its states."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cablefem.response import Observation, States
from galerkin.bases.kink import Array
from galerkin.equilibrium import Equilibrium, combined, recover, tension
from galerkin.models import ChordCable, FullCable

if TYPE_CHECKING:
    from galerkin.equations import GalerkinSystem

NEAR_SUPPORT = 1e-12  # least length of a side, for the hat's slope


@dataclass(frozen=True, slots=True)
class History:
    """Coefficients of n instants."""

    s_o: Array  # (n,)
    ds_o: Array
    dds_o: Array
    Q: Array  # (n, fields, N) of the standing functions
    V: Array
    A: Array
    q_hat: Array  # (n, fields); zero without a hat
    v_hat: Array
    a_hat: Array

    def rays(self, order: int) -> tuple[Array, Array]:
        """Time derivatives of q_hat/h behind and ahead; h is the length of the side."""
        h = np.clip(self.s_o, NEAR_SUPPORT, 1.0 - NEAR_SUPPORT)[:, None]
        dh, ddh = self.ds_o[:, None], self.dds_o[:, None]
        behind, ahead = (self._ray(order, *side) for side in ((h, dh, ddh), (1.0 - h, -dh, -ddh)))
        return behind, ahead

    def _ray(self, order: int, h: Array, dh: Array, ddh: Array) -> Array:
        q, v, a = self.q_hat, self.v_hat, self.a_hat
        if order == 0:
            return q / h
        if order == 1:
            return (v - dh / h * q) / h
        return (a - (2.0 * dh * v + ddh * q - 2.0 * dh**2 / h * q) / h) / h


class AtMass(NamedTuple):
    """Motion along the path, and slopes of w."""

    w: Array  # (n, fields)
    w_t: Array
    w_tt: Array
    slopes: Array  # behind and ahead, (2, n, fields)


class Fields(NamedTuple):
    """k frames, m stations, (k, fields, m); at s = s_o the side behind."""

    w: Array
    w_t: Array
    w_s: Array


class Forces(NamedTuple):
    sides: Array  # r' behind and ahead of the mass, (2, n, fields)
    T: tuple[Array, Array]  # behind and ahead of the mass, (n,)
    T_pointwise: tuple[Array, Array]
    along: Array  # at frames x stations, (k, m)
    along_pointwise: Array
    reactions: tuple[Array, Array]  # left and right, (n, 2)
    strain: Array
    weight: Array  # potential energy of the cable
    least: Array  # least tension and its s, (n,)
    least_at: Array
    working: Array  # see `GalerkinSystem.drives`; 0 for quadratic energies
    lost: Any = 0.0  # power of internal damping along the cable


def observe(system: GalerkinSystem, states: States, s: Array, frames: Array) -> Observation:
    """Measure a history; see `Observation`.

    A single field w is shown as (u, v) = w (-chord_sin, chord_cos) on the catenary.
    """
    groups, cable, along = system.groups, system.cable, direction(system)
    x = history(system, states)
    of = system.measures
    mass, fields = of.at_mass(system, states, x), of.fields(system, x, s, frames)
    if isinstance(cable, FullCable):
        forces = _full(system, cable, x, mass, fields, s, frames)
    else:
        forces = _one_field(system, cable, x, mass, s, frames)

    _, xp, yp, xpp, ypp = groups.static(x.s_o)
    static, curvature = np.stack([xp, yp], axis=1), np.stack([xpp, ypp], axis=1)
    slope, bend = cable.static_slope(x.s_o)
    ds_o, dds_o = x.ds_o[:, None], x.dds_o[:, None]
    velocity, acceleration = mass.w_t + ds_o * slope, mass.w_tt + dds_o * slope + ds_o**2 * bend
    drives = system.drives(states, velocity, acceleration, forces.sides, forces.working)
    of_cable = of.kinetic(system, x)
    kinetic, lost = of_cable + 0.5 * system.inertia * np.sum(velocity**2, axis=1), 2.0 * system.damping * of_cable
    powers = drives.powers | ({"lost_viscous": -lost} if system.damping else {})
    if groups.internal_damping:  # and in a thin layer behind the car, which the grip supplies
        layer = x.ds_o * np.nan_to_num(forces.T[1] - forces.T[0]) ** 2 / (2.0 * groups.alpha)
        powers |= {"lost_internal": -forces.lost - layer}
    place_y = cable.static_depth(x.s_o) + mass.w[:, -1]
    potential = forces.weight - system.mu * cable.weight[-1] * place_y
    seen = forces.sides if system.fields == 2 else static + mass.slopes @ along
    left, right = x.s_o > 0.0, x.s_o < 1.0
    (u, v), (du, dv) = (np.einsum("kfs,fd->dks", y, along) for y in fields[:2])
    return Observation(
        path=mass.w @ along, path_velocity=mass.w_t @ along + ds_o * static,
        path_acceleration=mass.w_tt @ along + dds_o * static + ds_o**2 * curvature,
        slope_behind=seen[0], slope_ahead=seen[1],
        T_behind=np.where(left, forces.T[0], np.nan), T_ahead=np.where(right, forces.T[1], np.nan),
        T_behind_pointwise=np.where(left, forces.T_pointwise[0], np.nan),
        T_ahead_pointwise=np.where(right, forces.T_pointwise[1], np.nan),
        energy=kinetic + forces.strain + potential, power=drives.power - lost - forces.lost,
        tension_min=forces.least, tension_min_at=forces.least_at,
        u=u, v=v, du=du, dv=dv, T=forces.along, T_pointwise=forces.along_pointwise,
        reaction_left=forces.reactions[0], reaction_right=forces.reactions[1],
        t=states.t, s_o=x.s_o, contact=drives.contact @ along, haul=drives.haul, powers=powers,
        kinetic=kinetic, strain=forces.strain, potential=potential,
    )  # fmt: skip


def direction(system: GalerkinSystem) -> Array:
    """The fields as (u, v), (fields, 2)."""
    if system.fields == 2:
        return np.eye(2)
    return np.array([[-system.groups.chord_sin, system.groups.chord_cos]])


def history(system: GalerkinSystem, states: States) -> History:
    q, v, a = (y[:, : system.n_modal].reshape(-1, system.fields, system.n) for y in (states.q, states.v, states.a))
    s_o, ds_o, dds_o = system.kinematics(states)
    if system.kink:
        hat = q[..., -1], v[..., -1], a[..., -1]
        return History(s_o, ds_o, dds_o, q[..., :-1], v[..., :-1], a[..., :-1], *hat)
    none = np.zeros(q.shape[:2])
    return History(s_o, ds_o, dds_o, q, v, a, none, none, none)


class Measures:
    """Measurements over standing functions, with or without a hat."""

    @staticmethod
    def displaced(system: GalerkinSystem, states: States, x: History) -> Array:
        """w at the mass, (n, fields)."""
        if system.path_form:
            return states.q[:, system.n_modal :]
        return combined(x.Q, system.basis.basis.phi(x.s_o)) + x.q_hat

    @staticmethod
    def at_mass(system: GalerkinSystem, states: States, x: History) -> AtMass:
        basis, ds_o = system.basis.basis, x.ds_o[:, None]
        phi, first = basis.phi(x.s_o), basis.phi(x.s_o, 1)
        w, w_s = Measures.displaced(system, states, x), combined(x.Q, first)
        if system.path_form:
            w_t, w_tt = (y[:, system.n_modal :] for y in (states.v, states.a))
        else:
            w_t = combined(x.V, phi) + x.v_hat + ds_o * w_s
            bend = combined(x.Q, basis.phi(x.s_o, 2)) if basis.smooth else np.zeros_like(w)
            w_tt = combined(x.A, phi) + x.a_hat + 2.0 * ds_o * combined(x.V, first)
            w_tt += x.dds_o[:, None] * w_s + ds_o**2 * bend
        return AtMass(w, w_t, w_tt, np.array([w_s, w_s]) + hat_slopes(x))

    @staticmethod
    def fields(system: GalerkinSystem, x: History, s: Array, frames: Array) -> Fields:
        basis, side = system.basis.basis, (s <= x.s_o[frames, None])[:, None]
        values, z = basis.phi(s), np.where(side, s, 1.0 - s)

        def whole(standing: Array, functions: Array, order: int, z: Array) -> Array:
            hat = np.where(side, *(ray[frames, :, None] for ray in x.rays(order)))
            return np.einsum("kfm,sm->kfs", standing[frames], functions) + z * hat

        slopes = whole(x.Q, basis.phi(s, 1), 0, np.where(side, 1.0, -1.0))
        return Fields(whole(x.Q, values, 0, z), whole(x.V, values, 1, z), slopes)

    @staticmethod
    def kinetic(system: GalerkinSystem, x: History) -> Array:
        """1/2 int |w.|^2 ds, (n,), by `Moving`."""
        twice = np.einsum("nfi,ij,nfj->n", x.V, system.basis.basis.mass(), x.V, optimize=True)
        if system.kink:
            value, first, _ = system.basis.overlap(np.minimum(x.s_o, 1.0 - NEAR_SUPPORT))
            steep = x.ds_o**2 / (3.0 * np.maximum(x.s_o * (1.0 - x.s_o), NEAR_SUPPORT))
            q, v = x.q_hat, x.v_hat
            cross = 2.0 * v * combined(x.V, value) + 2.0 * x.ds_o[:, None] * q * combined(x.V, first)
            twice = twice + np.sum(cross + v**2 / 3.0 + steep[:, None] * q**2, axis=1)
        return 0.5 * twice

    @staticmethod
    def mean(system: GalerkinSystem, x: History) -> Array:
        """int w ds, (n, fields)."""
        return x.Q @ system.basis.basis.integral() + 0.5 * x.q_hat

    @staticmethod
    def steepness(system: GalerkinSystem, x: History) -> Array:
        """int w'^2 ds of one field, (n,)."""
        basis, Q, q = system.basis.basis, x.Q[:, 0], x.q_hat[:, 0]
        steep = 1.0 / np.maximum(x.s_o * (1.0 - x.s_o), NEAR_SUPPORT)
        square = np.einsum("ni,ij,nj->n", Q, basis.stiffness(), Q, optimize=True)
        return square + steep * q * (2.0 * np.sum(Q * basis.phi(x.s_o), axis=1) + q)

    @staticmethod
    def recover(system: GalerkinSystem, x: History, s: Array, frames: Array) -> Equilibrium:
        return recover(system, x, s, frames)


def hat_slopes(x: History) -> Array:
    """The hat's part of w' behind and ahead; on the left support the limit t -> 0+."""
    behind, ahead = x.rays(0)
    entry, ds_o, dds_o = x.s_o == 0.0, x.ds_o[:, None], x.dds_o[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        start = np.where(ds_o != 0.0, x.v_hat / ds_o, np.where(dds_o != 0.0, x.a_hat / dds_o, 0.0))
    return np.array([np.where(entry[:, None], start, behind), -ahead])


def _full(
    system: GalerkinSystem, cable: FullCable, x: History, mass: AtMass, fields: Fields, s: Array, frames: Array
) -> Forces:
    T_o, static_o, static = cable.groups.static(x.s_o)[0], *(cable.static_slope(y)[0] for y in (x.s_o, s))
    inside = replace(x, s_o=np.clip(x.s_o, NEAR_SUPPORT, 1.0 - NEAR_SUPPORT))
    by_balance = system.measures.recover(system, inside, s, frames)
    slopes = static_o + mass.slopes
    T = tension(by_balance.behind, slopes[0]), tension(by_balance.ahead, slopes[1])
    along = tension(by_balance.along, static + fields.w_s.transpose(0, 2, 1))
    sides = system.sides(slopes, by_balance, x.s_o)
    left, right = (cable.points(x.s_o, (side - static_o).T) for side in sides)
    mean = T_o * static_o.T + 0.5 * (left[2:4] + right[2:4])  # <N t>
    working = np.sum(mean * (sides[1] - sides[0]).T, axis=0) - (right[1] - left[1])
    pointwise = np.array([cable.points(s, slope)[0] for slope in fields.w_s]).reshape(len(frames), s.size)
    on_it = np.where(x.s_o > 0.0, T[0], np.inf), np.where(x.s_o < 1.0, T[1], np.inf)
    least = np.minimum(by_balance.least, np.minimum(*on_it))
    if system.law == "tension-only":
        least = np.maximum(least, 0.0)
    below = system.measures.mean(system, x)[:, 1]
    return Forces(
        sides, T, (left[0], right[0]), along, pointwise, (-by_balance.left, by_balance.right), by_balance.strain,
        -cable.weight[1] * below, least,
        np.where(least < by_balance.least, x.s_o, by_balance.least_at), working, by_balance.lost,
    )  # fmt: skip


def _one_field(
    system: GalerkinSystem, cable: ChordCable, x: History, mass: AtMass, s: Array, frames: Array
) -> Forces:  # fmt: skip
    none = np.zeros(x.s_o.size)
    square = system.measures.steepness(system, x)
    mean = -cable.curvature * system.measures.mean(system, x)[:, 0]
    h = cable.alpha * cable.lam * (mean + 0.5 * cable.kap * square)
    strain = 0.5 * cable.tau * square + 0.5 * h**2 / cable.alpha
    T, along = cable.groups.static(x.s_o)[0] + h, cable.groups.static(s)[0] + h[frames, None]
    sides = cable.static_slope(x.s_o)[0] + mass.slopes
    absent = np.full((x.s_o.size, 2), np.nan)
    return Forces(
        sides, (T, T), (T, T), along, along, (absent, absent), strain, none, cable.at_rest + h, none + cable.least_at,
        none,
    )  # fmt: skip
