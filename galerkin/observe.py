"""What a Galerkin system measures on its own states: path, tensions, energy, fields; vectorised over the history."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from cablefem.response import Observation, States
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
    q_bow: Array  # (n, fields, 2) of the bubbles behind and ahead, zero without them
    v_bow: Array
    a_bow: Array


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
    left, right = _slopes(x)
    behind, ahead = w_s + left, w_s + right

    T_o, xp, yp, xpp, ypp = groups.static(x.s_o)
    static, curvature = np.stack([xp, yp], axis=1), np.stack([xpp, ypp], axis=1)
    values = basis.phi(s)
    u_v, du_dv = _displacement(x, s, values, frames)
    w_s_frames = np.einsum("kfm,sm->kfs", x.Q[frames], basis.phi(s, 1))
    side = (s[None, :] <= x.s_o[frames, None])[:, None, :]
    slopes = w_s_frames + np.where(side, left[frames, :, None], right[frames, :, None])
    slopes += 2.0 * _over(x, frames, s)[:, None] * np.where(side, *_bow_slopes(x, frames))
    T_s = groups.static(s)[0]
    kinetic = _kinetic(system, x)
    p = np.stack([x.ds_o, x.dds_o, x.ds_o**2])[:, :, None]
    if isinstance(cable, FullCable):
        inside = replace(x, s_o=np.clip(x.s_o, NEAR_SUPPORT, 1.0 - NEAR_SUPPORT))
        forces = recover(system, inside, s, frames)
        sides = system.sides(static + np.array([behind, ahead]), forces, x.s_o)
        T_behind_pointwise, T_ahead_pointwise, working = _one_sided(cable, x.s_o, *(sides - static))
        strain, least, least_at = forces.strain, forces.least, forces.least_at
        bows = x.q_bow[:, 1] * np.stack([x.s_o, 1.0 - x.s_o], axis=1) / 6.0
        weight = -cable.weight[1] * (x.Q[:, 1] @ basis.integral() + 0.5 * x.q_hat[:, 1] + bows.sum(axis=1))
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
    N, travels = system.basis.basis.n, system.basis.travels
    standing, hat, bows = [], [], []
    for y in (q, v, a):
        standing.append(y[..., :N])
        hat.append(y[..., -1] if travels else np.zeros(y.shape[:2]))
        bows.append(y[..., N : N + 2] if travels > 1 else np.zeros((*y.shape[:2], 2)))
    return History(s_o, ds_o, dds_o, *standing, *hat, *bows)


def _over(x: History, frames: Array, s: Array) -> Array:
    """1 - s/s_o behind and 1 - (1 - s)/(1 - s_o) ahead of the mass, (k, m)."""
    s_o = np.clip(x.s_o[frames], NEAR_SUPPORT, 1.0 - NEAR_SUPPORT)[:, None]
    return 1.0 - np.where(s <= s_o, s / s_o, (1.0 - s) / (1.0 - s_o))


def _bow_slopes(x: History, frames: Any = slice(None)) -> tuple[Array, Array]:
    """What the bubbles take from w' behind and ahead of the mass, (n, fields, 1) each."""
    s_o = np.clip(x.s_o[frames], NEAR_SUPPORT, 1.0 - NEAR_SUPPORT)[:, None, None]
    return x.q_bow[frames, :, :1] / s_o, -x.q_bow[frames, :, 1:] / (1.0 - s_o)


def _slopes(x: History) -> tuple[Array, Array]:
    """What travels adds to w' behind and ahead of the mass, (n, fields) each; on the left support the limit t -> 0+."""
    s_o, ds_o, dds_o = x.s_o[:, None], x.ds_o[:, None], x.dds_o[:, None]
    entry = s_o == 0.0
    moving = entry & (ds_o != 0.0)
    pulled = entry & (ds_o == 0.0) & (dds_o != 0.0)
    left = np.where(entry, 0.0, x.q_hat) / np.where(entry, 1.0, s_o)
    left = left + np.where(moving, x.v_hat, 0.0) / np.where(moving, ds_o, 1.0)
    left = left + np.where(pulled, x.a_hat, 0.0) / np.where(pulled, dds_o, 1.0)
    behind, ahead = _bow_slopes(x)
    return left - behind[..., 0], -x.q_hat / np.maximum(1.0 - s_o, NEAR_SUPPORT) - ahead[..., 0]


def _displacement(x: History, s: Array, values: Array, frames: Array) -> tuple[Array, Array]:
    """w and dw/dt at fixed s, (k, fields, m) each; at s = s_o the side behind."""
    s_o, ds_o = np.maximum(x.s_o[frames], NEAR_SUPPORT)[:, None], x.ds_o[frames, None]
    rest = np.maximum(1.0 - s_o, NEAR_SUPPORT)
    behind = s <= s_o
    hat = np.where(behind, s / s_o, (1.0 - s) / rest)
    hat_t = ds_o * np.where(behind, -s / s_o**2, (1.0 - s) / rest**2)
    # the bubbles are hat (1 - hat)
    bow, bow_t = hat * (1.0 - hat), (1.0 - 2.0 * hat) * hat_t
    w, w_t = (
        np.einsum("kfm,sm->kfs", y[frames], values) + z[frames][:, :, None] * hat[:, None]
        + np.where(behind[:, None], *(b[frames, :, i, None] for i in range(2))) * bow[:, None]
        for y, z, b in ((x.Q, x.q_hat, x.q_bow), (x.V, x.v_hat, x.v_bow))
    )  # fmt: skip
    q_bow = np.where(behind[:, None], *(x.q_bow[frames, :, i, None] for i in range(2)))
    return w, w_t + x.q_hat[frames][:, :, None] * hat_t[:, None] + q_bow * bow_t[:, None]


def _kinetic(system: GalerkinSystem, x: History) -> Array:
    """1/2 int |w.|^2 ds of the cable, (n,), by the closed forms of `TravellingKink`."""
    twice = np.einsum("nfi,ij,nfj->n", x.V, system.basis.basis.mass(), x.V, optimize=True)
    if isinstance(system.basis, TravellingKink):
        value, first, _ = system.basis.overlap(np.minimum(x.s_o, 1.0 - NEAR_SUPPORT))
        steep = x.ds_o**2 / (3.0 * np.maximum(x.s_o * (1.0 - x.s_o), NEAR_SUPPORT))
        q, v = x.q_hat, x.v_hat
        cross = 2.0 * v * combined(x.V, value) + 2.0 * x.ds_o[:, None] * q * combined(x.V, first)
        twice = twice + np.sum(cross + v**2 / 3.0 + steep[:, None] * q**2, axis=1)
        if system.basis.travels > 1:
            twice = twice + _kinetic_of_bubbles(system.basis, x)
    return 0.5 * twice


def _kinetic_of_bubbles(basis: TravellingKink, x: History) -> Array:
    """What bubbles add to int |w.|^2 ds, (n,)."""
    total, overlaps = np.zeros(x.s_o.size), basis.bubble_overlap(x.s_o)
    for i, (h, dh) in enumerate(((x.s_o, x.ds_o), (1.0 - x.s_o, -x.ds_o))):
        h, dh = h[:, None], dh[:, None]
        q, v, q_hat, v_hat = x.q_bow[..., i], x.v_bow[..., i], x.q_hat, x.v_hat
        value, first = overlaps[i]
        part = 2.0 * v * combined(x.V, value) + 2.0 * x.ds_o[:, None] * q * combined(x.V, first)
        part += h * v * (v / 30.0 + v_hat / 6.0) + dh * (v * q / 30.0 + v_hat * q / 3.0 - v * q_hat / 6.0)
        total += np.sum(part + dh**2 / np.maximum(h, NEAR_SUPPORT) * q * (2.0 / 15.0 * q - q_hat / 3.0), axis=1)
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
