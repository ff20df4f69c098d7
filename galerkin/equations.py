"""Equations (17)-(32) of a cable with a travelling mass, over any basis; see README.md."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple, Self

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs, zgetrf, zgetrs

from cablefem import newmark
from cablefem.newmark import Newton, Solve, State, States, StepFailure, System, TangentFactors
from cablefem.newmark.equilibrium import solve_equilibrium
from cablefem.newmark.newton import solve_newton_dense
from cablefem.response import Observation
from cablefem.scene import Groups
from cablefem.scene.motion import rest_motion
from galerkin import kernels
from galerkin.bases import Basis
from galerkin.bases.fourier import Fourier
from galerkin.bases.kink import Array, InertiaTerms, KinkedBasis
from galerkin.models import cable_model
from galerkin.observe import Measures, observe

LOADS = ("mass", "force")


class Instant(NamedTuple):
    """Quantities fixed by the travel of the mass."""

    inertia_terms: InertiaTerms  # of the basis
    load: Array  # X.. - sigma j of (27), (fields,)
    tables: Any  # of the cable model


class EntrainedCable(NamedTuple):
    """The cable that moves with the mass at the left support: a = a_hat shape - 2 ds_o v_hat drag."""

    shape: Array  # (n,)
    drag: Array  # (n,)
    m: float  # inertia m and b of `_state_at_entry`
    b: float


class GalerkinSystem(System):
    """M q.. + C q. + K q + R(q) = F of (19), with the mass of (21)-(23) and (27).

    kink : add a hat that travels with the mass
    model : "string" | "sagged" | "stretching" (one field normal to the chord) | "full"
    load : "mass", or "force" = the weight mu sigma alone
    law : "elastic", or "tension-only" for the full model

    Unknowns: all of U, then all of V, the hat last in each; in path form then the displacement w_p of the mass.
    """

    many_steps = True
    by_force = False  # whether r' at the mass is shown by the tension from equilibrium

    def __init__(
        self, groups: Groups, basis: Basis, *, kink: bool = False, model: str = "full",
        load: str = "mass", law: str = "elastic",
    ) -> None:  # fmt: skip
        if load not in LOADS:
            raise ValueError(f"unknown load {load!r}; one of {', '.join(LOADS)}")
        self.groups = groups
        self.mu = groups.mu
        self.kink = kink
        self.damping = groups.damping
        self.model = model
        self.load = load
        self.law = law
        self.basis: Any = KinkedBasis(basis, kink)
        self.cable: Any = cable_model(groups, model, law)
        self.motion: Any = groups.motion  # None for a free car
        self.inertia = self.mu if load == "mass" else 0.0
        self.path_form = self.at_support = load == "mass" and not basis.has_second_derivative
        self.fields = self.cable.fields
        self.n = self.basis.n
        self.has_compiled_steps = self.fields == 2 and isinstance(basis, Fourier)  # see `kernels`
        self.n_modal = self.fields * self.n
        self.n_dof = self.n_modal + self.fields * self.path_form
        self.phases = groups.drive.phases if self.motion is None else self.motion.phases
        self.force_scale = (self.mu or 1.0) * groups.sigma
        # rounding of N, summed over points
        self.force_floor = float(np.finfo(float).eps) * groups.alpha
        # of the last residual, and its s; see `kernels.smoothed_min_tension_and_position`
        self.min_tension_and_position = np.inf, 0.0
        self._reset_instant_cache()

    def _reset_instant_cache(self) -> None:
        """Make the cache of instants; a collocation step visits three."""

        def instant(t: float, phase: int) -> Instant:
            return self._instant_at(*self.motion.position_with_rates(t, phase))

        self.instant = lru_cache(maxsize=8)(instant)

    def with_law(self, law: str) -> Self:
        other = copy.copy(self)
        other.law = law
        other.cable = cable_model(self.groups, self.model, law)
        other._reset_instant_cache()
        return other

    def position(self, x: State) -> float:
        return self.motion.position_with_rates(x.t, x.phase)[0]

    def balance_times(self, t0: Array, t1: Array, end_weight: float, phase: int) -> Array:
        if self.motion is None:
            return super().balance_times(t0, t1, end_weight, phase)
        return self.motion.times_of_mean_positions(t0, t1, end_weight, phase)

    def mass_kinematics(self, states: States) -> Array:
        """s_o, ds_o, dds_o of a history, (3, n)."""
        return self.motion.positions_with_rates(states.t, states.phase)

    def _instant_at(self, s_o: float, ds_o: float, dds_o: float) -> Instant:
        inertia_terms = self.basis.inertia_terms(s_o, ds_o, dds_o, self.damping)
        tables = self.cable.tables_at(self.basis, s_o)
        return Instant(inertia_terms, self._inertia_and_weight_per_mass(s_o, ds_o, dds_o), tables)

    def _inertia_and_weight_per_mass(self, s_o: float, ds_o: float, dds_o: float) -> Array:
        """X.. - sigma j of (27), (fields,); of a force -sigma j."""
        if self.load == "force":
            return -self.cable.weight
        slope, curvature = self.cable.static_slope_and_curvature(s_o)
        return dds_o * slope + ds_o**2 * curvature - self.cable.weight

    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        x = self.instant(t, phase)
        force, tensions = self.cable.internal_force_and_tensions(x.tables, self._coefficients_by_field(q))
        self.min_tension_and_position = self.cable.min_tension_and_position(self.basis, x.tables, tensions)
        return self._residual_at_instant(x, q, v, a, force)

    def linearise(self, t: float, q: Array, v: Array, a: Array, phase: int, c: TangentFactors) -> tuple[Array, Solve]:
        x = self.instant(t, phase)
        force, tensions, stiffness = self.cable.force_tensions_and_tangent(x.tables, self._coefficients_by_field(q))
        self.min_tension_and_position = self.cable.min_tension_and_position(self.basis, x.tables, tensions)
        r = self._residual_at_instant(x, q, v, a, force)
        K = self._tangent_at_instant(x, stiffness, c)
        return r, overwriting_lu_solver_or_nan(K)

    def _coefficients_by_field(self, y: Array) -> Array:
        """The coefficients (fields, n) of unknowns or rates."""
        return y[: self.n_modal].reshape(self.fields, self.n)

    def _residual_at_instant(self, x: Instant, q: Array, v: Array, a: Array, internal_force: Array) -> Array:
        Q = self._coefficients_by_field(q)
        V = self._coefficients_by_field(v)
        A = self._coefficients_by_field(a)
        c = x.inertia_terms
        w_tt = a[self.n_modal :] if self.path_form else A @ c.f + V @ c.f_v + Q @ c.f_q  # of the mass
        load = self.inertia * w_tt + self.mu * x.load
        of_cable = internal_force + (A + self.damping * V) @ c.mass
        r = of_cable + np.multiply.outer(load, c.f) + c.convective_terms(V, Q)
        if not self.path_form:
            return r.ravel()
        return np.append(r.ravel(), q[self.n_modal :] - Q @ c.f)

    def tangent(self, t: float, q: Array, phase: int, c: TangentFactors) -> Array:
        x = self.instant(t, phase)
        stiffness = self.cable.force_tensions_and_tangent(x.tables, self._coefficients_by_field(q))[2]
        return self._tangent_at_instant(x, stiffness, c)

    def _tangent_at_instant(self, x: Instant, stiffness: Array, factors: TangentFactors) -> Array:
        c0, c1, c2 = factors
        c = x.inertia_terms
        dtype = np.result_type(c0, c1, c2, c.mass)  # a stage may be complex
        inertia = np.multiply(c2 + c1 * self.damping, c.mass, dtype=dtype)
        inertia[:, -1] += c1 * c.gyroscopic + c0 * c.centrifugal
        if not self.path_form:
            inertia += self.inertia * np.multiply.outer(c.f, c2 * c.f + c1 * c.f_v + c0 * c.f_q)
        K = c0 * stiffness
        for i in range(0, self.n_modal, self.n):
            K[i : i + self.n, i : i + self.n] += inertia
        if not self.path_form:
            return K
        identity = np.eye(self.fields)
        to_mass = np.kron(identity, c.f)
        return np.block([[K, (c2 * self.mu) * to_mass.T], [-c0 * to_mass, c0 * identity]])

    def runs_with_equal_quadrature(self, s_o: Array) -> Iterator[tuple[slice, kernels.CableSines]]:
        """Runs of consecutive positions s_o (m,) with the same quadrature rules, and their `CableSines`."""
        for same, behind, ahead in self.sines.runs_of_equal_gauss_rules(s_o):
            yield same, self._cable_sines(behind, ahead)

    def _cable_sines(self, rule_behind: Array, rule_ahead: Array) -> kernels.CableSines:
        kink = self.basis if self.kink else KinkedBasis(self.sines, kink=True)
        tables = kink.mass_at_rest, kink.left, kink.chord
        g = self.groups
        law = self.cable.law
        cable = kernels.Cable(self.inertia, self.mu, g.alpha, law, g.sigma, g.c, self.damping, self.slack_ends)
        return kernels.CableSines(cable, rule_behind, rule_ahead, *tables, self.sines.grading)

    @property
    def sines(self) -> Fourier:
        return self.basis.basis

    def solve_step(
        self, t: float, phase: int, start: Array, end_out: Array, rule: Array, newton: Newton
    ) -> newmark.StepResult:
        if not (self.has_compiled_steps and self.kink):
            return super().solve_step(t, phase, start, end_out, rule, newton)
        taken = self._take_steps_without_events(np.array([t]), phase, start, rule[None], newton)
        end_out[:] = taken.ends[0]
        self._store_min_tension(taken.outcomes[0])
        return newmark.StepResult(*taken.outcomes[0, :4].tolist())

    def solve_steps(self, t: Array, phase: int, start: Array, rules: Array, newton: Newton) -> newmark.ManySteps:
        """Steps end where the quadrature rules change or the cable falls slack."""
        if not (self.has_compiled_steps and self.kink):
            return newmark.NO_STEPS
        good, ends, outcomes = self._take_steps_until_event(t, phase, start, rules, newton)
        if good:
            self._store_min_tension(outcomes[good - 1])
        return newmark.ManySteps(ends[:good], outcomes[:good])

    def _take_steps_without_events(
        self, t: Array, phase: int, start: Array, rules: Array, newton: Newton
    ) -> kernels.StepsTaken:
        kinematics = self.motion.positions_with_rates(t, phase).T
        same, sines = next(self.runs_with_equal_quadrature(kinematics[:, 0]))
        kinematics = np.ascontiguousarray(kinematics[same])
        return kernels.solve_steps(None, None, sines, kinematics, start, rules[same], newton)

    _take_steps_until_event = _take_steps_without_events

    def _store_min_tension(self, outcome: Array) -> None:
        """Store that of a step, from its outcome (6,)."""
        min_tension, s = outcome[4:].tolist()
        self.min_tension_and_position = min_tension, s

    def start(self, phase: int, state: State | None) -> State:
        """At entry the limit t -> 0+; later q and v are continuous, a jumps with dds_o."""
        if state is None:
            s_o, ds_o, _ = self.motion.position_with_rates(0.0, 0)
            if s_o == 0.0:
                return self._state_at_entry()
            return newmark.quasi_static_start(self, self._unknowns_at_rest, s_o, ds_o)
        t = self.phases[phase][0]
        if not self.path_form:
            return newmark.consistent_acceleration(self, t, state.q, state.v, phase)
        # jumps of the constraint and of the balance
        before = self.instant(t, state.phase)
        x = self.instant(t, phase)
        Q = self._coefficients_by_field(state.q)
        terms = x.inertia_terms
        terms_before = before.inertia_terms
        kick = Q @ (terms.f_q - terms_before.f_q)
        balance = np.multiply.outer(self.mu * (kick + x.load - before.load), terms.f)
        if self.kink:
            balance += np.multiply.outer(Q[:, -1], terms.centrifugal - terms_before.centrifugal)
        mass = terms.mass + self.mu * np.multiply.outer(terms.f, terms.f)
        jump = -np.linalg.solve(mass, balance.T).T
        jump_at_mass = jump @ terms.f + kick
        a = state.a + np.concatenate([jump.ravel(), jump_at_mass])
        return State(t, state.q, state.v, a, phase)

    def tension_only_at_rest_with_clamped_car(self, s_o: float) -> GalerkinSystem:
        """The cable at rest with its mass at s_o, by the tension-only law if the model has it."""
        other = self.with_law("tension-only" if self.model == "full" else self.law)
        other.motion = rest_motion(s_o, 1.0)
        return other

    def _unknowns_at_rest(self, s_o: float) -> Array:
        return solve_equilibrium(self.tension_only_at_rest_with_clamped_car(s_o))

    def _state_at_entry(self) -> State:
        """The limit t -> 0+; see README.md, "Start".

        With m, b of `EntrainedCable` the row of the hat is
            (mu + m) a_hat + (c_d m - ds_o b) ds_o d + [N t - T t_static](d) + mu (X.. - sigma j) = 0.
        """
        t = self.phases[0][0]
        s_o, ds_o, dds_o = self.motion.position_with_rates(t, 0)
        q, v, a = np.zeros((3, self.n_dof))
        if not self.kink:
            return State(t, q, v, a, 0)
        entrained = self._entrained_cable()
        m = self.inertia + entrained.m
        load = self.mu * self._inertia_and_weight_per_mass(s_o, ds_o, dds_o)
        if self.inertia and ds_o > 0.0:
            v_hat = np.zeros(self.fields)
            a_hat = -load / m
        else:
            of_slope = m * dds_o + (self.damping * (m - self.inertia) - ds_o * entrained.b) * ds_o
            d = self._slope_behind_at_entry(of_slope, load)
            v_hat = d * ds_o
            a_hat = d * dds_o
        V = np.multiply.outer(v_hat, entrained.shape)  # (fields, n)
        A = np.multiply.outer(a_hat, entrained.shape)
        A -= np.multiply.outer(2.0 * ds_o * v_hat, entrained.drag)
        v[: self.n_modal] = V.ravel()
        a[: self.n_modal] = A.ravel()
        if self.path_form:
            a[self.n_modal :] = a_hat
        return State(t, q, v, a, 0)

    def _entrained_cable(self) -> EntrainedCable:
        """By the rows of phi in the limit: M0 v_phi + I v_hat = 0,  M0 a_phi + I a_hat + 2 I' ds_o v_hat = 0."""
        overlap, derivative, _ = self.basis.hat_overlaps_and_derivatives(np.array([0.0]))[:, 0]
        M = self.basis.basis.mass_matrix()
        rest, drag = np.linalg.solve(M, np.stack([overlap, derivative], axis=1)).T
        m = 1.0 / 3.0 - overlap @ rest
        b = 1.0 / 3.0 + 2.0 * overlap @ drag
        return EntrainedCable(np.append(-rest, 1.0), np.append(drag, 0.0), m, b)

    def _slope_behind_at_entry(self, m: float, load: Array) -> Array:
        """d of m d + [N t - T t_static](X' + d) + load = 0 at the left support."""

        def linearise(d: Array) -> tuple[Array, Array]:
            force, stiffness = self.cable.force_and_tangent_at_point(np.asarray(0.0), d)
            r = m * d + force + load
            return r, m * np.eye(self.fields) + stiffness

        d = solve_newton_dense(linearise, np.zeros(self.fields))
        if d is None:
            raise StepFailure(0.0, "no equilibrium of the start from rest was found", "let the mass start more gently")
        return d

    def mass_positions_and_displacements(self, states: States) -> tuple[Array, Array]:
        """s_o (n,) and the displacement u, v of the mass (n, 2)."""
        x = Measures(self, states)
        return x.s_o, x.displacement_at_mass() @ self.cable.direction

    def observe(self, states: States, s: Array, frames: Array) -> Observation:
        return observe(self, states, s, frames)


def overwriting_lu_solver_or_nan(K: Array) -> Solve:
    """r -> K^-1 r by LAPACK's LU of K^T, in Fortran's order; NaN where K is singular."""
    getrf, getrs = (zgetrf, zgetrs) if np.iscomplexobj(K) else (dgetrf, dgetrs)
    lu, pivots, info = getrf(K.T, overwrite_a=True)
    if info:
        return lambda r: np.full_like(r, np.nan)
    return lambda r: getrs(lu, pivots, r, trans=1)[0]
