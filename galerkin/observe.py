"""Measurements of a Galerkin system on its states."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cablefem.newmark import States
from cablefem.response import Observation
from galerkin.bases.kink import Array
from galerkin.equilibrium import (
    rope_forces_from_equilibrium,
    signed_tension,
    slopes_from_forces,
    sum_of_functions,
)
from galerkin.models import ChordCable, FullCable

if TYPE_CHECKING:
    from galerkin.equations import GalerkinSystem

NEAR_SUPPORT = 1e-12  # shortest side, for the hat's slope


class Measures:
    """Quantities of n instants, over fixed functions with or without a hat.

    q, v, a : coefficients (n, fields, N + 1); those of the hat come last, zero without one
    """

    def __init__(self, system: GalerkinSystem, states: States) -> None:
        self.system = system
        self.s_o, self.ds_o, self.dds_o = system.mass_kinematics(states)
        self.inside = np.clip(self.s_o, NEAR_SUPPORT, 1.0 - NEAR_SUPPORT)
        unknowns = np.stack([states.q, states.v, states.a])
        coefficients = unknowns[..., : system.n_modal].reshape(3, -1, system.fields, system.n)
        missing_hat = 0 if system.kink else 1
        self.q, self.v, self.a = np.pad(coefficients, [(0, 0), (0, 0), (0, 0), (0, missing_hat)])
        self.path_form = unknowns[..., system.n_modal :].copy()  # (3, n, fields) where the system has one

    def hat_slope_rates(self, order: int) -> tuple[Array, Array]:
        """Time derivatives of this order of q_hat/h behind and ahead; h is the length of the side."""
        h = self.inside[:, None]
        dh = self.ds_o[:, None]
        ddh = self.dds_o[:, None]
        behind = self._hat_slope_time_derivative(order, h, dh, ddh)
        ahead = self._hat_slope_time_derivative(order, 1.0 - h, -dh, -ddh)
        return behind, ahead

    def _hat_slope_time_derivative(self, order: int, h: Array, dh: Array, ddh: Array) -> Array:
        """The same of a side of length h (n, 1), which changes by dh and ddh; (n, fields)."""
        q = self.q[..., -1]
        v = self.v[..., -1]
        if order == 0:
            return q / h
        if order == 1:
            return (v - dh / h * q) / h
        moving = 2.0 * dh * v + ddh * q - 2.0 * dh**2 / h * q
        return (self.a[..., -1] - moving / h) / h

    def hat_slopes(self) -> Array:
        """The hat's part of w' behind and ahead; on the left support the limit t -> 0+."""
        behind, ahead = self.hat_slope_rates(0)
        at_entry = self.s_o[:, None] == 0.0
        ds_o = self.ds_o[:, None]
        dds_o = self.dds_o[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            from_rest = np.where(dds_o != 0.0, self.a[..., -1] / dds_o, 0.0)
            start = np.where(ds_o != 0.0, self.v[..., -1] / ds_o, from_rest)
        return np.array([np.where(at_entry, start, behind), -ahead])

    def displacement_at_mass(self) -> Array:
        """w at the mass, (n, fields)."""
        if self.system.path_form:
            return self.path_form[0]
        phi = self.system.basis.basis.phi(self.s_o)
        return sum_of_functions(self.q[..., :-1], phi) + self.q[..., -1]

    def motion_and_slopes_at_mass(self) -> tuple[Array, Array, Array, Array]:
        """w, w., w.. along the path (n, fields), and w' behind and ahead (2, n, fields)."""
        basis = self.system.basis.basis
        ds_o = self.ds_o[:, None]
        phi = basis.phi(self.s_o)
        first = basis.phi(self.s_o, 1)
        Q = self.q[..., :-1]
        V = self.v[..., :-1]
        A = self.a[..., :-1]
        w = self.displacement_at_mass()
        w_s = sum_of_functions(Q, first)
        slopes = np.array([w_s, w_s]) + self.hat_slopes()
        if self.system.path_form:
            _, w_t, w_tt = self.path_form
            return w, w_t, w_tt, slopes
        w_ss = np.zeros_like(w)
        if basis.has_second_derivative:
            w_ss = sum_of_functions(Q, basis.phi(self.s_o, 2))
        w_t = sum_of_functions(V, phi) + self.v[..., -1] + ds_o * w_s
        w_tt = sum_of_functions(A, phi) + self.a[..., -1] + 2.0 * ds_o * sum_of_functions(V, first)
        w_tt += self.dds_o[:, None] * w_s + ds_o**2 * w_ss
        return w, w_t, w_tt, slopes

    def displacement_velocity_slope_fields(self, s: Array, frames: Array) -> Array:
        """w, w. and w' of k frames at m stations, (3, k, fields, m); at s = s_o the side behind."""
        basis = self.system.basis.basis
        is_behind = (s <= self.s_o[frames, None])[:, None]  # (k, 1, m)
        values = basis.phi(s)
        from_support = np.where(is_behind, s, 1.0 - s)
        outward = np.where(is_behind, 1.0, -1.0)

        def with_hat(y: Array, functions: Array, order: int, hat: Array) -> Array:
            behind, ahead = (rate[frames, :, None] for rate in self.hat_slope_rates(order))
            smooth = np.einsum("kfm,sm->kfs", y[frames, :, :-1], functions)
            return smooth + hat * np.where(is_behind, behind, ahead)

        w = with_hat(self.q, values, 0, from_support)
        w_t = with_hat(self.v, values, 1, from_support)
        w_s = with_hat(self.q, basis.phi(s, 1), 0, outward)
        return np.array([w, w_t, w_s])

    def cable_kinetic_energy(self) -> Array:
        """1/2 int |w.|^2 ds, (n,), by `KinkedBasis`."""
        basis = self.system.basis
        V = self.v[..., :-1]
        twice = np.einsum("nfi,ij,nfj->n", V, basis.basis.mass_matrix(), V, optimize=True)
        if self.system.kink:
            q = self.q[..., -1]
            v = self.v[..., -1]
            ds_o = self.ds_o[:, None]
            inside = self.inside[:, None]
            overlap, derivative, _ = basis.hat_overlaps_and_derivatives(np.minimum(self.s_o, 1.0 - NEAR_SUPPORT))
            cross = 2.0 * v * sum_of_functions(V, overlap) + 2.0 * ds_o * q * sum_of_functions(V, derivative)
            steep = ds_o**2 / (3.0 * inside * (1.0 - inside))
            twice = twice + np.sum(cross + v**2 / 3.0 + steep * q**2, axis=1)
        return 0.5 * twice

    def vertical_displacement_integral(self) -> Array:
        """int v ds, (n,)."""
        integral = self.system.basis.integrals()
        return np.array([v[: integral.size] @ integral for v in self.q[:, -1]])


def observe(system: GalerkinSystem, states: States, s: Array, frames: Array) -> Observation:
    """Measurements of a history; fields at stations s (m,) for the rows `frames` (k,)."""
    groups = system.groups
    cable = system.cable
    direction = cable.direction  # of the fields, as (u, v)
    x = Measures(system, states)
    w, w_t, w_tt, slopes = x.motion_and_slopes_at_mass()
    fields = x.displacement_velocity_slope_fields(s, frames)
    slope, bend = cable.static_slope_and_curvature(x.s_o)
    sides = slope + slopes
    if isinstance(cable, FullCable):
        forces, sides, material_force = _full_cable_forces(cable, x, sides, fields[2], s, frames)
        sunk = x.vertical_displacement_integral()
    else:
        forces = _chord_tensions_and_strain_energy(cable, x, s, frames)
        material_force = sunk = np.zeros(x.s_o.size)
    _, xp, yp, xpp, ypp = groups.tension_and_shape_derivatives(x.s_o)
    static = np.stack([xp, yp], axis=1)
    curvature = np.stack([xpp, ypp], axis=1)
    ds_o = x.ds_o[:, None]
    dds_o = x.dds_o[:, None]
    velocity = w_t + ds_o * slope  # of the mass, by fields
    acceleration = w_tt + dds_o * slope + ds_o**2 * bend
    contact = system.mu * cable.weight - system.inertia * acceleration
    along_mean_slope = np.sum(contact * sides.mean(axis=0), axis=1)
    power = x.ds_o * (material_force - along_mean_slope)
    of_cable = x.cable_kinetic_energy()
    kinetic = of_cable + 0.5 * system.inertia * np.sum(velocity**2, axis=1)
    viscous = 2.0 * system.damping * of_cable
    powers = {"lost_viscous": -viscous} if system.damping else {}
    depth = cable.static_depth(x.s_o) + w[:, -1]
    potential = -cable.weight[-1] * (sunk + system.mu * depth)
    slope_behind, slope_ahead = sides if system.fields == 2 else static + slopes @ direction
    displacement, rate, _ = fields
    u, v = np.einsum("kfs,fd->dks", displacement, direction)
    du, dv = np.einsum("kfs,fd->dks", rate, direction)
    path_acceleration = w_tt @ direction + dds_o * static + ds_o**2 * curvature
    return Observation(
        path=w @ direction, path_velocity=w_t @ direction + ds_o * static, path_acceleration=path_acceleration,
        slope_behind=slope_behind, slope_ahead=slope_ahead,
        energy=kinetic + forces["strain"] + potential, power=power - viscous,
        u=u, v=v, du=du, dv=dv, t=states.t, s_o=x.s_o, contact=contact @ direction, powers=powers,
        kinetic=kinetic, potential=potential, **forces,
    )  # fmt: skip


class FullCableForces(NamedTuple):
    """Forces of the full cable at n instants."""

    fields: dict[str, Array]  # of `Observation`
    slopes: Array  # r' behind and ahead of the mass, (2, n, 2)
    material_force: Array  # (n,) <N t> . [r'] - [W]


def _full_cable_forces(
    cable: FullCable, x: Measures, slopes: Array, w_s: Array, s: Array, frames: Array
) -> FullCableForces:  # fmt: skip
    """From r' by the basis: `slopes` beside the mass (2, n, 2), w_s = w' at stations s in these frames (k, 2, m)."""
    T_o = cable.groups.static_tension(x.s_o)
    static_o, _ = cable.static_slope_and_curvature(x.s_o)
    static, _ = cable.static_slope_and_curvature(s)
    balanced = rope_forces_from_equilibrium(x, s, frames)
    none_behind = np.where(x.s_o > 0.0, 0.0, np.nan)
    none_ahead = np.where(x.s_o < 1.0, 0.0, np.nan)
    behind = signed_tension(balanced.behind, slopes[0]) + none_behind
    ahead = signed_tension(balanced.ahead, slopes[1]) + none_ahead
    sides = slopes
    if x.system.by_force:
        both = np.array([balanced.behind, balanced.ahead])
        sides = slopes_from_forces(both, slopes, T_o, cable.alpha)
    left, right = (cable.pointwise_force_energy_and_tangent(x.s_o, (side - static_o).T) for side in sides)
    mean_force = T_o * static_o.T + 0.5 * (left[2:4] + right[2:4])  # <N t>
    kink = (sides[1] - sides[0]).T  # [r']
    material_force = np.sum(mean_force * kink, axis=0) - (right[1] - left[1])
    smallest = np.fmin(balanced.min_tension, np.fmin(behind, ahead))
    if x.system.law == "tension-only":
        smallest = np.maximum(smallest, 0.0)
    smallest_at = np.where(smallest < balanced.min_tension, x.s_o, balanced.min_tension_at)
    along = signed_tension(balanced.along, static + w_s.transpose(0, 2, 1))
    pointwise = np.array([cable.pointwise_force_energy_and_tangent(s, slope)[0] for slope in w_s])
    fields = {
        "T_behind": behind, "T_behind_pointwise": left[0] + none_behind, "reaction_left": -balanced.left,
        "T_ahead": ahead, "T_ahead_pointwise": right[0] + none_ahead, "reaction_right": balanced.right,
        "T": along, "T_pointwise": pointwise.reshape(len(frames), s.size), "strain": balanced.strain,
        "tension_min": smallest, "tension_min_at": smallest_at,
    }  # fmt: skip
    return FullCableForces(fields, sides, material_force)


def _chord_tensions_and_strain_energy(cable: ChordCable, x: Measures, s: Array, frames: Array) -> dict[str, Array]:
    """Fields of `Observation`."""
    values = []
    for s_o, Q in zip(x.inside.tolist(), x.q[..., : x.system.n], strict=True):
        tables = cable.tables_at(x.system.basis, s_o)
        values.append(cable.strain_energy_and_tension_rise(tables, Q))
    strain, h = np.array(values).T
    T = cable.groups.static_tension(s) + h[frames, None]
    at_mass = cable.groups.static_tension(x.s_o) + h
    return {
        "T": T, "T_behind": np.where(x.s_o > 0.0, at_mass, np.nan), "T_ahead": np.where(x.s_o < 1.0, at_mass, np.nan),
        "tension_min": cable.static_min_tension + h, "tension_min_at": np.full(h.shape, cable.min_tension_at),
        "strain": strain,
    }  # fmt: skip
