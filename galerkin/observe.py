"""What a Galerkin system measures on its own states: path, tensions, energy, fields; vectorised over the history."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from cablefem.response import Observation, States
from galerkin.bases import Basis
from galerkin.bases.kink import Array, TravellingKink
from galerkin.equilibrium import combined, recover
from galerkin.models import ChordCable, FullCable

if TYPE_CHECKING:
    from galerkin.equations import GalerkinSystem

# A hat that peaks on a support has an infinite slope; its coefficient is zero there, and 0 x 1e12 is 0 as it should be.
NEAR_SUPPORT = 1e-12


@dataclass(frozen=True, slots=True)
class History:
    """Coefficients of n instants split into the standing functions and the hat (zero without one)."""

    s_o: Array  # (n,)
    ds_o: Array
    dds_o: Array
    Q: Array  # (n, fields, N) of the standing functions
    V: Array
    A: Array
    q_hat: Array  # (n, fields)
    v_hat: Array
    a_hat: Array
    bows: Array  # (3, n, fields, 2) amplitudes of the bubbles behind and ahead and their rates, see `galerkin.bow`

    @property
    def sides(self) -> tuple[tuple[Array, Array, Array], ...]:
        """Lengths of the pieces and their rates, (n, 1) each."""
        h = np.clip(self.s_o, NEAR_SUPPORT, 1.0 - NEAR_SUPPORT)[:, None]
        dh, ddh = self.ds_o[:, None], self.dds_o[:, None]
        return (h, dh, ddh), (1.0 - h, -dh, -ddh)

    def pieces(self, order: int) -> list[tuple[Array, Array]]:
        """What travels behind and ahead, its time derivative of that order: coefficients (n, fields) of z and z^2.

        z is the distance from the support; the hat is z/h, a bubble z/h - (z/h)^2.
        """
        hat, out = np.array([self.q_hat, self.v_hat, self.a_hat]), []
        for i, (h, dh, ddh) in enumerate(self.sides):
            bow, powers = self.bows[..., i], []
            for m, (c, dc, ddc) in ((1, hat + bow), (2, -bow)):
                rates = c, dc - m * dh / h * c, ddc - m / h * (2.0 * dh * dc + ddh * c - (m + 1) * dh**2 / h * c)
                powers.append(rates[order] / h**m)
            out.append((powers[0], powers[1]))
        return out


def observe(system: GalerkinSystem, states: States, s: Array, frames: Array) -> Observation:
    """Measure a history; see `Observation`.

    One field w normal to the chord is shown as (u, v) = w (-chord_sin, chord_cos) on the catenary; its energy and
    power are those of the model itself, motion normal to the chord over the parabola.
    """
    groups, cable, along = system.groups, system.cable, direction(system)
    x = history(system, states)
    n, fields = x.s_o.size, system.fields

    basis, smooth = system.basis.basis, system.basis.basis.smooth
    phi, first = basis.phi(x.s_o), basis.phi(x.s_o, 1)
    w_s = combined(x.Q, first)
    w = displaced(system, states, x)
    w_t = combined(x.V, phi) + x.v_hat + x.ds_o[:, None] * w_s  # along the path
    if system.path_form:
        w_t, w_tt = (y[:, system.n_modal :] for y in (states.v, states.a))
    else:
        # without phi'' (a moving force on a rough basis) the centrifugal part is left out: it enters no equation then
        bend = combined(x.Q, basis.phi(x.s_o, 2)) if smooth else np.zeros_like(w)
        w_tt = (
            combined(x.A, phi) + x.a_hat + 2.0 * x.ds_o[:, None] * combined(x.V, first)
            + x.dds_o[:, None] * w_s + x.ds_o[:, None] ** 2 * bend
        )  # fmt: skip
    travelling = _slopes(x)
    behind, ahead = w_s + travelling[0], w_s + travelling[1]

    T_o, xp, yp, xpp, ypp = groups.static(x.s_o)
    static, curvature = np.stack([xp, yp], axis=1), np.stack([xpp, ypp], axis=1)
    values = basis.phi(s)
    u_v, du_dv = _displacement(x, s, values, frames)
    w_s_frames = np.einsum("kfm,sm->kfs", x.Q[frames], basis.phi(s, 1))
    away, behind_it = (s - x.s_o[frames, None])[:, None], (s <= x.s_o[frames, None])[:, None]
    ends = ((y[frames, :, None], 2.0 * z[frames, :, None]) for y, (_, z) in zip(travelling, x.pieces(0), strict=True))
    slopes = w_s_frames + np.where(behind_it, *(y + z * away for y, z in ends))
    T_s = groups.static(s)[0]
    kinetic = _kinetic(system, x)
    p = np.stack([x.ds_o, x.dds_o, x.ds_o**2])[:, :, None]
    if isinstance(cable, FullCable):
        inside = replace(x, s_o=np.clip(x.s_o, NEAR_SUPPORT, 1.0 - NEAR_SUPPORT))
        forces = recover(system, inside, s, frames)
        sides = system.sides(static + np.array([behind, ahead]), forces, x.s_o)
        T_behind_pointwise, T_ahead_pointwise, working = _one_sided(cable, x.s_o, *(sides - static))
        strain, least, least_at = forces.strain, forces.least, forces.least_at
        below = x.Q[:, 1] @ basis.integral() + 0.5 * x.q_hat[:, 1]
        below = below + sum(x.bows[0, :, 1, i] * h[:, 0] for i, (h, _, _) in enumerate(x.sides)) / 6.0
        weight = -cable.weight[1] * below
        T_pointwise = np.array([cable.points(s, slope)[0] for slope in slopes]).reshape(len(frames), s.size)
        T_behind, T_ahead = (_tension(*y) for y in ((forces.behind, static + behind), (forces.ahead, static + ahead)))
        T = _tension(forces.along, np.stack(groups.static(s)[1:3], axis=-1) + slopes.transpose(0, 2, 1))
        reactions = -forces.left, forces.right
        place_y = groups.shape(x.s_o)[1] + w[:, 1]
        velocity, acceleration = w_t + p[0] * static, w_tt + p[1] * static + p[2] * curvature
    else:
        slope, bent = cable.static_slope(x.s_o)
        (strain, h), weight = _chord(cable, x, basis, phi), np.zeros(n)
        T_behind = T_ahead = T_behind_pointwise = T_ahead_pointwise = T_o + h
        reactions = (np.full((n, 2), np.nan),) * 2
        working = np.zeros(n)  # all energies are quadratic: mean force times jump of slope is the jump of energy
        least, least_at, T = cable.at_rest + h, np.full(n, cable.least_at), T_s + h[frames, None]
        T_pointwise = T
        place_y = (-0.5 * cable.curvature) * x.s_o * (1.0 - x.s_o) + w[:, 0]
        velocity, acceleration = w_t + p[0] * slope, w_tt + p[1] * slope + p[2] * bent
        sides = slope + np.array([behind, ahead])
    seen = sides if fields == 2 else static + np.array([behind, ahead]) @ along
    drives = system.drives(states, velocity, acceleration, sides, working)
    kinetic = kinetic + 0.5 * system.inertia * np.sum(velocity**2, axis=1)
    potential = weight - system.mu * cable.weight[-1] * place_y
    at_left, at_right = x.s_o > 0.0, x.s_o < 1.0
    fields_at = {name: np.einsum("kfs,f->ks", y, e) for name, y, e in (
        ("u", u_v, along[:, 0]), ("v", u_v, along[:, 1]),
        ("du", du_dv, along[:, 0]), ("dv", du_dv, along[:, 1]),
    )}  # fmt: skip
    return Observation(
        path=w @ along, path_velocity=w_t @ along + p[0] * static,
        path_acceleration=w_tt @ along + p[1] * static + p[2] * curvature,
        slope_behind=seen[0], slope_ahead=seen[1],
        T_behind=np.where(at_left, T_behind, np.nan), T_ahead=np.where(at_right, T_ahead, np.nan),
        T_behind_pointwise=np.where(at_left, T_behind_pointwise, np.nan),
        T_ahead_pointwise=np.where(at_right, T_ahead_pointwise, np.nan),
        energy=kinetic + strain + potential, power=drives.power, tension_min=least, tension_min_at=least_at,
        **fields_at, T=T, T_pointwise=T_pointwise, reaction_left=reactions[0], reaction_right=reactions[1],
        t=states.t, s_o=x.s_o, contact=drives.contact @ along, haul=drives.haul, powers=drives.powers,
        kinetic=kinetic, strain=strain, potential=potential,
    )  # fmt: skip


def direction(system: GalerkinSystem) -> Array:
    """Return (fields, 2): what one field w normal to the chord is as (u, v); two are those themselves."""
    if system.fields == 2:
        return np.eye(2)
    return np.array([[-system.groups.chord_sin, system.groups.chord_cos]])


def displaced(system: GalerkinSystem, states: States, x: History) -> Array:
    """Return w(s_o), (n, fields)."""
    return states.q[:, system.n_modal :] if system.path_form else combined(x.Q, system.basis.basis.phi(x.s_o)) + x.q_hat


def history(system: GalerkinSystem, states: States) -> History:
    s_o, ds_o, dds_o = system.kinematics(states)
    q, v, a = (y[:, : system.n_modal].reshape(-1, system.fields, system.n) for y in (states.q, states.v, states.a))
    bows = system.bows(np.array([s_o, ds_o, dds_o]))
    if system.kink:
        hat = q[..., -1], v[..., -1], a[..., -1]
        return History(s_o, ds_o, dds_o, q[..., :-1], v[..., :-1], a[..., :-1], *hat, bows)
    zero = np.zeros(q.shape[:2])
    return History(s_o, ds_o, dds_o, q, v, a, zero, zero, zero, bows)


def _slopes(x: History) -> tuple[Array, Array]:
    """What travels adds to w' behind and ahead of the mass, (n, fields) each; on the left support the limit t -> 0+."""
    s_o, ds_o, dds_o = x.s_o[:, None], x.ds_o[:, None], x.dds_o[:, None]
    entry = s_o == 0.0
    moving = entry & (ds_o != 0.0)
    pulled = entry & (ds_o == 0.0) & (dds_o != 0.0)
    left = np.where(entry, 0.0, x.q_hat) / np.where(entry, 1.0, s_o)
    left = left + np.where(moving, x.v_hat, 0.0) / np.where(moving, ds_o, 1.0)
    left = left + np.where(pulled, x.a_hat, 0.0) / np.where(pulled, dds_o, 1.0)
    (_, behind), (_, ahead) = x.pieces(0)
    rest = np.maximum(1.0 - s_o, NEAR_SUPPORT)
    return left + behind * s_o, -x.q_hat / rest - ahead * rest


def _displacement(x: History, s: Array, values: Array, frames: Array) -> tuple[Array, Array]:
    """w and dw/dt at fixed s, (k, fields, m) each; at s = s_o the side behind."""
    behind = (s <= x.s_o[frames, None])[:, None]
    z = np.where(behind, s, 1.0 - s)
    out = []
    for order, y in enumerate((x.Q, x.V)):
        rides = (ray[frames, :, None] * z + bow[frames, :, None] * z**2 for ray, bow in x.pieces(order))
        out.append(np.einsum("kfm,sm->kfs", y[frames], values) + np.where(behind, *rides))
    return out[0], out[1]


def _kinetic(system: GalerkinSystem, x: History) -> Array:
    """1/2 int |w.|^2 ds of the cable, (n,), by the closed forms of `TravellingKink`."""
    twice = np.einsum("nfi,ij,nfj->n", x.V, system.basis.basis.mass(), x.V, optimize=True)
    if isinstance(system.basis, TravellingKink):
        value, first, _ = system.basis.overlap(np.minimum(x.s_o, 1.0 - NEAR_SUPPORT))
        steep = x.ds_o**2 / (3.0 * np.maximum(x.s_o * (1.0 - x.s_o), NEAR_SUPPORT))
        q, v = x.q_hat, x.v_hat
        cross = 2.0 * v * combined(x.V, value) + 2.0 * x.ds_o[:, None] * q * combined(x.V, first)
        twice = twice + np.sum(cross + v**2 / 3.0 + steep[:, None] * q**2, axis=1)
        if x.bows.any():
            twice = twice + _kinetic_of_bubbles(system.basis.basis, x)
    return 0.5 * twice


def _kinetic_of_bubbles(sines: Basis, x: History) -> Array:
    """What bubbles add to int |w.|^2 ds, (n,); int z phi ds and int z^2 phi ds by primitives."""
    total, ends = np.zeros(x.s_o.size), [sines.phi(np.array([0.0, 1.0]), -m) for m in (1, 2, 3)]
    first, second, third = (sines.phi(x.s_o, -m) for m in (1, 2, 3))
    bare = replace(x, bows=np.zeros_like(x.bows)).pieces(1)
    for i, ((h, _, _), (ray, bow), (hat, _)) in enumerate(zip(x.sides, x.pieces(1), bare, strict=True)):
        sign = 1.0 - 2.0 * i
        by_z = sign * h * first - second + ends[1][i]
        by_z2 = sign * h**2 * first - 2.0 * h * second + 2.0 * sign * (third - ends[2][i])
        part = 2.0 * (combined(x.V, by_z) * (ray - hat) + combined(x.V, by_z2) * bow)
        part += (ray**2 - hat**2) * h**3 / 3.0 + ray * bow * h**4 / 2.0 + bow**2 * h**5 / 5.0
        total += np.sum(part, axis=1)
    return total


def _one_sided(cable: FullCable, s_o: Array, behind: Array, ahead: Array) -> tuple[Array, Array, Array]:
    """Tension behind and ahead of the mass and <N t> . [r'] - [W], all (n,)."""
    left, right = (cable.points(s_o, slope.T) for slope in (behind, ahead))
    T, xp, yp, _, _ = cable.groups.static(s_o)
    mean = T * np.array([xp, yp]) + 0.5 * (left[2:4] + right[2:4])
    return left[0], right[0], np.sum(mean * (ahead - behind).T, axis=0) - (right[1] - left[1])


def _tension(force: Array, r: Array) -> Array:
    """|N t| with the sign it has along r', (...,)."""
    return np.copysign(np.hypot(force[..., 0], force[..., 1]), np.sum(force * r, axis=-1))


def _chord(cable: ChordCable, x: History, basis, phi: Array) -> tuple[Array, Array]:
    """Potential energy of the one-field models and their tension increment h, (n,) each."""
    Q, q = x.Q[:, 0], x.q_hat[:, 0]
    steep = 1.0 / np.maximum(x.s_o * (1.0 - x.s_o), NEAR_SUPPORT)
    square = np.einsum("ni,ij,nj->n", Q, basis.stiffness(), Q, optimize=True)
    square += steep * q * (2.0 * np.sum(Q * phi, axis=1) + q)
    mean = -cable.curvature * (Q @ basis.integral() + 0.5 * q)
    h = cable.alpha * cable.lam * (mean + 0.5 * cable.kap * square)
    return 0.5 * cable.tau * square + 0.5 * h**2 / cable.alpha, h
