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
from cablefem.elements.kernels.balance import (
    Cable,
    Factors,
    Instant,
    MassCoupling,
    Mesh,
    assemble_cable,
    set_mass_damping_stiffness_bands,
)
from cablefem.elements.kernels.banded import Tangent, factorise_in_place, solve_factored_in_place
from cablefem.elements.kernels.law import ELASTIC, TENSION_ONLY
from cablefem.elements.kernels.newton import NO_TANGENT, Steps, solve_newmark_steps
from cablefem.elements.observing import HistoryWithForces, MotionAtMass, StationFields, StationPoints
from cablefem.elements.reference import QuadraturePoints
from cablefem.newmark import Array, Newton, Solve, State, States, StepResult, System, Tableau, TangentFactors
from cablefem.response import Observation
from cablefem.scene import Groups

MODELS = ("full", "string", "sagged", "stretching")

# lam, kap: tension raised by the sag, by the slope squared
STRETCHING = {"straight": (0.0, 0.0), "string": (0.0, 0.0), "sagged": (1.0, 0.0), "stretching": (1.0, 1.0)}

UNITS: tuple[Factors, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def _multiply_by_linear(polynomials: Array, linear: Array) -> Array:
    """Polynomials (powers, ...) times linear functions (2, ...)."""
    constant, slope = linear
    at_constant = polynomials * constant
    out = np.zeros((len(polynomials) + 1, *at_constant.shape[1:]))
    out[:-1] = at_constant
    out[1:] += polynomials * slope
    return out


class CableElements(System):
    """A cable with its moving mass; a subclass sets the attributes, `start`, `_kinematics_and_load`,
    `_mass_coupling_at` and `_cable_motion_at_mass`.

    model : "full" for (u, v), or one field normal to the chord: "string", "sagged", "stretching".
    load : "mass", or "force" for its weight.
    law : "elastic", or "tension-only": N = max(0, T + alpha eps).
    """

    drives: tuple[str, ...] = ("grip",)
    n_scalar: int  # unknowns per field
    _band: int
    _operators: Array  # see `kernels.balance.Cable`
    _mesh: Mesh
    _at_inertia: QuadraturePoints  # that integrate products of two shapes
    _at_force: QuadraturePoints  # of `_mesh`
    _knots: Array  # 0 at the mass or the end of a fixed mesh
    _shapes: Array  # `reference.shape_polynomial_coefficients`
    _moments: Array  # `reference.shape_integrals` of each side of the mass
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
        normal = np.array([[-groups.chord_sin, groups.chord_cos]])  # of the chord
        self.direction = np.eye(2) if model == "full" else normal  # displacement of each field
        self.fields = len(self.direction)
        self.inertia = groups.mu if load == "mass" else 0.0
        self.min_tension_and_position = (math.inf, 0.0)
        self.weight = groups.mu * groups.sigma * self.direction[:, 1]
        self._set_law(law)

    def with_law(self, law: str) -> Self:
        """A copy with another cable law and the same tables."""
        other = copy(self)
        other._set_law(law)
        other._make_kernel_workspaces()
        return other

    def position(self, x: State) -> float:
        """s_o of the mass."""
        return self.motion.position_with_rates(x.t, x.phase)[0]

    def balance_times(self, t0: Array, t1: Array, end_weight: float, phase: int) -> Array:
        if self.motion is None:
            return super().balance_times(t0, t1, end_weight, phase)
        return self.motion.times_of_mean_positions(t0, t1, end_weight, phase)

    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        r = np.empty(self.n_dof)
        self._set_residual_and_tangent(t, phase, np.array([q, v, a]), r, NO_TANGENT)
        return r

    def linearise(self, t: float, q: Array, v: Array, a: Array, phase: int, c: TangentFactors) -> tuple[Array, Solve]:
        """Residual (n_dof,), and a solver of c0 dr/dq + c1 dr/dv + c2 dr/da, banded with a border."""
        r = np.empty(self.n_dof)
        x = np.array([q, v, a])
        tangent = self._tangent
        c0, c1, c2 = c
        if isinstance(c0, complex):  # a sum of real ones
            tangent = self._zero_tangent(complex)
            for factor, unit in zip(c, UNITS, strict=True):
                self._set_residual_and_tangent(t, phase, x, r, unit)
                for to, of in zip(tangent, self._tangent, strict=True):
                    if to is not None:
                        to += factor * of
        else:
            factors = float(c0), float(c1.real), float(c2.real)
            self._set_residual_and_tangent(t, phase, x, r, factors)
        factorise_in_place(*tangent)
        return r, partial(solve_factored_in_place, *tangent)

    def solve_step(self, t: float, phase: int, start: Array, end_out: Array, rule: Array, newton: Newton) -> StepResult:
        ends, results, _ = self._take_newmark_steps(np.array([t]), phase, start, rule[None], newton)
        end_out[:] = ends[0]
        return next(self._yield_results_noting_tension(results))

    def collocate_steps(self, phase: int, steps: newmark.Steps, rule: Tableau, newton: Newton) -> Iterator[StepResult]:
        if not self.many_steps:
            steps = steps.section(0, 1)
        return self._yield_results_noting_tension(self._take_collocation_steps_until_event(phase, steps, rule, newton))

    def _take_newmark_steps(
        self, t: Array, phase: int, start: Array, rules: Array, newton: Newton
    ) -> tuple[Array, Array, int]:
        """Ends (m, 3, n_dof) and `results` (m, 6) of `kernels.newton.Steps`, and how many steps are good."""
        car, inputs = self._car_and_kernel_inputs(t, phase)
        ends = np.empty((t.size, *start.shape))
        results = np.empty((t.size, 6))
        coupling = self._mass_coupling_at(t.item(0), phase)
        steps = Steps(inputs, coupling, start, rules, ends, results, self.slack_ends)
        self._assembled_at = None
        taken = solve_newmark_steps(self._cable, car, self._tangent, self._bands, steps, newton)
        return ends, results, taken

    def _take_collocation_steps_until_event(
        self, phase: int, steps: newmark.Steps, rule: Tableau, newton: Newton
    ) -> Array:
        """Take collocation steps; return `results` of `kernels.newton.Steps` of those taken, at least of the first."""
        t = rule.node_times(steps.t)
        results = np.empty((len(steps.a), 6))
        car, inputs = self._car_and_kernel_inputs(t, phase)
        at_nodes = [self._mass_coupling_at(x, phase) for x in t[0].tolist()]
        coupling = MassCoupling(*map(np.array, zip(*at_nodes, strict=True)))
        kernel_steps = collocation.Steps(inputs, coupling, *steps, results, self.slack_ends)
        self._assembled_at = None
        space = self._collocation_workspace(rule.c.size)
        taken = collocation.collocate_until_event(self._cable, car, space, kernel_steps, rule, newton)
        return results[: max(1, taken)]

    def _car_and_kernel_inputs(self, t: Array, phase: int) -> tuple[Any, Array]:
        """The car that rolls, or None, and `kernels.newton.Steps.inputs`."""
        return None, self._kinematics_and_load(t, phase)

    def _yield_results_noting_tension(self, results: Array) -> Iterator[StepResult]:
        """Yield `results` of `kernels.newton.Steps`; `min_tension_and_position` is that of the last one yielded."""
        for *result, min_tension, s in results.tolist():
            self.min_tension_and_position = min_tension, s
            yield StepResult(*result)

    def _set_residual_and_tangent(self, t: float, phase: int, x: Array, r: Array, factors: Factors) -> None:
        """Set r, `min_tension_and_position` and, unless the factors are 0, `_tangent` at x, rows q, v, a."""
        if self._assembled_at != (t, phase):
            inputs = self._kinematics_and_load(np.array([t]), phase)[0]
            self._instant = Instant(inputs, self._bands, self._mass_coupling_at(t, phase))
            set_mass_damping_stiffness_bands(self._cable, self._instant)
            self._assembled_at = (t, phase)
        self.min_tension_and_position = assemble_cable(self._cable, self._instant, x, r, self._tangent, factors)

    def _make_kernel_workspaces(self) -> None:
        """Make the workspaces, which copies do not share."""
        points = np.empty((9, self._mesh.tab[..., 0].size))
        chord = None if self.fields == 2 else True
        self._cable = Cable(self._mesh, self._law, chord, self._operators, points, self.groups.damping)
        self._tangent = self._zero_tangent(float)
        self._bands = np.empty((3, *self._operators.shape[1:]))
        self._assembled_at = None
        self._space: collocation.Workspace | None = None

    def _zero_tangent(self, dtype: Any) -> Tangent:  # float or complex
        n = self.fields * self.n_scalar
        bordered = self.fields == 1 or "grip" not in self.drives
        ab = np.zeros((n, 2 * self._band + 1), dtype)
        border = np.zeros((3, n + 1), dtype) if bordered else None
        return Tangent(ab, border)

    def _collocation_workspace(self, nodes: int) -> collocation.Workspace:
        """The workspace of a rule with so many nodes, made once."""
        if self._space is None or len(self._space.bands) != nodes:
            n = self.n_dof
            real = self._zero_tangent(float)
            parts = [None if x is None else np.array([x] * 3) for x in real]
            self._space = collocation.Workspace(
                real=real,
                complex_pair=self._zero_tangent(complex),
                parts=Tangent(*parts),
                bands=np.empty((nodes, *self._bands.shape)),
                kept_step=np.full(1, math.nan),
                scales=np.ones((nodes, n)),
                x=np.empty((nodes, 3, n)),
                r=np.empty((nodes, n)),
                da=np.empty((nodes, n)),
            )
        return self._space

    def _kinematics_and_load(self, t: Array, phase: int) -> Array:
        """Kinematics of the mesh and load of the mass at t (...): `Instant.inputs` (..., 3 + fields)."""
        raise NotImplementedError

    def _mass_coupling_at(self, t: float, phase: int) -> MassCoupling:
        raise NotImplementedError

    def _mass_kinematics(self, states: States) -> Array:
        """s_o, ds_o, dds_o of a history (n, 3)."""
        return np.ascontiguousarray(self.motion.positions_with_rates(states.t, states.phase).T)

    def _nodal_values(self, history: Array, dofs: Any, row: Any = slice(None)) -> Array:
        """Scalar unknowns `dofs` (...) of the cable in a history (n, n_dof), (n, ..., fields); 0 at supports, -1.

        row : of the history, for each of `dofs`; default all.
        """
        size = self.fields * self.n_scalar
        cable = history[:, :size].reshape(len(history), self.n_scalar, self.fields)
        return np.where(np.asarray(dofs)[..., None] >= 0, cable[row, dofs], 0.0)

    def _moving_node_kinematics(self, mass_kinematics: Array) -> Array:
        """s_o, ds_o, dds_o (n, 3) of the node between both sides of the mesh: it follows the mass."""
        return mass_kinematics

    def _cable_motion_at_mass(self, states: States, mass_kinematics: Array) -> MotionAtMass:
        raise NotImplementedError

    def _forces_at_side_ends_with_mass(self, history: HistoryWithForces) -> Array:
        """`observing.CableState.forces_at_side_ends`, with the mass added on a mesh without a node at it."""
        return history.forces_at_side_ends

    def _fields_at_stations(self, history: HistoryWithForces, s: Array, frames: NDArray[np.intp]) -> StationFields:
        """Fields at stations s, (m,) or (k, m), for the rows `frames` (k,)."""
        knots = self._knots
        n_left = self._mesh.n_left
        states = history.states
        q, v, a = self._element_polynomials([x[frames] for x in (states.q, states.v, states.a)])
        a += self.groups.damping * v
        s_o, ds, dds = history.mass_kinematics[frames].T  # (k,) each
        dds = dds + self.groups.damping * ds
        element = np.arange(len(knots) - 1)[:, None, None]
        is_behind = element < n_left  # (elements, 1, 1)
        side = np.where(is_behind, 1.0, -1.0)  # dh/ds_o
        length = np.diff(knots)[:, None, None]
        h = np.where(is_behind, s_o, 1.0 - s_o)  # (elements, 1, k)
        # speed of the mesh over ds_o in an element, linear in the position
        chi = np.stack([1.0 + side * knots[:-1, None, None], side * length])
        power = np.arange(1.0, len(q) + 1.0)[:, None, None, None]
        size = np.where(h > 0.0, length * h, 1.0)
        w_x = power[:-1] * q[1:] / size
        rate = v - _multiply_by_linear(ds * w_x, chi)
        moving = dds * q + 2.0 * ds * v
        momentum = np.zeros((len(q) + 1, *q.shape[1:]))
        momentum[1:] = (h * a + side * moving) * length / power
        at_node = 2.0 * ds * self._nodal_values(states.v[frames], self.node).T  # (fields, k)
        at_node += dds * self._nodal_values(states.q[frames], self.node).T
        left, _, ahead, _ = history.forces_at_side_ends[:, :, frames]
        at_begin = np.where(is_behind, left, ahead + at_node)
        self._add_momentum_before_elements(momentum, at_begin)
        force_less_flux = momentum - _multiply_by_linear(moving, chi)

        at = StationPoints(s, s_o, knots, n_left, self.fields)
        return StationFields(
            w=at.evaluate(q),
            rate=at.evaluate(rate),
            slope=at.evaluate(w_x),
            force_less_flux=at.evaluate(force_less_flux),
            c=ds[:, None] * (1.0 - abs(at.x)),
        )

    def _add_momentum_before_elements(self, momentum: Array, at_begin: Array) -> None:
        """Add constants to the polynomials int d2(h w)/dt2 phi dxi (powers, elements, fields, k), in place.

        phi = 1 up to the position, from the support or the mass;  at_begin : force there.
        """
        over_element = momentum.sum(axis=0)  # (elements, fields, k)
        for side in (slice(0, self._mesh.n_left), slice(self._mesh.n_left, None)):
            up_to_end = np.cumsum(over_element[side], axis=0)
            momentum[0, side] += up_to_end - over_element[side]
        momentum[0] += at_begin

    def _element_polynomials(self, histories: Sequence[Array]) -> Array:
        """Coefficients in each element of fields with unknowns (k, n_dof), (histories, powers, elements, fields, k)."""
        size = self.fields * self.n_scalar
        k = len(histories[0])
        unknowns = np.zeros((self.n_scalar + 1, len(histories), self.fields, k))  # the last ones, -1, of the supports
        for i, x in enumerate(histories):
            of_cable = x[:, :size].T
            unknowns[:-1, i] = of_cable.reshape(self.n_scalar, self.fields, k)
        of_elements = unknowns[self._mesh.dofs]
        polynomials = np.tensordot(self._shapes, of_elements, ((0,), (1,)))
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

    def static_shape_and_derivatives(self, s: Any) -> tuple[Array, Array, Array]:
        """Position, slope and curvature (..., fields) of the static shape at s; of one field those of the parabola."""
        s = np.asarray(s)
        if self.fields == 2:
            _, xp, yp, xpp, ypp = self.groups.tension_and_shape_derivatives(s)
            position = np.stack(self.groups.coordinates(s), -1)
            slope = np.stack([xp, yp], -1)
            return position, slope, np.stack([xpp, ypp], -1)
        bend = -self._law[2] * np.ones_like(s)
        depth = -0.5 * (bend * s * (1.0 - s))
        slope = bend * (s - 0.5)
        return depth[..., None], slope[..., None], bend[..., None]

    def _inertia_less_weight_of_mass(self, s_o: Any, ds: Any, dds: Any) -> Array:
        """Force of a mass that follows the static shape, mu d2X/dt2 less its weight (fields, ...)."""
        _, slope, bend = (x.T for x in self.static_shape_and_derivatives(s_o))
        inertia = self.inertia * (dds * slope + ds * ds * bend)
        return (inertia.T - self.weight).T

    def mass_positions_and_displacements(self, states: States) -> tuple[Array, Array]:
        """s_o (n,) and the displacement of the mass (n, 2)."""
        kinematics = self._mass_kinematics(states)
        at_mass = self._cable_motion_at_mass(states, kinematics)
        return kinematics[:, 0], at_mass.w @ self.direction

    def observe(self, states: States, s: Array, frames: NDArray[np.intp]) -> Observation:
        return observing.observe(self, states, s, frames)
