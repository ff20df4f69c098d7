"""What cable elements share on any mesh: the cable's models, the banded solve, and what is measured at the mass.

Dimensionless: l = H = rho = 1.
"""

import math
import sys
from collections.abc import Iterator, Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array

from cablefem.elements.kernels import collocation
from cablefem.elements.kernels.balance import Contact, Mesh, assemble, combine, coupling
from cablefem.elements.kernels.banded import Tangent, factorise_coupled, solve_coupled
from cablefem.elements.kernels.law import ELASTIC, TENSION_ONLY, pulls
from cablefem.elements.kernels.newton import settle
from cablefem.elements.kernels.observe import energies
from cablefem.newmark import Array, Newton, Settled, Solve, State, System, Tableau
from cablefem.response import Observation, States
from cablefem.scene import Groups

MODELS = ("full", "string", "sagged", "stretching")

# lam, kap of the one-field models: whether stretching by the sag, and by the slope squared, raises the tension; the
# straight string of textbooks has no sag whose curvature would load the mass
STRETCHING = {"straight": (0.0, 0.0), "string": (0.0, 0.0), "sagged": (1.0, 0.0), "stretching": (1.0, 1.0)}

NOWHERE, UNSAID = np.empty((0, 3)), np.empty((0, 3, 3))  # places of steps, and of their nodes, where none are given


def elements_allowed(elements: int) -> int:
    """Return the number of elements if it is one, else raise ValueError."""
    if not isinstance(elements, int) or elements < 1:
        raise ValueError(f"elements must be an integer >= 1, got {elements!r}")
    return elements


def limits(newton: Newton) -> tuple[int, float, int]:
    """Return what compiled steps know of Newton's method."""
    return newton.max_iter, newton.reuse, newton.patience


def bands(matrix: coo_array, b: int) -> Array:
    """Return the diagonals of a square matrix, row by row of it: bands[b + j - i, i] = matrix[i, j], |i - j| <= b."""
    out = np.zeros((2 * b + 1, matrix.shape[0]))
    np.add.at(out, (b + matrix.col - matrix.row, matrix.row), matrix.data)
    return out


class CableElements(System):
    """A cable on some mesh with its moving mass.

    A mesh sets n_scalar (unknowns per field), n_dof, _band, _mesh and _operators, and answers `start`, `_time`,
    `_at_mass` and `_along`.

    model : "full" for (u, v), or one unknown field normal to the chord: "string", "sagged", "stretching".
    load : "mass", or "force" for its weight alone.
    law : "elastic", or "tension-only": N = max(0, T + alpha eps).
    """

    drives: tuple[str, ...] = ("grip",)
    n_scalar: int
    _band: int  # half-width, all fields
    _operators: Array  # (n_op, 2 b + 1, n_scalar fields) what M, C and K are made of, see `bands`
    _coefficients: Array  # (n_op, 3)
    _mesh: Mesh
    _fine: Array  # tab of the mesh with the points of inertia
    _n_left: int  # elements behind the mass; all are where the mesh rests
    _contact: Contact
    _at: tuple[float, int] | None  # instant and phase that all this is for

    def __init__(self, groups: Groups, model: str, load: str, law: str) -> None:
        if groups.drive.mode not in self.drives:
            raise ValueError(
                f"a car that rolls (drive {groups.drive.mode}) needs mass-following elements of the full model"
            )
        if groups.motion is None and groups.drive.mode != "free":
            raise ValueError("the scene has no mass that travels")
        if model not in (*MODELS, "straight"):
            raise ValueError(f"model must be one of {', '.join(MODELS)}, got {model!r}")
        if load not in ("mass", "force"):
            raise ValueError(f"load must be mass or force, got {load!r}")
        self.groups, self.model, self.load = groups, model, load
        self.motion: Any = groups.motion  # none of a free ride
        self.phases = groups.drive.phases if self.motion is None else self.motion.phases
        self.force_scale = (groups.mu or 1.0) * groups.sigma  # weight of the mass; of a bare cable: its own
        self.force_floor = 16.0 * sys.float_info.epsilon * max(1.0, groups.alpha)  # slopes of order one
        self.fields = 2 if model == "full" else 1
        self.inertia = groups.mu if load == "mass" else 0.0
        # displacement in the plane of each field
        self.direction = np.eye(2) if model == "full" else np.array([[-groups.chord_sin, groups.chord_cos]])
        self.least_tension = (math.inf, 0.0)  # least mean tension of an element and its s, at the last residual
        self._weight = (groups.mu * groups.sigma * self.direction[:, 1]).tolist()  # of the mass, field by field
        self._set_law(law)

    # --- the system ------------------------------------------------------------------------------------
    def with_law(self, law: str) -> Self:
        """Return the same discretisation with another cable law, sharing all tables."""
        twin = object.__new__(type(self))
        twin.__dict__.update(self.__dict__)
        twin._set_law(law)
        twin._fresh()
        return twin

    def place(self, x: State) -> float:
        """Return s_o of a state."""
        return self.motion.at(x.t, x.phase)[0]

    def between(self, t0: Array, t1: Array, w: float, phase: int) -> Array:
        """Return the instants that go with means of the unknowns at t0 and t1; a free ride's place is one of them."""
        return super().between(t0, t1, w, phase) if self.motion is None else self.motion.between(t0, t1, w, phase)

    def in_time(self, states: States) -> States:
        """Return the history itself: time is its independent variable."""
        return states

    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        r = np.empty(self.n_dof)
        self._assemble(t, q, v, a, phase, r, 0.0, 0.0, 0.0)
        return r

    def linearise(
        self, t: float, q: Array, v: Array, a: Array, phase: int, c0: complex, c1: complex, c2: complex
    ) -> tuple[Array, Solve]:
        """Real factors live in one workspace."""
        r, work = np.empty(self.n_dof), self._work
        if isinstance(c0, complex):
            work = self._workspace(complex)._replace(increment=self._work.increment)
            work.ab[:] = 0.0
            for factor, *one in zip((c0, c1, c2), *np.eye(3).tolist(), strict=True):
                self._assemble(t, q, v, a, phase, r, *one)
                work.ab[:] += factor * self._work.ab
        else:
            self._assemble(t, q, v, a, phase, r, c0, float(c1.real), float(c2.real))
        if not factorise_coupled(work, c0 * coupling(self._cable)):
            return r, lambda b: np.full_like(b, math.nan)  # singular: the driver takes NaN for a stalled step

        def solve(b: Array) -> Array:
            solve_coupled(work, b)
            return b

        return r, solve

    def settle(
        self, t: float, phase: int, start: Array, now: Array, rule: Array, bound: float, newton: Newton
    ) -> Settled:
        self._time(t, phase)
        self._at = (t, phase)
        told, of = np.empty((1, 6)), (tuple(self._mesh), self._cable, tuple(self._work), start, now[None], rule[None])
        settle(self._grip(NOWHERE, NOWHERE), None, *of, told, bound, limits(newton))
        *done, least, where = told[0].tolist()
        self.least_tension = least, where
        return Settled(*done)

    def _grip(self, places: Array, loads: Array) -> tuple[Any, ...]:
        """Return what compiled steps of Newmark's family take of a mass whose place is given."""
        contact = tuple(self._contact)
        return self._operators, self._coefficients, self._bands, contact, self._n_left, places, loads

    def collocate(
        self, t: Array, phase: int, ends: Array, a: Array, further: Array, rule: Tableau, bound: float, newton: Newton
    ) -> Iterator[Settled]:
        bands, spans, instants = *self._at_nodes(), rule.instants(t)[0].tolist()
        contacts = []
        for i, instant in enumerate((*instants, instants[-1])[:3]):  # compiled for three nodes, two are filled up
            self._time(instant, phase)
            combine(self._operators, self._coefficients, bands[i])
            spans[i] = self._mesh.span
            contacts.append((*self._contact[:-1], self._contact.load.copy()))
        grip = self._operators, self._coefficients, bands, spans, tuple(contacts), self._n_left, UNSAID, UNSAID
        return self._said(self._collocated(grip, None, None, t[:2], ends, a[:1], further, rule, bound, newton))

    def _at_nodes(self) -> tuple[Array, Array]:
        """Return room for M, C and K and for the spans at three nodes of a step."""
        return np.empty((3, *self._bands.shape)), np.empty((3, *self._mesh.span.shape))

    def _collocated(
        self, grip: Any, fronts: Any, ride: Any, t: Array, ends: Array, a: Array, further: Array, rule: Tableau,
        bound: float, newton: Newton,
    ) -> Array:  # fmt: skip
        """Return what is told of the steps taken, at least of the first."""
        self._at, told = None, np.empty((len(a), 6))
        of = grip, fronts, ride, tuple(self._mesh), self._cable, self._works, self._kept, t, ends, a, further
        taken = collocation.collocate(*of, rule.numbers, told, bound, (*limits(newton), newton.enough))
        return told[: max(1, taken)]

    def _said(self, told: Array) -> Iterator[Settled]:
        for *done, least, where in told.tolist():
            self.least_tension = least, where
            yield Settled(*done)

    # --- what a mesh answers ---------------------------------------------------------------------------
    def _fresh(self) -> None:
        """Make the workspaces, which a twin with another law must not share."""
        self._at = None
        self._work = self._workspace(float)
        real = self._workspace(float)
        pair = self._workspace(complex)._replace(increment=real.increment)
        self._works, self._kept = (tuple(real), tuple(pair)), np.full(1, math.nan)  # for `collocation.collocate`
        self._bands = np.empty((3, *self._operators.shape[1:]))

    def _workspace(self, kind: type) -> Tangent:
        n = self.fields * self.n_scalar
        coupled: Any = np.empty(n if self.fields == 1 else 0, kind)
        return Tangent(
            np.empty((n, 3 * self._band + 1), kind), np.empty((2, n), dtype=np.int64), coupled.real.copy(), coupled
        )

    def _time(self, t: float, phase: int) -> None:
        """Set _coefficients of the _operators, _mesh and _contact at this instant."""
        raise NotImplementedError

    def _split(self, states: States) -> tuple[States, Array]:
        """Return the history of the cable's unknowns, and s_o, ds_o, dds_o (n, 3)."""
        return states, np.ascontiguousarray(self.motion.along(states.t, states.phase).T)

    def _mesh_at(self, kinematics: Array) -> Array:
        """Return the s_o, ds_o, dds_o that the mesh has."""
        return kinematics

    def _spans(self, states: States, kinematics: Array) -> Array:
        """Return the spans (n, n_el, 6) of the mesh where s_o, ds_o, dds_o do not say them."""
        return np.empty((0, *self._mesh.span.shape))

    def _at_mass(self, states: States, kinematics: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Return w(s_o(t), t), its first and second time derivative, and w' behind and ahead, (n, fields) each."""
        raise NotImplementedError

    def _along(
        self, states: States, kinematics: Array, force: Array, rise: Array, s: Array, frames: NDArray[np.intp]
    ) -> tuple[Sequence[Array], Array, Array, tuple[Array, Array]]:
        """Return what is seen along the cable: fields, and f - c^2 w' from the balance of momentum.

        Fields: w, dw/dt at fixed s, and w' at frames x stations, (k, m, fields) each; at s = s_o the side behind.
        f is the internal force less its static part, c the speed of the mesh; recovered tensions are made of them.
        First (n, 4, fields): at the left support, behind and ahead of the mass, at the right support; then
        (k, m, fields): along the cable at the frames.  Then c at the mass (n,) and along the cable (k, m).
        `force` of the cable on the mass; `rise` as in `end_forces`.
        """
        raise NotImplementedError

    # --- the cable -------------------------------------------------------------------------------------
    def _set_law(self, law: str) -> None:
        if law not in ("elastic", "tension-only"):
            raise ValueError(f"law must be elastic or tension-only, got {law!r}")
        self.law = law
        g, flag = self.groups, TENSION_ONLY if law == "tension-only" else ELASTIC
        if self.model == "full":
            self._cable = np.array([g.alpha, g.sigma, g.c, flag])
        else:
            tau = 1.0 / g.chord_cos
            curvature = 0.0 if self.model == "straight" else g.sigma * g.chord_cos / tau
            self._cable = np.array([g.alpha, tau, curvature, *STRETCHING[self.model], flag])

    def _assemble(
        self, t: float, q: Array, v: Array, a: Array, phase: int, r: Array, c0: float, c1: float, c2: float
    ) -> None:
        """Set r and, unless c0, c1, c2 vanish, the banded tangent in the workspace; note the least tension."""
        if self._at != (t, phase):
            self._time(t, phase)
            self._at = (t, phase)
            combine(self._operators, self._coefficients, self._bands)
        self.least_tension = assemble(
            self._bands, self._mesh, self._cable, self._contact, q, v, a, r, self._work, c0, c1, c2
        )

    def _static(self, s_o: Any) -> tuple[Array, Array, Array]:
        """Return place, slope and curvature of the static shape (..., fields); the parabola for one-field models."""
        s_o = np.asarray(s_o)
        if self.fields == 2:
            _, *slope_and_bend = self.groups.static(s_o)
            xp, yp, xpp, ypp = slope_and_bend
            return np.stack(self.groups.shape(s_o), -1), np.stack([xp, yp], -1), np.stack([xpp, ypp], -1)
        bend = -self._cable[2] * np.ones_like(s_o)
        return -0.5 * (bend * s_o * (1.0 - s_o))[..., None], (bend * (s_o - 0.5))[..., None], bend[..., None]

    def _load(self, s_o: Any, ds: Any, dds: Any) -> tuple[Any, ...]:
        """Return mu d2X/dt2 less the weight, of each field: what the mass asks for along its path, () or (n,)."""
        mu, weight = self.inertia, self._weight
        if self.fields == 1:
            curvature = float(self._cable[2])
            return (mu * (dds * curvature * (0.5 - s_o) - ds * ds * curvature) - weight[0],)
        p = self.groups.c - self.groups.sigma * s_o
        T = np.sqrt(1.0 + p * p)
        bend = ds * ds * self.groups.sigma / T**3
        return mu * (dds / T + bend * p) - weight[0], mu * (dds * p / T - bend) - weight[1]

    # --- observation -----------------------------------------------------------------------------------
    def path(self, states: States) -> tuple[Array, Array]:
        """Return s_o (n,) and the displacement of the mass (n, 2); see `Observation`."""
        states, kinematics = self._split(states)
        return kinematics[:, 0], self._at_mass(states, kinematics)[0] @ self.direction

    def observe(self, states: States, s: Array, frames: NDArray[np.intp]) -> Observation:
        """Measure paths, tensions, energies and fields on a history; see `Observation`."""
        g, n = self.groups, states.t.size
        states, kinematics = self._split(states)
        s_o, ds, dds = kinematics.T
        w, w_t, w_tt, *slopes = self._at_mass(states, kinematics)
        place, slope, bend = self._static(s_o)  # of the model
        velocity, acceleration = w_t + ds[:, None] * slope, w_tt + dds[:, None] * slope + (ds**2)[:, None] * bend
        force = self.inertia * acceleration - self._weight  # of the cable on the mass
        power = ds * np.sum(force * (slope + 0.5 * (slopes[0] + slopes[1])), axis=1)

        parts, least, where = np.zeros((3, n)), np.empty(n), np.full(n, 0.5)  # kinetic, strain, of weight
        of = self._cable, self.fields, self._mesh_at(kinematics), self._spans(states, kinematics), states.q, states.v
        energies(self._mesh, self._fine, self._n_left, *of, parts, least, where)
        self._at = None  # the mesh is that of another instant now
        kinetic, strain, potential = parts
        kinetic += 0.5 * self.inertia * np.sum(velocity**2, axis=1)
        potential -= (place + w) @ self._weight

        T, xp, yp, xpp, ypp = g.static(s_o)
        static, bend = np.stack([xp, yp], axis=1), np.stack([xpp, ypp], axis=1)
        behind, ahead = (static + x @ self.direction for x in slopes)
        rise = np.maximum(least, 0.0 if self.law == "tension-only" else -math.inf) - self._cable[1]  # of one field
        seen, ends, along, speed = self._along(states, kinematics, force, rise, s, frames)
        fields, dfields, slopes_s = (x @ self.direction for x in seen)
        if self.fields == 2:
            tensions, kink = self._tensions(ends, along, speed, static, T, behind, ahead, s, slopes_s)
            power += ds * kink
        else:
            tensions = self._chord_tensions(ends, rise, T, s, frames)
        for name in [name for name in tensions if "behind" in name]:
            tensions[name] = np.where(s_o > 0.0, tensions[name], np.nan)
        return Observation(
            path=w @ self.direction, path_velocity=w_t @ self.direction + ds[:, None] * static,
            path_acceleration=w_tt @ self.direction + dds[:, None] * static + (ds**2)[:, None] * bend,
            slope_behind=behind, slope_ahead=ahead,
            energy=kinetic + strain + potential, power=power, kinetic=kinetic, strain=strain, potential=potential,
            tension_min=least, tension_min_at=where,
            u=fields[..., 0], v=fields[..., 1], du=dfields[..., 0], dv=dfields[..., 1],
            t=states.t, s_o=s_o, contact=-force @ self.direction, **tensions,
        )  # fmt: skip

    def _tensions(
        self, ends: Array, along: Array, speed: tuple[Array, Array], static: Array, T: Array, behind: Array,
        ahead: Array, s: Array, slopes_s: Array,
    ) -> tuple[dict[str, Any], Array]:  # fmt: skip
        """Return the tensions and reactions of the full cable, and what a passing kink gives, <N t> . [r'] - [W]."""
        T_s, x_s, y_s = (np.broadcast_to(x, slopes_s.shape[:2]) for x in self.groups.static(s)[:3])
        static_s = np.stack([x_s, y_s], axis=-1)
        (pull_behind, N_behind, W_behind), (pull_ahead, N_ahead, W_ahead) = (
            self._pull(static, T, slope) for slope in (behind, ahead)
        )
        kink = 0.5 * np.sum((pull_behind + pull_ahead) * (ahead - behind), axis=1) - (W_ahead - W_behind)
        at_ends = self.groups.static(np.array([0.0, 1.0]))[:3]
        left, right = (ends[:, k] + at_ends[0][i] * np.array([x[i] for x in at_ends[1:]]) for i, k in ((0, 0), (1, 3)))
        return {
            "T_behind": self._recovered(ends[:, 1], speed[0], static, T, behind),
            "T_ahead": self._recovered(ends[:, 2], speed[0], static, T, ahead),
            "T": self._recovered(along, speed[1], static_s, T_s, static_s + slopes_s),
            "T_behind_pointwise": N_behind,
            "T_ahead_pointwise": N_ahead,
            "T_pointwise": self._pull(static_s, T_s, static_s + slopes_s)[1],
            "reaction_left": -left,
            "reaction_right": right,
        }, kink

    def _chord_tensions(self, ends: Array, rise: Array, T: Array, s: Array, frames: Any) -> dict[str, Any]:
        """Return the same for one field: its tension rises uniformly, and the stored energy is quadratic in w'."""
        tau, curvature = self._cable[1:3]
        chord = np.array([self.groups.chord_cos, self.groups.chord_sin])
        left, right = (
            (tau + rise)[:, None] * chord + (ends[:, k] + tau * curvature * y) @ self.direction
            for k, y in ((0, 0.5), (3, -0.5))
        )
        at_mass = T + rise
        return {
            "T_behind": at_mass, "T_ahead": at_mass, "T": self.groups.static(s)[0] + rise[frames, None],
            "reaction_left": -left, "reaction_right": right,
        }  # fmt: skip

    def _recovered(self, carried: Array, c: Array, static: Array, T: Array, slope: Array) -> Array:
        """Return N from N t - T X' - c^2 w', which the balance gives; the slope r' tells the sign of N t - c^2 r' only.

        N t - c^2 r' = (N (1 - c^2/alpha) - c^2 (1 - T/alpha)) t, because |r'| = 1 + (N - T)/alpha.
        """
        alpha, flux = self._cable[0], c**2
        known = carried + (T - flux)[..., None] * static
        size = np.hypot(known[..., 0], known[..., 1])
        size = np.where(np.sum(known * slope, axis=-1) < 0.0, -size, size)
        N = (size + flux * (1.0 - T / alpha)) / (1.0 - flux / alpha)
        return np.maximum(N, 0.0) if self.law == "tension-only" else N

    def _pull(self, static: Array, T: Array, slope: Array) -> tuple[Array, Array, Array]:
        """Return N t (..., 2), N and W (...) where the static slope is X' (..., 2) and the slope r' (..., 2)."""
        out = np.empty(slope.shape), np.empty(T.shape), np.empty(T.shape)
        flat = (np.ascontiguousarray(x) for x in (static.reshape(-1, 2), T.reshape(-1), slope.reshape(-1, 2)))
        pulls(*flat, self._cable[0], self._cable[3], out[0].reshape(-1, 2), out[1].ravel(), out[2].ravel())
        return out
