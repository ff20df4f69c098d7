"""What cable elements share on any mesh: the cable's models, the banded solve, and what is measured at the mass.

Dimensionless: l = H = rho = 1.
"""

from __future__ import annotations

import math
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array

from cablefem.elements import kernels
from cablefem.newmark import Newton, Settled, Solve, State
from cablefem.response import Observation, States
from cablefem.scene import Groups

Array = NDArray[np.float64]

MODELS = ("full", "string", "sagged", "stretching")

# lam, kap of the one-field models: whether stretching by the sag, and by the slope squared, raises the tension
STRETCHING = {"string": (0.0, 0.0), "sagged": (1.0, 0.0), "stretching": (1.0, 1.0)}


def elements_allowed(elements: int) -> int:
    """Return the number of elements if it is one, else raise ValueError."""
    if not isinstance(elements, int) or elements < 1:
        raise ValueError(f"elements must be an integer >= 1, got {elements!r}")
    return elements


def bands(matrix: coo_array, b: int) -> Array:
    """Return the diagonals of a square matrix, row by row: bands[i, b + j - i] = matrix[i, j], |i - j| <= b."""
    out = np.zeros((matrix.shape[0], 2 * b + 1))
    np.add.at(out, (matrix.row, b + matrix.col - matrix.row), matrix.data)
    return out


_NO_BAND = np.empty((1, 1))  # in place of a tangent that is not asked for


class CableElements:
    """A cable on some mesh with its moving mass: a `cablefem.newmark.System` but for `start` and the mesh.

    A mesh sets n_scalar (unknowns per field), _n_dof, _band, the tables of `kernels` and _operators, and answers
    `_time`, `_tables`, `_at_mass` and `_fields`.

    model : "full" for (u, v), or one unknown field normal to the chord: "string", "sagged", "stretching".
    load : "mass", or "force" for its weight alone.
    law : "elastic", or "tension-only": N = max(0, T + alpha eps).
    """

    n_scalar: int
    _n_dof: int
    _band: int  # half-width, all fields
    _dofs: NDArray[np.int64]
    _tab: Array
    _operators: Array  # (n_op, n_scalar, 2 b + 1) what M, C and K are made of
    _coefficients: Array  # (n_op, 3)
    _span: Array
    _contact: tuple[Any, ...]
    _at: tuple[float, int] | None  # instant and phase that all this is for

    def __init__(self, groups: Groups, model: str, load: str, law: str) -> None:
        if groups.motion is None:
            raise ValueError("the scene has no mass that travels")
        if model not in MODELS:
            raise ValueError(f"model must be one of {', '.join(MODELS)}, got {model!r}")
        if load not in ("mass", "force"):
            raise ValueError(f"load must be mass or force, got {load!r}")
        self.groups, self.model, self.load = groups, model, load
        self.motion = groups.motion
        self.fields = 2 if model == "full" else 1
        self.inertia = groups.mu if load == "mass" else 0.0
        # displacement in the plane of each field
        self.direction = np.eye(2) if model == "full" else np.array([[-groups.chord_sin, groups.chord_cos]])
        self.least_tension = (math.inf, 0.0)  # least mean tension of an element and its s, at the last residual
        self._weight = tuple((groups.mu * groups.sigma * self.direction[:, 1]).tolist())  # of the mass, field by field
        self._set_law(law)

    # --- the System protocol ---------------------------------------------------------------------------
    @property
    def n_dof(self) -> int:
        return self._n_dof

    @property
    def phases(self) -> tuple[tuple[float, float], ...]:
        return self.motion.phases

    @property
    def force_scale(self) -> float:
        return self.groups.mu * self.groups.sigma

    @property
    def force_floor(self) -> float:
        # a strain carries the rounding of slopes of order one
        return 16.0 * np.finfo(float).eps * max(1.0, self.groups.alpha)

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

    def in_time(self, states: States) -> States:
        """Return the history itself: time is its independent variable."""
        return states

    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        r = np.empty(self._n_dof)
        self._assemble(t, q, v, a, phase, r, _NO_BAND, np.empty_like(self._work[2]), False, 0.0, 0.0, 0.0)
        return r

    def linearise(
        self, t: float, q: Array, v: Array, a: Array, phase: int, c0: float, c1: float, c2: float
    ) -> tuple[Array, Solve]:
        """As the protocol has it; the factors live in one workspace, so an earlier `solve` is void."""
        r = np.empty(self._n_dof)
        ab, pivots, increment, coupled = self._work
        self._assemble(t, q, v, a, phase, r, ab, increment, True, c0, c1, c2)
        strength = c0 * kernels.coupling(self._cable)
        if not kernels.factorise_coupled(ab, pivots, increment, coupled, strength):
            return r, lambda b: np.full_like(b, math.nan)  # singular: the driver takes NaN for a stalled step

        def solve(b: Array) -> Array:
            kernels.solve_coupled(ab, pivots, increment, coupled, b)
            return b

        return r, solve

    def settle(
        self, t: float, phase: int, start: Array, now: Array, rule: Array, bound: float, newton: Newton
    ) -> Settled:
        self._time(t, phase)
        self._at = (t, phase)
        *done, least, where = kernels.settle(
            self._operators, self._coefficients, *self._mesh(), *self._work, start, now, rule, bound,
            newton.max_iter, newton.reuse, newton.patience,
        )  # fmt: skip
        self.least_tension = least, where
        return Settled(*done)

    # --- what a mesh answers ---------------------------------------------------------------------------
    def _fresh(self) -> None:
        """Make the workspaces, which a twin with another law must not share."""
        n = self.fields * self.n_scalar
        self._at = None
        increment = np.empty(n if self.fields == 1 else 0)
        self._work = np.empty((n, 3 * self._band + 1)), np.empty((2, n), dtype=np.int64), increment, increment.copy()
        self._bands = np.empty((3, *self._operators.shape[1:]))

    def _time(self, t: float, phase: int) -> None:
        """Set _coefficients of the _operators, _span and _contact (the arguments of `add_contact`) at this instant."""
        raise NotImplementedError

    def _tables(self, s_o: float, ds: float) -> tuple[Array, NDArray[np.int64], Array]:
        """Return span, dofs and tab of `kernels` with the mass at s_o."""
        raise NotImplementedError

    def _at_mass(self, states: States, kinematics: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Return w(s_o(t), t), its first and second time derivative, and w' behind and ahead, (n, fields) each."""
        raise NotImplementedError

    def _fields(self, states: States, kinematics: Array, s: Array, frames: NDArray[np.intp]) -> Array:
        """Return w, dw/dt at fixed s, and w' at frames x stations, (3, k, m, fields); at s = s_o the side behind."""
        raise NotImplementedError

    # --- the cable -------------------------------------------------------------------------------------
    def _set_law(self, law: str) -> None:
        if law not in ("elastic", "tension-only"):
            raise ValueError(f"law must be elastic or tension-only, got {law!r}")
        self.law = law
        g, flag = self.groups, float(law == "tension-only")
        if self.model == "full":
            self._cable = np.array([g.alpha, g.sigma, g.c, flag])
        else:
            tau = 1.0 / g.chord_cos
            self._cable = np.array([g.alpha, tau, g.sigma * g.chord_cos / tau, *STRETCHING[self.model], flag])

    def _mesh(self) -> tuple[Any, ...]:
        """Return what the kernels want to know of the instant before q, v, a."""
        return (self._bands, self._span, self._dofs, self._tab, self._cable, *self._contact)

    def _assemble(
        self, t: float, q: Array, v: Array, a: Array, phase: int, r: Array, ab: Array, increment: Array, tangent: bool,
        c0: float, c1: float, c2: float,
    ) -> None:  # fmt: skip
        """Set r and, if asked, the banded tangent and its increment; note the least tension."""
        if self._at != (t, phase):
            self._time(t, phase)
            self._at = (t, phase)
            kernels.combine(self._operators, self._coefficients, self._bands)
        self.least_tension = kernels.assemble(*self._mesh(), q, v, a, r, ab, increment, tangent, c0, c1, c2)

    def _static_acceleration(self, s_o: float, ds: float, dds: float) -> tuple[float, ...]:
        """Return d2/dt2 X(s_o(t)) on the static shape (parabola for the one-field models)."""
        if self.fields == 1:
            curvature = float(self._cable[2])
            return (dds * curvature * (0.5 - s_o) - ds * ds * curvature,)
        p = self.groups.c - self.groups.sigma * s_o
        T = math.sqrt(1.0 + p * p)
        bend = ds * ds * self.groups.sigma / T**3
        return dds / T + bend * p, dds * p / T - bend

    def _load(self, s_o: float, ds: float, dds: float) -> tuple[float, ...]:
        """Return mu d2X/dt2 less the weight: what the mass asks for along the static path."""
        mu, a, weight = self.inertia, self._static_acceleration(s_o, ds, dds), self._weight
        return (mu * a[0] - weight[0], mu * a[1] - weight[1]) if self.fields == 2 else (mu * a[0] - weight[0],)

    # --- observation -----------------------------------------------------------------------------------
    def observe(self, states: States, s: Array, frames: NDArray[np.intp]) -> Observation:
        """Measure paths, tensions, energies and fields on a history; see `Observation`."""
        g, n = self.groups, states.t.size
        kinematics = np.array([self.motion.at(t, p) for t, p in zip(states.t, states.phase, strict=True)]).reshape(n, 3)
        s_o, ds, dds = kinematics.T
        T, xp, yp, xpp, ypp = g.static(s_o)
        static, bend = np.stack([xp, yp], axis=1), np.stack([xpp, ypp], axis=1)
        at_mass = self._at_mass(states, kinematics)
        path, w_t, w_tt, behind, ahead = (x @ self.direction for x in at_mass)
        velocity = w_t + ds[:, None] * static
        acceleration = w_tt + dds[:, None] * static + (ds**2)[:, None] * bend
        slope_behind, slope_ahead = static + behind, static + ahead
        energy, least, where = np.empty(n), np.empty(n), np.full(n, 0.5)
        for i in range(n):
            tables = self._tables(s_o[i], ds[i])
            if self.fields == 2:
                energy[i], least[i], where[i] = kernels.cable_energy(*tables, self._cable, states.q[i], states.v[i])
            else:
                energy[i], least[i] = kernels.chord_energy(*tables, self._cable, states.q[i], states.v[i])
        if self.fields == 2:
            depth = path[:, 1] + g.shape(s_o)[1]
            energy += 0.5 * self.inertia * np.sum(velocity**2, axis=1) - g.mu * g.sigma * depth
            power = self._power(ds, acceleration, slope_behind, slope_ahead, T)
        else:
            normal_energy, power = self._normal_account(kinematics, *(x[:, 0] for x in at_mass))
            energy += normal_energy
        force = self.inertia * acceleration @ self.direction.T - np.array(self._weight)  # of the cable on the mass
        w, dw, w_s = (x @ self.direction for x in self._fields(states, kinematics, s, frames))
        T_s, x_s, y_s = g.static(s)[:3]
        if self.fields == 2:
            T_behind, T_ahead = self._tension(slope_behind, T), self._tension(slope_ahead, T)
            tension = self._tension(w_s + np.stack([x_s, y_s], axis=1), T_s)
        else:
            rise = least - self._cable[1]
            T_behind = T_ahead = T + rise
            tension = T_s + rise[frames, None]
        return Observation(
            path=path, path_velocity=velocity, path_acceleration=acceleration,
            slope_behind=slope_behind, slope_ahead=slope_ahead,
            T_behind=np.where(s_o > 0.0, T_behind, np.nan), T_ahead=np.where(s_o < 1.0, T_ahead, np.nan),
            energy=energy, power=power,
            tension_min=least, tension_min_at=where,
            u=w[..., 0], v=w[..., 1], du=dw[..., 0], dv=dw[..., 1], T=tension,
            t=states.t, s_o=s_o, contact=-force @ self.direction,
        )  # fmt: skip

    def _tension(self, slope: Array, T: Array) -> Array:
        N = T + self.groups.alpha * (np.hypot(slope[..., 0], slope[..., 1]) - 1.0)
        return np.maximum(N, 0.0) if self.law == "tension-only" else N

    def _power(self, ds: Array, acceleration: Array, behind: Array, ahead: Array, T: Array) -> Array:
        """Return dE/dt = ds_o F . <r'> + ds_o ( <N t> . [r'] - [W] ), F = mu (p.. - sigma j)."""
        force = self.inertia * acceleration - np.array([0.0, self.groups.mu * self.groups.sigma])
        mean, jump = 0.5 * (behind + ahead), ahead - behind
        pull, stored = [], []
        for slope in (behind, ahead):
            stretch = np.hypot(slope[:, 0], slope[:, 1])
            N, eps = self._tension(slope, T), stretch - 1.0
            pull.append((N / stretch)[:, None] * slope)
            W = T * eps + 0.5 * self.groups.alpha * eps**2
            stored.append(np.where(N > 0.0, W, -0.5 * T**2 / self.groups.alpha) if self.law == "tension-only" else W)
        kink = 0.5 * np.sum((pull[0] + pull[1]) * jump, axis=1) - (stored[1] - stored[0])
        return ds * (np.sum(force * mean, axis=1) + kink)

    def _normal_account(self, kinematics: Array, w: Array, w_t: Array, w_tt: Array, behind: Array, ahead: Array):
        """Return energy of the mass and power of the one-field models, p = y_n(s_o) + w on the static parabola.

        Their stored energy is quadratic in w' at a given tension, so <force> [w'] = [W] and only F <r'> is left.
        """
        s_o, ds, dds = kinematics.T
        curvature, weight = self._cable[2], self._weight[0]
        slope = curvature * (0.5 - s_o)
        p_t = w_t + ds * slope
        p_tt = w_tt + dds * slope - ds**2 * curvature
        energy = 0.5 * self.inertia * p_t**2 - weight * (w + 0.5 * curvature * s_o * (1.0 - s_o))
        return energy, ds * (self.inertia * p_tt - weight) * (slope + 0.5 * (behind + ahead))
