"""Cable elements on any mesh; dimensionless: l = H = rho = 1."""

import math
import sys
from collections.abc import Iterator, Sequence
from copy import copy
from functools import partial
from typing import Any, Self

import numpy as np
from numpy.polynomial.polynomial import polyder, polyint, polyval, polyvander
from numpy.typing import NDArray

from cablefem import newmark
from cablefem.elements import observing
from cablefem.elements.kernels import collocation
from cablefem.elements.kernels.balance import Cable, Contact, Instant, Mesh, Rates, assemble, assemble_inertia
from cablefem.elements.kernels.banded import Tangent, factorise, solve
from cablefem.elements.kernels.law import ELASTIC, TENSION_ONLY
from cablefem.elements.kernels.newton import NO_TANGENT, Steps, solve_steps
from cablefem.newmark import Array, Newton, Solve, State, StepResult, System, Tableau
from cablefem.response import Observation, States
from cablefem.scene import Groups

MODELS = ("full", "string", "sagged", "stretching")

# lam, kap: tension raised by the sag, by the slope squared
STRETCHING = {"straight": (0.0, 0.0), "string": (0.0, 0.0), "sagged": (1.0, 0.0), "stretching": (1.0, 1.0)}

Factors = tuple[float, float, float]  # of dr/dq, dr/dv, dr/da
UNITS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class CableElements(System):
    """A cable with its moving mass; a subclass sets the attributes, `start`, `_places`, `_contact_at` and `_at_mass`.

    model : "full" for (u, v), or one field normal to the chord: "string", "sagged", "stretching".
    load : "mass", or "force" for its weight.
    law : "elastic", or "tension-only": N = max(0, T + alpha eps).
    """

    drives: tuple[str, ...] = ("grip",)
    n_scalar: int  # unknowns per field
    _band: int
    _operators: Array  # see `kernels.balance.Cable`
    _mesh: Mesh
    _knots: Array  # 0 at the mass or the end of a fixed mesh
    _shapes: Array  # `reference.shape_polynomials`
    _moments: Array  # `reference.moments` of each side of the mass
    _at: tuple[float, int] | None
    node: int  # scalar unknown at the mass

    def __init__(self, groups: Groups, model: str, load: str, law: str) -> None:
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
        self.min_tension = (math.inf, 0.0)  # and its s
        self.weight = groups.mu * groups.sigma * self.direction[:, 1]
        self._set_law(law)

    def with_law(self, law: str) -> Self:
        """A copy with another cable law and the same tables."""
        other = copy(self)
        other._set_law(law)
        other._make_workspaces()
        return other

    def position(self, x: State) -> float:
        return self.motion.at(x.t, x.phase)[0]

    def between(self, t0: Array, t1: Array, w: float, phase: int) -> Array:
        return super().between(t0, t1, w, phase) if self.motion is None else self.motion.between(t0, t1, w, phase)

    def in_time(self, states: States) -> States:
        return states

    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        r = np.empty(self.n_dof)
        self._assemble(t, phase, np.array([q, v, a]), r, NO_TANGENT)
        return r

    def linearise(
        self, t: float, q: Array, v: Array, a: Array, phase: int, c0: complex, c1: complex, c2: complex
    ) -> tuple[Array, Solve]:
        r = np.empty(self.n_dof)
        x = np.array([q, v, a])
        tangent = self._single
        if isinstance(c0, complex):  # a sum of real ones
            tangent = self._tangent(complex)
            for factor, unit in zip((c0, c1, c2), UNITS, strict=True):
                self._assemble(t, phase, x, r, unit)
                for to, of in zip(tangent, self._single, strict=True):
                    if to is not None:
                        to += factor * of
        else:
            self._assemble(t, phase, x, r, (float(c0), float(c1.real), float(c2.real)))
        factorise(*tangent)
        return r, partial(solve, *tangent)

    def solve_step(self, t: float, phase: int, start: Array, end: Array, rule: Array, newton: Newton) -> StepResult:
        ends, results, _ = self._steps(np.array([t]), phase, start, rule[None], newton)
        end[:] = ends[0]
        return next(self._step_results(results))

    def collocate(self, phase: int, steps: newmark.Steps, rule: Tableau, newton: Newton) -> Iterator[StepResult]:
        if not self.many_steps:
            steps = steps.first(1)
        return self._step_results(self._collocated(phase, steps, rule, newton))

    def _steps(self, t: Array, phase: int, start: Array, rules: Array, newton: Newton) -> tuple[Array, Array, int]:
        """Ends (m, 3, n_dof) and `results` (m, 6) of `kernels.newton.Steps`, and how many are good."""
        ride, places = self._moved(t, phase, start)
        ends = np.empty((t.size, *start.shape))
        results = np.empty((t.size, 6))
        steps = Steps(places, self._contact_at(t.item(0), phase), start, rules, ends, results)
        self._at = None
        return ends, results, solve_steps(self._cable, ride, self._single, self._bands, steps, newton)

    def _collocated(self, phase: int, steps: newmark.Steps, rule: Tableau, newton: Newton) -> Array:
        """`results` of the steps taken."""
        t = rule.instants(steps.t)
        results = np.empty((len(steps.a), 6))
        ride, places = self._moved(t, phase, steps.ends[0])
        at_nodes = [self._contact_at(x, phase) for x in t[0].tolist()]
        contacts = tuple(at_nodes + at_nodes[-1:])[:3]  # as many for each rule: compiled once
        of = collocation.Steps(places, contacts, *steps, results)
        self._at = None
        space = self._workspace(rule.c.size)
        taken = collocation.collocate(self._cable, ride, space, of, rule, newton)
        return results[: max(1, taken)]

    def _moved(self, t: Array, phase: int, start: Array) -> tuple[Any, Array]:
        """The car that rolls or None, and `kernels.newton.Steps.places`."""
        return None, self._places(t, phase)

    def _step_results(self, results: Array) -> Iterator[StepResult]:
        for *result, min_tension, s in results.tolist():
            self.min_tension = min_tension, s
            yield StepResult(*result)

    def _assemble(self, t: float, phase: int, x: Array, r: Array, factors: Factors) -> None:
        """Set r at x, rows q, v, a, and unless the factors are 0 the tangent in `_single`."""
        if self._at != (t, phase):
            self._now = Instant(self._places(np.array([t]), phase)[0], self._bands, self._contact_at(t, phase))
            assemble_inertia(self._cable, self._now)
            self._at = (t, phase)
        self.min_tension = assemble(self._cable, self._now, x, r, self._single, factors)

    def _make_workspaces(self) -> None:
        """Make the workspaces, which copies do not share."""
        points = np.empty((9, self._mesh.tab[..., 0].size))
        chord = None if self.fields == 2 else True
        c_d = self.groups.damping
        self._cable = Cable(self._mesh, self._law, chord, self._operators, points, c_d, self._rates())
        self._single, self._bands = self._tangent(float), np.empty((3, *self._operators.shape[1:]))
        self._at = None
        self._space: collocation.Workspace | None = None

    def _rates(self) -> Rates | None:
        return None

    def _tangent(self, kind: Any) -> Tangent:  # float or complex
        n = self.fields * self.n_scalar
        bordered = self.fields == 1 or "grip" not in self.drives
        ab = np.zeros((n, 2 * self._band + 1), kind)
        return Tangent(ab, np.zeros((3, n + 1), kind) if bordered else None)

    def _workspace(self, s: int) -> collocation.Workspace:
        if self._space is None or len(self._space.bands) != s:
            n = self.n_dof
            q, v, a = (self._tangent(float) for _ in range(3))
            self._space = collocation.Workspace(
                real=self._tangent(float), pair=self._tangent(complex), parts=(q, v, a),
                bands=np.empty((s, *self._bands.shape)), kept=np.full(1, math.nan), scales=np.ones((s, n)),
                x=np.empty((s, 3, n)), r=np.empty((s, n)), da=np.empty((s, n)),
            )  # fmt: skip
        return self._space

    def _places(self, t: Array, phase: int) -> Array:
        """`Instant.place` at t (...), (..., 3 + fields)."""
        raise NotImplementedError

    def _contact_at(self, t: float, phase: int) -> Contact:
        raise NotImplementedError

    def _kinematics(self, states: States) -> Array:
        """s_o, ds_o, dds_o of a history (n, 3)."""
        return np.ascontiguousarray(self.motion.along(states.t, states.phase).T)

    def _padded(self, x: Array) -> Array:
        """Unknowns of the cable (n, n_scalar + 1, fields); the last ones, of the supports, are 0."""
        cable = x[:, : self.fields * self.n_scalar].reshape(len(x), self.n_scalar, self.fields)
        return np.pad(cable, ((0, 0), (0, 1), (0, 0)))

    def _mesh_at(self, kinematics: Array) -> Array:
        """s_o, ds_o, dds_o of the mesh."""
        return kinematics

    def _at_mass(self, states: States, kinematics: Array) -> tuple[Array, Array, Array, Array, Array]:
        """w(s_o(t), t), dw/dt, d2w/dt2, and w' behind and ahead, (n, fields) each."""
        raise NotImplementedError

    def _along(
        self, states: States, kinematics: Array, ends: Array, force: Array, s: Array, frames: NDArray[np.intp]
    ) -> tuple[Sequence[Array], Array, Array]:
        """(w, dw/dt at fixed s, w'), f - c^2 w' (k, m, fields) each, and mesh speed c (k, m); at s_o behind the mass.

        ends : see `observing._end_forces`;  force : of the cable on the mass (n, fields).
        Momentum is tested with phi = 1 up to s, from the support or the mass.
        """
        knots = self._knots
        shapes = self._shapes
        dofs = self._mesh.dofs
        n_left = self._mesh.n_left
        q, v, a = (self._padded(x[frames]) for x in (states.q, states.v, states.a))
        c_d = self.groups.damping
        s_o, ds, dds = kinematics[frames].T[..., None]
        a = a + c_d * v
        dds = dds + c_d * ds
        length = np.diff(knots)
        integrals = polyint(shapes.T)
        # d2(h w)/dt2 behind and ahead, (2, k, n_scalar + 1, fields)
        moving = dds[..., None] * q + 2.0 * ds[..., None] * v
        rates = np.stack([s_o[..., None] * a + moving, (1.0 - s_o)[..., None] * a - moving])
        of_element = polyval(1.0, integrals)  # integrals of the shapes over an element
        up_to_element = []
        for side, rate in zip((slice(0, n_left), slice(n_left, None)), rates, strict=True):
            over_element = np.einsum("kelf,l,e->kef", rate[:, dofs[side]], of_element, length[side])
            up_to_element.append(np.cumsum(over_element, axis=1) - over_element)

        # the element e of each station and the position in it, (k, m)
        behind = (s <= s_o) & (s_o > 0.0)
        h = np.where(behind, s_o, 1.0 - s_o)
        x = np.clip((s - s_o) / h, -1.0, 1.0)
        e = np.searchsorted(knots[1:-1], x)
        e = np.where(behind, np.minimum(e, n_left - 1), np.maximum(e, n_left))
        inside = (x - knots[e]) / length[e]
        row = np.arange(frames.size)[:, None]
        nodes = dofs[e]  # (k, m, n_loc)
        powers = polyvander(inside, len(integrals) - 1)

        def sums(coefficients: NDArray[np.floating], unknowns: Array) -> Array:
            """Polynomials of the shapes at the stations, times the unknowns, (k, m, fields)."""
            functions = powers[..., : len(coefficients)] @ coefficients
            return np.einsum("kml,kmlf->kmf", functions, unknowns)

        of_q = q[row[..., None], nodes]
        rate = rates[(e >= n_left)[..., None].astype(int), row[..., None], nodes]
        w = sums(shapes.T, of_q)
        w_t = sums(shapes.T, v[row[..., None], nodes])  # at a node
        w_x = sums(polyder(shapes.T), of_q) / (length[e] * h)[..., None]
        momentum = sums(integrals, rate) * length[e][..., None] + np.concatenate(up_to_element, axis=1)[row, e]
        chi = 1.0 - abs(x)
        node = self.node
        c = ds * chi
        ahead = ends[frames, 2] + 2.0 * ds * v[:, node] + dds * q[:, node]
        start = np.where(behind[..., None], ends[frames, None, 0], ahead[:, None])
        carried = start + momentum - 2.0 * c[..., None] * w_t - (dds * chi)[..., None] * w
        return (w, w_t - c[..., None] * w_x, w_x), carried, c

    def _set_law(self, law: str) -> None:
        if law not in ("elastic", "tension-only"):
            raise ValueError(f"law must be elastic or tension-only, got {law!r}")
        self.law = law
        g = self.groups
        flag = TENSION_ONLY if law == "tension-only" else ELASTIC
        if self.model == "full":
            self._law = np.array([g.alpha, g.sigma, g.c, flag])
        else:
            tau = 1.0 / g.chord_cos
            curvature = 0.0 if self.model == "straight" else g.sigma * g.chord_cos / tau
            self._law = np.array([g.alpha, tau, curvature, *STRETCHING[self.model], flag])

    def static(self, s_o: Any) -> tuple[Array, Array, Array]:
        """Position, slope and curvature (..., fields) of the static shape; the parabola for one field."""
        s_o = np.asarray(s_o)
        if self.fields == 2:
            _, xp, yp, xpp, ypp = self.groups.static(s_o)
            return np.stack(self.groups.shape(s_o), -1), np.stack([xp, yp], -1), np.stack([xpp, ypp], -1)
        bend = -self._law[2] * np.ones_like(s_o)
        depth = -0.5 * (bend * s_o * (1.0 - s_o))
        slope = bend * (s_o - 0.5)
        return depth[..., None], slope[..., None], bend[..., None]

    def _load(self, s_o: Any, ds: Any, dds: Any) -> tuple[Any, ...]:
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

    def path(self, states: States) -> tuple[Array, Array]:
        kinematics = self._kinematics(states)
        return kinematics[:, 0], self._at_mass(states, kinematics)[0] @ self.direction

    def observe(self, states: States, s: Array, frames: NDArray[np.intp]) -> Observation:
        return observing.observe(self, states, s, frames)
