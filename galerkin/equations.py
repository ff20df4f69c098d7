"""Equations (17)-(32) of a cable with a travelling mass, over any basis; see README.md."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs, zgetrf, zgetrs

from cablefem.newmark import (
    NO_STEPS,
    Newton,
    Settled,
    Solve,
    State,
    StepFailure,
    System,
    begun,
    consistent_acceleration,
)
from cablefem.newmark.equilibrium import equilibrium
from cablefem.newmark.newton import MOST_HALVINGS
from cablefem.response import Observation, States
from cablefem.scene import Groups
from cablefem.scene.motion import Motion, standing
from galerkin import kernels
from galerkin.bases import Basis
from galerkin.bases.fourier import Fourier
from galerkin.bases.kink import Array, Carried, Moving
from galerkin.bases.riding import RidingSines
from galerkin.equilibrium import Equilibrium, slopes_by
from galerkin.models import FullCable, cable_model
from galerkin.observe import Measures, direction, observe

LOADS = ("mass", "force")


@dataclass(frozen=True, slots=True)
class Instant:
    """Quantities fixed by the travel of the mass."""

    carried: Carried  # of the basis
    load: Array  # X.. - sigma j of (27), (fields,)
    place: Any  # of the cable model


class Drives(NamedTuple):
    """Forces and powers of the drive over a history."""

    contact: Array  # of the mass on the cable, (n, fields)
    haul: Array  # (n,) along the mean tangent; nan where nothing hauls
    power: Array  # (n,) of all but cable, mass and weights
    powers: dict[str, Array]  # its parts


class GalerkinSystem(System):
    """M q.. + C q. + K q + R(q) = F of (19), with the mass of (21)-(23) and (27); see README.md.

    kink : add a hat that travels with the mass
    model : "string" | "sagged" | "stretching" (one field normal to the chord) | "full"
    load : "mass", or "force" = the weight mu sigma alone
    law : "elastic", or "tension-only" for the full model

    Unknowns: all of U, then all of V, the hat last in each; in path form then the displacement w_p of the mass.
    """

    strides = True
    measures: type[Measures] = Measures
    by_force = False  # whether r' at the mass is shown by the tension from equilibrium

    def __init__(
        self, groups: Groups, basis: Basis | RidingSines, *, kink: bool = False, model: str = "full",
        load: str = "mass", law: str = "elastic",
    ) -> None:  # fmt: skip
        if load not in LOADS:
            raise ValueError(f"unknown load {load!r}; one of {', '.join(LOADS)}")
        self.groups, self.mu, self.kink, self.damping = groups, groups.mu, kink, groups.damping
        self.model, self.load, self.law = model, load, law
        self.basis: Moving = self._moving(basis)
        self.cable = cable_model(groups, model, law)
        self.inertia = self.mu if load == "mass" else 0.0
        self.path_form = self.at_support = load == "mass" and not basis.smooth
        self.fields, self.n = self.cable.fields, self.basis.n
        self.n_modal = self.fields * self.n
        self.n_dof = self.n_modal + (self.fields if self.path_form else 0)
        self.phases = self._phases()
        self.force_scale = (self.mu or 1.0) * groups.sigma
        # rounding of N, summed over points
        self.force_floor = float(np.finfo(float).eps) * groups.alpha
        # of the last residual, and its s; see `kernels.least`
        self.least_tension = np.inf, 0.0
        self._instants: dict[tuple[float, int], Instant] = {}

    def _moving(self, basis: Any) -> Any:
        return Moving(basis, self.kink)

    @property
    def motion(self) -> Motion:
        if self.groups.motion is None:
            raise ValueError("the scene has no travelling mass; `bare_frequencies` is all a bare cable has")
        return self.groups.motion

    def _phases(self) -> tuple[tuple[float, float], ...]:
        return self.motion.phases

    def with_law(self, law: str) -> GalerkinSystem:
        other = copy.copy(self)
        other.law, other.cable = law, cable_model(self.groups, self.model, law)
        other._instants = {}
        return other

    def place(self, x: State) -> float:
        return self.motion.at(x.t, x.phase)[0]

    def between(self, t0: Array, t1: Array, w: float, phase: int) -> Array:
        travel = self.groups.motion
        return super().between(t0, t1, w, phase) if travel is None else travel.between(t0, t1, w, phase)

    def kinematics(self, states: States) -> Array:
        """s_o, ds_o, dds_o of a history, (3, n)."""
        return self.motion.along(states.t, states.phase)

    def drives(self, states: States, velocity: Array, acceleration: Array, sides: Array, working: Array) -> Drives:
        """Forces and powers from p., p.. (n, fields) and r' of both sides (2, n, fields).

        working : (n,) <N t> . [r'] - [W]; its power is ds_o (F . <r'> + working).
        """
        contact = self.mu * self.cable.weight - self.inertia * acceleration
        power = self.kinematics(states)[1] * (working - np.sum(contact * sides.mean(axis=0), axis=1))
        return Drives(contact, np.full(power.shape, np.nan), power, {})

    def sides(self, pointwise: Array, forces: Equilibrium, s_o: Array) -> Array:
        """r' behind and ahead of the mass, (2, n, 2)."""
        T = self.groups.static(s_o)[0]
        both = np.array([forces.behind, forces.ahead])
        return slopes_by(both, pointwise, T, self.groups.alpha) if self.by_force else pointwise

    def in_time(self, states: States) -> States:
        return states

    def instant(self, t: float, phase: int) -> Instant:
        key = (t, phase)
        found = self._instants.get(key)
        if found is None:
            if len(self._instants) >= 8:  # an energy step visits five
                del self._instants[next(iter(self._instants))]
            found = self._instants[key] = self._instant(*self.motion.at(t, phase))
        return found

    def _instant(self, s_o: float, ds_o: float, dds_o: float) -> Instant:
        carried = self.basis.carried(s_o, ds_o, dds_o, self.damping)
        return Instant(carried, self._load(s_o, ds_o, dds_o), self.cable.at(self.basis, s_o))

    def _load(self, s_o: float, ds_o: float, dds_o: float) -> Array:
        if self.load == "force":
            return -self.cable.weight
        slope, curvature = self.cable.static_slope(s_o)
        return dds_o * slope + ds_o**2 * curvature - self.cable.weight

    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        x = self.instant(t, phase)
        force, pull = self.cable.force(x.place, self._fields(q))
        self.least_tension = self.cable.least(self.basis, x.place, pull)
        return self._residual(x, q, v, a, force)

    def linearise(self, t: float, q: Array, v: Array, a: Array, phase: int, *c: complex) -> tuple[Array, Solve]:
        x = self.instant(t, phase)
        force, pull, K = self.cable.linearise(x.place, self._fields(q))
        self.least_tension = self.cable.least(self.basis, x.place, pull)
        return self._residual(x, q, v, a, force), factorised(self._tangent(x, K, *c))

    def _fields(self, y: Array) -> Array:
        return y[: self.n_modal].reshape(self.fields, self.n)

    def _residual(self, x: Instant, q: Array, v: Array, a: Array, force: Array) -> Array:
        """r of (19)."""
        Q, V, A, c = self._fields(q), self._fields(v), self._fields(a), x.carried
        along = a[self.n_modal :] if self.path_form else A @ c.f + V @ c.f_v + Q @ c.f_q
        load = self.inertia * along + self.mu * x.load
        r = force + (A + self.damping * V) @ c.mass + np.multiply.outer(load, c.f) + c.moving(V, Q)
        return np.append(r.ravel(), q[self.n_modal :] - Q @ c.f) if self.path_form else r.ravel()

    def tangent(self, t: float, q: Array, phase: int, c0: complex, c1: complex, c2: complex) -> Array:
        x = self.instant(t, phase)
        return self._tangent(x, self.cable.linearise(x.place, self._fields(q))[2], c0, c1, c2)

    def _tangent(self, x: Instant, K: Array, c0: complex, c1: complex, c2: complex) -> Array:
        c = x.carried
        inertia = np.multiply(
            c2 + c1 * self.damping, c.mass, dtype=np.result_type(c0, c1, c2, c.mass)
        )  # a stage may be complex
        inertia[:, -len(c.gyroscopic) :] += (c1 * c.gyroscopic + c0 * c.centrifugal).T
        if not self.path_form:
            inertia += self.inertia * np.multiply.outer(c.f, c2 * c.f + c1 * c.f_v + c0 * c.f_q)
        K = c0 * K
        for i in range(0, self.n_modal, self.n):
            K[i : i + self.n, i : i + self.n] += inertia
        if not self.path_form:
            return K
        to_mass = np.kron(np.eye(self.fields), c.f)
        return np.block([[K, (c2 * self.mu) * to_mass.T], [-c0 * to_mass, c0 * np.eye(self.fields)]])

    @property
    def waves(self) -> bool:
        """Whether this is the full cable over sines, which `lines` needs."""
        return isinstance(self.cable, FullCable) and isinstance(self.basis.basis, Fourier)

    def lines(self, s_o: Array) -> Iterator[tuple[slice, kernels.Line]]:
        """Runs of consecutive places s_o (m,) with the same rules, and their `Line`."""
        for same, behind, ahead in self.sines.alike(s_o):
            yield same, self._line(behind, ahead)

    def _line(self, behind: Array, ahead: Array) -> kernels.Line:
        assert isinstance(self.cable, FullCable)
        kink = self.basis if self.kink else Moving(self.sines, kink=True)
        return self.cable.line(kink, behind, ahead, self.inertia)

    @property
    def sines(self) -> Fourier:
        assert isinstance(self.basis.basis, Fourier)
        return self.basis.basis

    def settle(
        self, t: float, phase: int, start: Array, now: Array, rule: Array, bound: float, newton: Newton
    ) -> Settled:
        if not (self.waves and self.kink):
            return super().settle(t, phase, start, now, rule, bound, newton)
        _, ends, told = self._step(np.array([t]), phase, start, rule[None], limits(bound, newton))
        now[:] = ends[0]
        return Settled(*told[0].tolist()[:4])

    def stride(
        self, t: Array, phase: int, start: Array, rules: Array, bound: float, newton: Newton
    ) -> tuple[Array, Array]:
        """Steps end where the quadrature rules change or the cable falls slack."""
        if not (self.waves and self.kink):
            return NO_STEPS
        taken, ends, told = self._stride(t, phase, start, rules, limits(bound, newton))
        return ends[:taken], told[:taken]

    def _step(
        self, t: Array, phase: int, start: Array, rules: Array, bounds: tuple[float, ...]
    ) -> tuple[int, Array, Array]:
        places = self.motion.along(t, phase).T
        same, line = next(self.lines(places[:, 0]))
        return self._told(
            *kernels.stride(None, None, line, np.ascontiguousarray(places[same]), start, rules[same], bounds)
        )

    _stride = _step

    def _told(self, taken: int, ends: Array, told: Array) -> tuple[int, Array, Array]:
        """Note the least tension of the last step."""
        lowest, where = told[max(taken - 1, 0), 4:].tolist()
        self.least_tension = lowest, where
        return taken, ends, told

    def start(self, phase: int, state: State | None) -> State:
        """At entry the limit t -> 0+; later q and v are continuous, a jumps with dds_o."""
        if state is None:
            s_o, ds_o, _ = self.motion.at(0.0, 0)
            if s_o > 0.0:
                return begun(self, lambda at: equilibrium(self.standing(at)), s_o, ds_o)
            return self._entry()
        t = self.phases[phase][0]
        if not self.path_form:
            return consistent_acceleration(self, t, state.q, state.v, phase)
        # jumps of the constraint and of the balance
        before, x = self.instant(t, state.phase), self.instant(t, phase)
        Q = state.q[: self.n_modal].reshape(self.fields, self.n)
        after, earlier = x.carried, before.carried
        kick = Q @ (after.f_q - earlier.f_q)
        balance = np.multiply.outer(self.mu * (kick + x.load - before.load), after.f)
        if self.kink:
            balance += Q[:, -1:] @ (after.centrifugal - earlier.centrifugal)
        jump = -np.linalg.solve(after.mass + self.mu * np.multiply.outer(after.f, after.f), balance.T).T
        return State(t, state.q, state.v, state.a + np.concatenate([jump.ravel(), jump @ after.f + kick]), phase)

    def standing(self, s_o: float) -> GalerkinSystem:
        """The system with the mass held at s_o."""
        other = self.with_law(self.law)
        other.groups = replace(self.groups, motion=standing(s_o, 1.0))
        return other

    def _entry(self) -> State:
        """The limit t -> 0+; see README.md, "Start".

        With m, b of `_entrained` the row of the hat is
            (mu + m) a_hat + (c_d m - ds_o b) ds_o d + [N t - T t_static](d) + mu (X.. - sigma j) = 0.
        """
        t = self.phases[0][0]
        s_o, ds_o, dds_o = self.motion.at(t, 0)
        q, v, a = np.zeros((3, self.n_dof))
        if not self.kink:
            return State(t, q, v, a, 0)
        shape, drag, m, b = self._entrained()
        m, load = self.inertia + m, self.mu * self._load(s_o, ds_o, dds_o)
        if self.inertia and ds_o > 0.0:
            pulled, X = m * np.eye(self.fields), self.cable.static_slope(0.0)[0]
            if self.groups.internal_damping:  # N_v t (t . d.) pulls, d. = a_hat/(2 ds_o)
                pulled += self.cable.alpha * self.groups.internal_damping / (2.0 * ds_o) * np.multiply.outer(X, X)
            v_hat, a_hat = np.zeros(self.fields), -np.linalg.solve(pulled, load)
        else:
            d = self._slope_behind(m * dds_o + (self.damping * (m - self.inertia) - ds_o * b) * ds_o, load)
            v_hat, a_hat = d * ds_o, d * dds_o
        v[: self.n_modal] = np.multiply.outer(v_hat, shape).ravel()
        a[: self.n_modal] = (np.multiply.outer(a_hat, shape) - np.multiply.outer(2.0 * ds_o * v_hat, drag)).ravel()
        if self.path_form:
            a[self.n_modal :] = a_hat
        return State(t, q, v, a, 0)

    def _entrained(self) -> tuple[Array, Array, float, float]:
        """The cable that moves with the mass at the left support: a = a_hat shape - 2 ds_o v_hat drag, m and b.

        Rows of phi in the limit: M0 v_phi + I v_hat = 0,  M0 a_phi + I a_hat + 2 I' ds_o v_hat = 0.
        """
        value, first, _ = (y[0] for y in self.basis.overlap(np.array([0.0])))
        rest, drag = np.linalg.solve(self.basis.basis.mass(), np.stack([value, first], axis=1)).T
        return np.append(-rest, 1.0), np.append(drag, 0.0), 1.0 / 3.0 - value @ rest, 1.0 / 3.0 + 2.0 * value @ drag

    def _slope_behind(self, m: float, load: Array) -> Array:
        """Solve m d + [N t - T t_static](X' + d) + load = 0 at the left support.

        Newton steps are not halved: that is slow for a stiff cable.
        """
        d = np.zeros(self.fields)
        for _ in range(50):
            force, stiffness = self.cable.stress(np.asarray(0.0), d)
            step = np.linalg.solve(m * np.eye(self.fields) + stiffness, m * d + force + load)
            d = d - step
            if np.abs(step).max() <= 1e-13 * (1.0 + np.abs(d).max()):
                return d
        raise StepFailure(0.0, "no equilibrium of the start from rest was found", "let the mass start more gently")

    def path(self, states: States) -> tuple[Array, Array]:
        x = self.measures(self, states)
        return x.s_o, x.displaced() @ direction(self)

    def observe(self, states: States, s: Array, frames: Array) -> Observation:
        return observe(self, states, s, frames)


def limits(bound: float, newton: Newton) -> tuple[float, ...]:
    return bound, float(newton.max_iter), newton.reuse, float(newton.patience), float(MOST_HALVINGS)


def factorised(K: Array) -> Solve:
    """r -> K^-1 r by LAPACK's LU of K^T, in Fortran's order."""
    getrf, getrs = (zgetrf, zgetrs) if np.iscomplexobj(K) else (dgetrf, dgetrs)
    lu, pivots, info = getrf(K.T, overwrite_a=True)
    if info:
        return lambda r: np.full_like(r, np.nan)  # singular
    return lambda r: getrs(lu, pivots, r, trans=1)[0]
