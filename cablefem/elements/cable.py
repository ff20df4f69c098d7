"""Cable elements on any mesh; dimensionless: l = H = rho = 1."""

import math
import sys
from collections.abc import Iterator, Sequence
from copy import copy
from functools import partial
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from cablefem import newmark
from cablefem.elements import observing
from cablefem.elements.kernels import collocation
from cablefem.elements.kernels.balance import Cable, Contact, Instant, Mesh, assemble, assemble_inertia_and_damping
from cablefem.elements.kernels.banded import Tangent, factorise_in_place, solve
from cablefem.elements.kernels.law import ELASTIC, TENSION_ONLY
from cablefem.elements.kernels.newton import NO_TANGENT, Steps, solve_steps
from cablefem.elements.observing import StationFields
from cablefem.elements.reference import Points
from cablefem.newmark import Array, Newton, Solve, State, StepResult, System, Tableau
from cablefem.response import Observation, States
from cablefem.scene import Groups

MODELS = ("full", "string", "sagged", "stretching")

# lam, kap: tension raised by the sag, by the slope squared
STRETCHING = {"straight": (0.0, 0.0), "string": (0.0, 0.0), "sagged": (1.0, 0.0), "stretching": (1.0, 1.0)}

Factors = tuple[float, float, float]  # of dr/dq, dr/dv, dr/da
UNITS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def _times_linear(polynomials: Array, line: Array) -> Array:
    """Polynomials (powers, ...) times linear functions (2, ...)."""
    out = np.zeros((len(polynomials) + 1, *np.broadcast_shapes(polynomials.shape[1:], line.shape[1:])))
    out[:-1] = polynomials * line[0]
    out[1:] += polynomials * line[1]
    return out


class CableElements(System):
    """A cable with its moving mass; a subclass sets the attributes, `start`, `_inputs`,
    `_contact_at` and `_motion_at_mass`.

    model : "full" for (u, v), or one field normal to the chord: "string", "sagged", "stretching".
    load : "mass", or "force" for its weight.
    law : "elastic", or "tension-only": N = max(0, T + alpha eps).
    """

    drives: tuple[str, ...] = ("grip",)
    n_scalar: int  # unknowns per field
    _band: int
    _operators: Array  # see `kernels.balance.Cable`
    _mesh: Mesh
    _at_inertia: Points  # that integrate products of two shapes
    _at_force: Points  # of `_mesh`
    _knots: Array  # 0 at the mass or the end of a fixed mesh
    _shapes: Array  # `reference.shape_polynomials`
    _moments: Array  # `reference.shape_moments` of each side of the mass
    _assembled_at: tuple[float, int] | None
    node: int  # scalar unknown at the mass

    def __init__(self, groups: Groups, model: str = "full", load: str = "mass", law: str = "elastic") -> None:
        if groups.drive.mode not in self.drives:
            raise ValueError(
                f"a car that rolls (drive {groups.drive.mode}) needs mass-following elements of the full model"
            )
        if model not in (*MODELS, "straight"):
            raise ValueError(f"model must be one of {', '.join(MODELS)}, got {model!r}")
        if load not in ("mass", "force"):
            raise ValueError(f"load must be mass or force, got {load!r}")
        self.groups = groups
        self.model = model
        self.load = load
        self.motion: Any = groups.motion  # None for a free car
        self.phases = groups.drive.phases if self.motion is None else self.motion.phases
        self.force_scale = (groups.mu or 1.0) * groups.sigma  # weight of the mass or of the bare cable
        self.force_floor = 16.0 * sys.float_info.epsilon * max(1.0, groups.alpha)  # rounding
        self.fields = 2 if model == "full" else 1
        self.inertia = groups.mu if load == "mass" else 0.0
        # displacement of each field
        self.direction = np.eye(2) if model == "full" else np.array([[-groups.chord_sin, groups.chord_cos]])
        self.min_tension_and_position = (math.inf, 0.0)
        self.weight = groups.mu * groups.sigma * self.direction[:, 1]
        self._set_law(law)

    def with_law(self, law: str) -> Self:
        """A copy with another cable law and the same tables."""
        other = copy(self)
        other._set_law(law)
        other._make_workspaces()
        return other

    def position(self, x: State) -> float:
        return self.motion.position_with_rates(x.t, x.phase)[0]

    def balance_times(self, t0: Array, t1: Array, w: float, phase: int) -> Array:
        if self.motion is None:
            return super().balance_times(t0, t1, w, phase)
        return self.motion.balance_times(t0, t1, w, phase)

    def states_over_time(self, states: States) -> States:
        return states

    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        r = np.empty(self.n_dof)
        self._assemble(t, phase, np.array([q, v, a]), r, NO_TANGENT)
        return r

    def linearise(
        self, t: float, q: Array, v: Array, a: Array, phase: int, c0: complex, c1: complex, c2: complex
    ) -> tuple[Array, Solve]:
        """Residual (n_dof,), and a solver of c0 dr/dq + c1 dr/dv + c2 dr/da, banded with a border."""
        r = np.empty(self.n_dof)
        x = np.array([q, v, a])
        tangent = self._tangent
        if isinstance(c0, complex):  # a sum of real ones
            tangent = self._zero_tangent(complex)
            for factor, unit in zip((c0, c1, c2), UNITS, strict=True):
                self._assemble(t, phase, x, r, unit)
                for to, of in zip(tangent, self._tangent, strict=True):
                    if to is not None:
                        to += factor * of
        else:
            self._assemble(t, phase, x, r, (float(c0), float(c1.real), float(c2.real)))
        factorise_in_place(*tangent)
        return r, partial(solve, *tangent)

    def solve_step(self, t: float, phase: int, start: Array, end: Array, rule: Array, newton: Newton) -> StepResult:
        ends, results, _ = self._newmark_steps(np.array([t]), phase, start, rule[None], newton)
        end[:] = ends[0]
        return next(self._step_results(results))

    def collocate_steps(self, phase: int, steps: newmark.Steps, rule: Tableau, newton: Newton) -> Iterator[StepResult]:
        if not self.many_steps:
            steps = steps.first_steps(1)
        return self._step_results(self._collocation_results(phase, steps, rule, newton))

    def _newmark_steps(
        self, t: Array, phase: int, start: Array, rules: Array, newton: Newton
    ) -> tuple[Array, Array, int]:
        """Ends (m, 3, n_dof) and `results` (m, 6) of `kernels.newton.Steps`, and how many are good."""
        ride, inputs = self._car_and_inputs(t, phase, start)
        ends = np.empty((t.size, *start.shape))
        results = np.empty((t.size, 6))
        steps = Steps(inputs, self._contact_at(t.item(0), phase), start, rules, ends, results, self.slack_ends)
        self._assembled_at = None
        return ends, results, solve_steps(self._cable, ride, self._tangent, self._bands, steps, newton)

    def _collocation_results(self, phase: int, steps: newmark.Steps, rule: Tableau, newton: Newton) -> Array:
        """`results` of the steps taken."""
        t = rule.node_times(steps.t)
        results = np.empty((len(steps.a), 6))
        ride, inputs = self._car_and_inputs(t, phase, steps.ends[0])
        at_nodes = [self._contact_at(x, phase) for x in t[0].tolist()]
        contact = Contact(*(np.array(of_nodes) for of_nodes in zip(*at_nodes, strict=True)))
        of = collocation.Steps(inputs, contact, *steps, results, self.slack_ends)
        self._assembled_at = None
        space = self._workspace(rule.c.size)
        taken = collocation.collocate_until_event(self._cable, ride, space, of, rule, newton)
        return results[: max(1, taken)]

    def _car_and_inputs(self, t: Array, phase: int, start: Array) -> tuple[Any, Array]:
        """The car that rolls or None, and `kernels.newton.Steps.inputs`."""
        return None, self._inputs(t, phase)

    def _step_results(self, results: Array) -> Iterator[StepResult]:
        for *result, min_tension, s in results.tolist():
            self.min_tension_and_position = min_tension, s
            yield StepResult(*result)

    def _assemble(self, t: float, phase: int, x: Array, r: Array, factors: Factors) -> None:
        """Set r at x, rows q, v, a, and unless the factors are 0 the tangent in `_tangent`."""
        if self._assembled_at != (t, phase):
            self._now = Instant(self._inputs(np.array([t]), phase)[0], self._bands, self._contact_at(t, phase))
            assemble_inertia_and_damping(self._cable, self._now)
            self._assembled_at = (t, phase)
        self.min_tension_and_position = assemble(self._cable, self._now, x, r, self._tangent, factors)

    def _make_workspaces(self) -> None:
        """Make the workspaces, which copies do not share."""
        points = np.empty((9, self._mesh.tab[..., 0].size))
        chord = None if self.fields == 2 else True
        self._cable = Cable(self._mesh, self._law, chord, self._operators, points, self.groups.damping)
        self._tangent, self._bands = self._zero_tangent(float), np.empty((3, *self._operators.shape[1:]))
        self._assembled_at = None
        self._space: collocation.Workspace | None = None

    def _zero_tangent(self, dtype: Any) -> Tangent:  # float or complex
        n = self.fields * self.n_scalar
        bordered = self.fields == 1 or "grip" not in self.drives
        ab = np.zeros((n, 2 * self._band + 1), dtype)
        return Tangent(ab, np.zeros((3, n + 1), dtype) if bordered else None)

    def _workspace(self, s: int) -> collocation.Workspace:
        if self._space is None or len(self._space.bands) != s:
            n = self.n_dof
            parts = Tangent(*(None if x is None else np.array([x] * 3) for x in self._zero_tangent(float)))
            self._space = collocation.Workspace(
                real=self._zero_tangent(float), complex_pair=self._zero_tangent(complex), parts=parts,
                bands=np.empty((s, *self._bands.shape)), kept_step=np.full(1, math.nan), scales=np.ones((s, n)),
                x=np.empty((s, 3, n)), r=np.empty((s, n)), da=np.empty((s, n)),
            )  # fmt: skip
        return self._space

    def _inputs(self, t: Array, phase: int) -> Array:
        """`Instant.inputs` at t (...), (..., 3 + fields)."""
        raise NotImplementedError

    def _contact_at(self, t: float, phase: int) -> Contact:
        raise NotImplementedError

    def _mass_kinematics(self, states: States) -> Array:
        """s_o, ds_o, dds_o of a history (n, 3)."""
        return np.ascontiguousarray(self.motion.positions_with_rates(states.t, states.phase).T)

    def _nodal_values(self, x: Array, dofs: Any, row: Any = slice(None)) -> Array:
        """Scalar unknowns `dofs` (...) of the cable from x (n, n_dof), (n, ..., fields); 0 at supports, -1.

        row : of each of `dofs`; default all.
        """
        cable = x[:, : self.fields * self.n_scalar].reshape(len(x), self.n_scalar, self.fields)
        return np.where(np.asarray(dofs)[..., None] >= 0, cable[row, dofs], 0.0)

    def _mesh_kinematics(self, kinematics: Array) -> Array:
        """s_o, ds_o, dds_o of the mesh."""
        return kinematics

    def _motion_at_mass(self, states: States, kinematics: Array) -> tuple[Array, Array, Array, Array, Array]:
        """w(s_o(t), t), dw/dt, d2w/dt2, and w' behind and ahead, (n, fields) each."""
        raise NotImplementedError

    def _end_momentum_with_mass(self, states: States, kinematics: Array, ends: Array, force: Array) -> Array:
        """`observing.CableState.ends` of a mesh without a node at the mass; force : see `_along`."""
        return ends

    def _fields_along(
        self, states: States, kinematics: Array, ends: Array, force: Array, s: Array, frames: NDArray[np.intp]
    ) -> StationFields:
        """Fields at stations s, (m,) or (k, m), for the rows `frames` (k,).

        Each is a polynomial in every element, with coefficients (powers, elements, fields, k).

        ends : see `observing.CableState`;  force : of the cable on the mass (fields, n).
        Momentum is tested with phi = 1 up to s, from the support or the mass.
        """
        knots = self._knots
        n_left = self._mesh.n_left
        c_d = self.groups.damping
        q, v, a = self._element_polynomials([x[frames] for x in (states.q, states.v, states.a)])
        a += c_d * v
        s_o, ds, dds = kinematics[frames].T  # (k,) each
        is_behind = (np.arange(len(knots) - 1) < n_left)[:, None, None]  # (elements, 1, 1)
        side = np.where(is_behind, 1.0, -1.0)  # dh/ds_o
        length = np.diff(knots)[:, None, None]
        h = np.where(is_behind, s_o, 1.0 - s_o)  # (elements, 1, k)
        # speed of the mesh over ds_o in an element, linear in the position
        chi = np.stack([1.0 + side * knots[:-1, None, None], side * length])
        power = np.arange(1.0, len(q) + 1.0)[:, None, None, None]
        w_x = power[:-1] * q[1:] / np.where(h > 0.0, length * h, 1.0)
        rate = v - _times_linear(ds * w_x, chi)
        # int d2(h w)/dt2 phi dxi with phi = 1 up to the position, from the support or the mass
        dds = dds + c_d * ds
        moving = dds * q + 2.0 * ds * v
        momentum = np.zeros((len(q) + 1, *q.shape[1:]))
        momentum[1:] = (h * a + side * moving) * length / power
        over_element = momentum.sum(axis=0)  # (elements, fields, k)
        for of_side in (slice(0, n_left), slice(n_left, None)):
            momentum[0, of_side] += np.cumsum(over_element[of_side], axis=0) - over_element[of_side]
        at_node = 2.0 * ds * self._nodal_values(states.v[frames], self.node).T  # (fields, k)
        at_node += dds * self._nodal_values(states.q[frames], self.node).T
        momentum[0] += np.where(is_behind, ends[0][:, frames], ends[2][:, frames] + at_node)
        force_less_flux = momentum - _times_linear(moving, chi)

        # the element e of each station and the position in it, (k, m)
        s_o = s_o[:, None]
        behind = (s <= s_o) & (s_o > 0.0)
        x = np.clip((s - s_o) / np.where(behind, s_o, 1.0 - s_o), -1.0, 1.0)
        e = np.searchsorted(knots[1:-1], x)
        e = np.where(behind, e, np.maximum(e, n_left))
        inside = (x - knots[e]) / np.diff(knots)[e]
        row = np.arange(frames.size)[:, None]
        at = np.stack([(e * self.fields + field) * frames.size + row for field in range(self.fields)])

        def values(polynomials: Array) -> Array:
            """Polynomials at the stations, (fields, k, m)."""
            highest, *others = polynomials.reshape(len(polynomials), -1)[::-1]
            value = highest.take(at)
            for coefficients in others:
                value *= inside
                value += coefficients.take(at)
            return value

        mesh_speed = ds[:, None] * (1.0 - abs(x))
        return StationFields(values(q), values(rate), values(w_x), values(force_less_flux), mesh_speed)

    def _element_polynomials(self, histories: Sequence[Array]) -> Array:
        """Coefficients of fields with unknowns (k, n_dof), (histories, powers, elements, fields, k)."""
        size = self.fields * self.n_scalar
        k = len(histories[0])
        unknowns = np.zeros((self.n_scalar + 1, len(histories), self.fields, k))  # the last ones, -1, of the supports
        for i, x in enumerate(histories):
            unknowns[:-1, i] = x[:, :size].T.reshape(self.n_scalar, self.fields, k)
        polynomials = np.tensordot(self._shapes, unknowns[self._mesh.dofs], ((0,), (1,)))
        return np.moveaxis(polynomials, 2, 0)

    def _set_law(self, law: str) -> None:
        if law not in ("elastic", "tension-only"):
            raise ValueError(f"law must be elastic or tension-only, got {law!r}")
        self.law = law
        g = self.groups
        flag = TENSION_ONLY if law == "tension-only" else ELASTIC
        if self.model == "full":
            self._law = np.array([g.alpha, g.sigma, g.c, flag])
        else:
            T_chord = 1.0 / g.chord_cos
            curvature = 0.0 if self.model == "straight" else g.sigma * g.chord_cos / T_chord
            self._law = np.array([g.alpha, T_chord, curvature, *STRETCHING[self.model], flag])

    def static_shape(self, s_o: Any) -> tuple[Array, Array, Array]:
        """Position, slope and curvature (..., fields) of the static shape; the parabola for one field."""
        s_o = np.asarray(s_o)
        if self.fields == 2:
            _, xp, yp, xpp, ypp = self.groups.tension_and_shape_derivatives(s_o)
            return np.stack(self.groups.coordinates(s_o), -1), np.stack([xp, yp], -1), np.stack([xpp, ypp], -1)
        bend = -self._law[2] * np.ones_like(s_o)
        depth = -0.5 * (bend * s_o * (1.0 - s_o))
        slope = bend * (s_o - 0.5)
        return depth[..., None], slope[..., None], bend[..., None]

    def _load_at_mass(self, s_o: Any, ds: Any, dds: Any) -> tuple[Any, ...]:
        """mu d2X/dt2 less the weight of each field."""
        mu = self.inertia
        weight = self.weight
        if self.fields == 1:
            curvature = float(self._law[2])
            return (mu * (dds * curvature * (0.5 - s_o) - ds * ds * curvature) - weight[0],)
        p = self.groups.c - self.groups.sigma * s_o
        T = np.sqrt(1.0 + p * p)
        bend = ds * ds * self.groups.sigma / T**3
        return mu * (dds / T + bend * p) - weight[0], mu * (dds * p / T - bend) - weight[1]

    def mass_positions_and_displacements(self, states: States) -> tuple[Array, Array]:
        kinematics = self._mass_kinematics(states)
        return kinematics[:, 0], self._motion_at_mass(states, kinematics)[0] @ self.direction

    def observe(self, states: States, s: Array, frames: NDArray[np.intp]) -> Observation:
        return observing.observe(self, states, s, frames)
