"""Observation: paths, energies, and tensions and reactions from the balance of momentum.

Kinematics (n, 3) are s_o, ds_o, dds_o.  The mesh moves with c = ds_o chi: README.md, 1.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import dia_array

from cablefem.elements.forms import section_force, strain, tension
from cablefem.newmark import Array
from cablefem.response import Observation, States

if TYPE_CHECKING:
    from cablefem.elements.cable import CableElements


def observe(system: CableElements, states: States, s: Array, frames: NDArray[np.intp]) -> Observation:
    """Measurements of a history; fields at stations s (m,) for the rows `frames` (k,)."""
    g = system.groups
    n = states.t.size
    kinematics = system._kinematics(states)
    s_o, ds, dds = kinematics.T
    w, w_t, w_tt, *slopes = system._at_mass(states, kinematics)
    position, slope, bend = system.static(s_o)
    velocity = w_t + ds[:, None] * slope
    acceleration = w_tt + dds[:, None] * slope + (ds**2)[:, None] * bend
    force = system.inertia * acceleration - system.weight
    power = ds * np.sum(force * (slope + 0.5 * (slopes[0] + slopes[1])), axis=1)

    mesh_at = system._mesh_at(kinematics)
    size = system.fields * system.n_scalar
    q, v, a = (np.ascontiguousarray(x[:, :size]).reshape(n, -1, system.fields) for x in (states.q, states.v, states.a))
    full = system.fields == 2
    (kinetic, strain, potential), min_tension, min_at, internal, more = energies(system, mesh_at, q, v)
    lost = 2.0 * g.damping * kinetic
    powers = {}
    if g.damping:
        powers["lost_viscous"] = -lost
    kinetic += 0.5 * system.inertia * np.sum(velocity**2, axis=1)
    potential -= (position + w) @ system.weight

    T, xp, yp, xpp, ypp = g.static(s_o)
    static = np.stack([xp, yp], axis=1)
    bend = np.stack([xpp, ypp], axis=1)
    behind, ahead = (static + x @ system.direction for x in slopes)
    ends = _end_forces(system, mesh_at, (q, v, a), internal)
    motion, carried, c = system._along(states, kinematics, ends, force, s, frames)
    w_s, w_s_t, slopes_s = (x @ system.direction for x in motion)  # w, dw/dt, w' at the frames
    if full:
        at_mass = static, T, behind, ahead
        tensions, kink = _tensions(system, ends, (carried, slopes_s, s), (mesh_at[:, 1], c), at_mass)
        power += ds * kink
        if g.internal_damping:  # and in a thin layer behind the car, which the grip supplies
            lost = lost + more
            jump = np.nan_to_num(tensions["T_ahead"] - tensions["T_behind"])
            powers["lost_internal"] = -more - ds * jump**2 / (2.0 * g.alpha)
    else:
        tensions = _chord_tensions(system, ends, more, T, s, frames)
    power -= lost
    for name in [name for name in tensions if "behind" in name]:
        tensions[name] = np.where(s_o > 0.0, tensions[name], np.nan)
    return Observation(
        path=w @ system.direction, path_velocity=w_t @ system.direction + ds[:, None] * static,
        path_acceleration=w_tt @ system.direction + dds[:, None] * static + (ds**2)[:, None] * bend,
        slope_behind=behind, slope_ahead=ahead,
        energy=kinetic + strain + potential, power=power, kinetic=kinetic, strain=strain, potential=potential,
        tension_min=min_tension, tension_min_at=min_at,
        u=w_s[..., 0], v=w_s[..., 1], du=w_s_t[..., 0], dv=w_s_t[..., 1],
        t=states.t, s_o=s_o, contact=-force @ system.direction, **tensions,
        powers=powers,
    )  # fmt: skip


def energies(system: CableElements, mesh_at: Array, q: Array, v: Array) -> tuple[Any, ...]:
    """Kinetic energy, strain energy and potential of the cable (3, n), and the rest of `_strained`.

    mesh_at : (n, 3) kinematics of the mesh;  q, v : (n, n_scalar, fields).
    """
    s_o = mesh_at[:, 0]
    strain, *more = _strained(system, mesh_at, q, v)
    kinetic = kinetic_energy(system, mesh_at, q, v)
    depth = sum(h[:, None] * (of[:, 0] @ q) for of, h, _ in _sides(system, s_o))  # int w ds (n, fields)
    potential = -system.groups.sigma * (depth @ system.direction)[:, 1] * (system.fields == 2)
    return np.array([kinetic, strain, potential]), *more


def _sides(system: CableElements, s_o: Array) -> list[tuple[Array, Array, float]]:
    """`moments`, length h and dh/ds_o of each side; a fixed mesh has one."""
    return list(zip(system._moments, (s_o, 1.0 - s_o), (1.0, -1.0), strict=False))


def kinetic_energy(system: CableElements, mesh_at: Array, q: Array, v: Array) -> Array:
    """int |w.|^2/2 ds (n,): h/2 v.M v - ds_o v.G q + ds_o^2/(2h) q.H q of each side."""
    s_o, ds, _ = mesh_at.T
    q, v = (x.reshape(s_o.size, -1).T for x in (q, v))
    _, width, n = system._operators.shape
    total = np.zeros(s_o.size)
    offsets = system.fields * (width // 2 - np.arange(width))

    def product(k: int, x: Array, y: Array) -> Array:
        transposed = dia_array((system._operators[k], offsets), shape=(n, n))
        return np.sum((transposed @ x) * y, axis=0)

    for k, (_, h, _) in enumerate(_sides(system, s_o)):
        total += 0.5 * h * product(k, v, v)
        if len(system._operators) > 1:
            flux = np.divide(0.5 * ds**2, h, out=np.zeros_like(h), where=h > 0.0)
            total += flux * product(6 + k, q, q) - ds * product(2 + k, v, q)
    return total


def _strained(system: CableElements, mesh_at: Array, q: Array, v: Array) -> tuple[Array, ...]:
    """Strain energy, smallest tension, its s, int f dxi of both sides (n, 2, fields), and one more (n,).

    The last is the power of internal damping; with one field, the rise of the uniform tension.
    """
    s_o, ds, _ = mesh_at.T
    dofs, tab, n_left, *_ = system._mesh
    law = system._law
    n = np.arange(s_o.size)
    n_loc = dofs.shape[1]
    behind = np.arange(len(dofs)) < n_left
    xi, dxi = np.moveaxis(tab[..., :2], -1, 0)
    h = np.where(behind, s_o[:, None], 1.0 - s_o[:, None])[..., None]
    s = np.where(behind, 0.0, s_o[:, None])[..., None] + h * xi
    weight = dxi * h
    padded = np.pad(q, ((0, 0), (0, 1), (0, 0)))  # zeros last for supports
    w = np.einsum("egk,nekf->fneg", tab[..., 2 + n_loc :], padded[:, dofs]) / np.where(h > 0.0, h, 1.0)
    if system.fields == 2:
        T, *slope = system.groups.static(s)[:3]
        X_s = np.array(slope)
        f, _, _, W = section_force(X_s, T, w, law[0], law[3])
        N = T + law[0] * strain(X_s, w)
        more = np.zeros(n.size)
        if system.groups.internal_damping:
            length = np.where(h > 0.0, h, 1.0)
            f_damping, N, power = _damped(system, (q, v), ds[:, None, None], length, X_s + w, N)
            f = f + f_damping
            more = np.sum(weight * power, axis=(1, 2))
        N = np.where(h > 0.0, N, math.inf).reshape(n.size, -1)
        energy = np.sum(weight * W, axis=(1, 2))
        at = np.argmin(N, axis=1)
        min_tension = N[n, at]
        min_at = s.reshape(n.size, -1)[n, at]
    else:
        alpha, tau, curvature, lam, kap, kind = law
        (w,) = w
        y = curvature * (0.5 - s)
        eps = lam * np.sum(weight * (y * w + 0.5 * kap * w * w), axis=(1, 2))
        N, _, W = tension(eps, tau, alpha, kind)
        min_tension = tau + alpha * eps
        min_at = np.full(n.size, 0.5)
        more = N - tau
        energy = 0.5 * tau * np.sum(weight * w * w, axis=(1, 2)) + W - tau * eps
        f = (tau * w + more[:, None, None] * (y + kap * w))[None]
    force = np.stack([np.sum((dxi * f)[:, :, side], axis=(2, 3)).T for side in (behind, ~behind)], axis=1)
    return energy, min_tension, min_at, force, more


def _damped(
    system: CableElements, state: tuple[Array, Array], ds: Array, h: Array, slope: Array, N: Array
) -> tuple[Array, Array, Array]:
    """Force of internal damping, N with it, and its power per s, as in `kernels.balance.add_rates`.

    slope : r' (2, n, n_el, n_q).
    """
    mesh = system._mesh
    rates = system._cable.rates
    q, v = (np.pad(x, ((0, 0), (0, 1), (0, 0)))[:, mesh.dofs] for x in state)
    grad = mesh.tab[..., 2 + mesh.dofs.shape[1] :]
    t = slope / np.hypot(*slope)
    moved = np.einsum("egk,nekf->fneg", grad, v) + ds / h * np.einsum("egk,nekf->fneg", rates.moved, q)
    rate = np.sum(t * moved / h, axis=0)
    lowest = 0.0 if system.law == "tension-only" else -math.inf
    damped = N + system.groups.alpha * rates.tau * rate
    added = np.maximum(damped, lowest) - np.maximum(N, lowest)
    return added * t, damped, added * rate


def _end_forces(system: CableElements, mesh_at: Array, history: tuple[Array, Array, Array], internal: Array) -> Array:
    """f - c^2 w' (n, 4, fields) at the left support, behind and ahead of the mass, and at the right support.

    f = N t - T X'.  Momentum of a side, tested with phi = 1, and with phi = 1 at the mass and 0 at the support:
    int d(h w.)/dt phi dxi + int (c w. + f) phi' ds = [(f + c w.) phi].
    internal : (n, 2, fields) int f dxi of each side.
    """
    q, v, a = history
    s_o, ds, dds = mesh_at.T[..., None]
    out = np.zeros((len(q), 4, system.fields))
    c_d = system.groups.damping
    dds = dds + c_d * ds
    for (of, h, sign), near, end in zip(_sides(system, s_o), (1, 2), (0, 3), strict=False):
        of_q, of_v, of_a = (np.moveaxis(of.T @ x, 1, 0) for x in (q, v, a))
        dh = sign * ds + c_d * h
        total, tested = (h * of_a[k] + dh * of_v[k] - dds * of_q[k + 2] - ds * of_v[k + 2] for k in (0, 1))
        flux = np.divide(ds**2 * of_q[3], h, out=np.zeros_like(tested), where=h > 0.0)
        force = sign * tested + ds * of_v[1] - flux + internal[:, near - 1]
        out[:, near] = force - ds * v[:, system.node]
        out[:, end] = force - sign * total
    entering = s_o[:, 0] == 0.0
    out[entering, :2] = out[entering, 2:3]
    return out


def _tensions(
    system: CableElements, ends: Array, along: tuple[Array, Array, Array], c: tuple[Array, Array],
    at_mass: tuple[Array, ...],
) -> tuple[dict[str, Any], Array]:  # fmt: skip
    """Tensions and reactions of the full cable, and <N t> . [r'] - [W] of the kink.

    along : f - c^2 w' (k, m, 2), w' (k, m, 2), s (m,);  c : at the mass (n,) and along the cable (k, m);
    at_mass : X' (n, 2), T (n,), r' behind and ahead (n, 2).
    """
    g = system.groups
    carried, slopes, s = along
    static, T, behind, ahead = at_mass
    T_s, x_s, y_s = (np.broadcast_to(x, slopes.shape[:2]) for x in g.static(s)[:3])
    static_s = np.stack([x_s, y_s], axis=-1)

    def pointwise(static: Array, T: Array, w_s: Array) -> tuple[Array, Array, Array]:
        """N t, N and W by slopes."""
        alpha, _, _, law = system._law
        f, N, _, W = section_force(np.moveaxis(static, -1, 0), T, np.moveaxis(w_s, -1, 0), alpha, law)
        return np.moveaxis(f, 0, -1) + T[..., None] * static, N, W

    force_behind, N_behind, W_behind = pointwise(static, T, behind - static)
    force_ahead, N_ahead, W_ahead = pointwise(static, T, ahead - static)
    kink = 0.5 * np.sum((force_behind + force_ahead) * (ahead - behind), axis=1) - (W_ahead - W_behind)
    T_ends, x_ends, y_ends = g.static(np.array([0.0, 1.0]))[:3]
    static_left, static_right = np.stack([T_ends * x_ends, T_ends * y_ends], axis=1)
    return {
        "T_behind": _tension_from_momentum(system, ends[:, 1], c[0], (static, T, behind)),
        "T_ahead": _tension_from_momentum(system, ends[:, 2], c[0], (static, T, ahead)),
        "T": _tension_from_momentum(system, carried, c[1], (static_s, T_s, static_s + slopes)),
        "T_behind_pointwise": N_behind,
        "T_ahead_pointwise": N_ahead,
        "T_pointwise": pointwise(static_s, T_s, slopes)[1],
        "reaction_left": -(ends[:, 0] + static_left),
        "reaction_right": ends[:, 3] + static_right,
    }, kink


def _chord_tensions(system: CableElements, ends: Array, rise: Array, T: Array, s: Array, frames: Any) -> dict[str, Any]:
    """The same for one field; its tension rises uniformly."""
    g = system.groups
    tau, curvature = system._law[1:3]
    chord = np.array([g.chord_cos, g.chord_sin])
    along = (tau + rise)[:, None] * chord
    left = along + (ends[:, 0] + 0.5 * tau * curvature) @ system.direction
    right = along + (ends[:, 3] - 0.5 * tau * curvature) @ system.direction
    at_mass = T + rise
    return {
        "T_behind": at_mass, "T_ahead": at_mass, "T": g.static(s)[0] + rise[frames, None],
        "reaction_left": -left, "reaction_right": right,
    }  # fmt: skip


def _tension_from_momentum(system: CableElements, carried: Array, c: Array, at: tuple[Array, Array, Array]) -> Array:
    """N from `carried` = N t - T X' - c^2 w'; at : X', T, r'.

    N t - c^2 r' = (N (1 - c^2/alpha) - c^2 (1 - T/alpha)) t; r' gives the sign.
    """
    static, T, slope = at
    alpha = system._law[0]
    flux = c**2
    force = carried + (T - flux)[..., None] * static  # N t - c^2 r'
    size = np.hypot(force[..., 0], force[..., 1])
    size = np.where(np.sum(force * slope, axis=-1) < 0.0, -size, size)
    N = (size + flux * (1.0 - T / alpha)) / (1.0 - flux / alpha)
    return np.maximum(N, 0.0) if system.law == "tension-only" else N
