"""The one time loop of both solvers: Newmark's family, Newton's method, and nothing of the physics.

A discretised cable is a second-order system r(t, q, v, a) = M a + C v + K q + R(q) - F = 0.  The loop
advances it with Newmark's formulas

    q1 = q0 + dt v0 + dt^2 [ (1/2 - beta) a0 + beta a1 ],    v1 = v0 + dt [ (1 - gamma) a0 + gamma a1 ]

and asks the system only for residuals and for solutions with the tangent; matrix formats stay with the
system.  Time and all quantities are the system's own (dimensionless in this package).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Solve = Callable[[Array], Array]


class State(NamedTuple):
    """One instant of a discretised system; `phase` is the interval between events it belongs to."""

    t: float
    q: Array  # (n_dof,) generalised displacements
    v: Array  # (n_dof,) dq/dt
    a: Array  # (n_dof,) d2q/dt2
    phase: int = 0


class System(Protocol):
    """A second-order system r(t, q, dq/dt, d2q/dt2) = 0, left after discretising the cable in s.

    `phases` are consecutive time intervals within which everything is smooth; steps land on their ends,
    and every call names its phase, because at an end the acceleration of the mass has two values.
    """

    @property
    def tension_min(self) -> tuple[float, float]:
        """Least tension at the last residual and its s; watched, not used, by the loop.

        Where it is negative it is the least MEAN over what the method resolves (an element, a shortest wavelength):
        ripples have none, a slack cable has.
        """

    @property
    def n_dof(self) -> int: ...
    @property
    def phases(self) -> tuple[tuple[float, float], ...]: ...
    @property
    def force_scale(self) -> float:
        """Size of the loads: Newton has converged when |r| <= newton.tol * force_scale + sqrt(n_dof) * force_floor."""

    @property
    def force_floor(self) -> float:
        """Rounding error of a component of r, below which Newton's method cannot get."""

    def start(self, phase: int, state: State | None) -> State:
        """Return a consistent state at the beginning of `phase` (state=None: entry, at rest)."""

    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        """Return r, shape (n_dof,)."""

    def linearise(
        self, t: float, q: Array, v: Array, a: Array, phase: int, c0: float, c1: float, c2: float
    ) -> tuple[Array, Solve]:
        """Return r and a function that applies (c0 dr/dq + c1 dr/dv + c2 dr/da)^-1; it may overwrite its argument."""

    def settle(
        self, t: float, phase: int, start: Array, now: Array, rule: Array, bound: float, newton: Newton
    ) -> Settled:
        """Find the end of a step by Newton's method; `iterate` does it for any system, compiled code can do it faster.

        start, now : (3, n_dof) rows q, v, a at the beginning, and at the end, which is set.
        rule : (3, 5) columns P (3, 3), c and w of a step of the Newmark family: now = P start - c da with da such that
            |r(t, w now + (1 - w) start)| <= bound; w works on rows.
        """


class StepFailure(RuntimeError):
    """A step could not be taken; `t` [system's time], `cause`, and what to try."""

    def __init__(self, t: float, cause: str, advice: str) -> None:
        super().__init__(f"{cause} at t = {t:.6g}; {advice}")
        self.t, self.cause, self.advice = t, cause, advice


class NewtonStalled(StepFailure):
    """Newton's method found no equilibrium of the step."""


class StepUnderflow(StepFailure):
    """The error control asked for a step that rounding no longer resolves."""


@dataclass(frozen=True, slots=True)
class Scheme:
    """A member of the Newmark family; the balance may be taken inside the step.

    newmark_beta, newmark_gamma : Newmark (1959).
    alpha_m, alpha_f : the balance uses a at 1 - alpha_m and t, q, v at 1 - alpha_f of the step (Chung & Hulbert 1993).
    average : the balance is averaged over the step along the straight line from q0 to q1 (average vector
        field: Quispel & McLaren 2008; Gauss points tau, weights w), which keeps the energy of a conservative system.
    """

    name: str
    newmark_beta: float = 0.25
    newmark_gamma: float = 0.5
    alpha_m: float = 0.0
    alpha_f: float = 0.0
    average: bool = False

    def __post_init__(self) -> None:
        if not (0.0 <= self.newmark_beta <= 2.0 and math.isfinite(self.newmark_beta)):
            raise ValueError(f"newmark_beta must lie in [0, 2], got {self.newmark_beta!r}")
        if not (0.0 <= self.newmark_gamma <= 2.0 and math.isfinite(self.newmark_gamma)):
            raise ValueError(f"newmark_gamma must lie in [0, 2], got {self.newmark_gamma!r}")


def scheme(name: str, *, newmark_gamma: float = 0.6, rho_inf: float = 0.9) -> Scheme:
    """Return a scheme by name.

    trapezoidal        beta 1/4, gamma 1/2: second order, no dissipation; unconditionally stable for LINEAR systems only
    newmark            gamma (default 0.6), beta = (gamma + 1/2)^2 / 4: first order, damps what it cannot resolve
    generalized-alpha  Chung & Hulbert (1993), second order, spectral radius rho_inf at infinite frequency
    energy             average vector field: second order, keeps the energy of a conservative system
    central-difference beta 0, gamma 1/2: conditionally stable, dt < 2/omega_max; here as a specimen that fails
    """
    if name == "trapezoidal":
        return Scheme(name)
    if name == "newmark":
        if not 0.5 <= newmark_gamma <= 1.5:
            raise ValueError(f"newmark_gamma must lie in [0.5, 1.5], got {newmark_gamma!r}")
        return Scheme(name, 0.25 * (newmark_gamma + 0.5) ** 2, newmark_gamma)
    if name == "generalized-alpha":
        if not 0.0 <= rho_inf <= 1.0:
            raise ValueError(f"rho_inf must lie in [0, 1], got {rho_inf!r}")
        alpha_m, alpha_f = (2.0 * rho_inf - 1.0) / (rho_inf + 1.0), rho_inf / (rho_inf + 1.0)
        return Scheme(name, 0.25 * (1.0 - alpha_m + alpha_f) ** 2, 0.5 - alpha_m + alpha_f, alpha_m, alpha_f)
    if name == "energy":
        return Scheme(name, average=True)
    if name == "central-difference":
        return Scheme(name, 0.0, 0.5)
    raise ValueError(f"unknown scheme {name!r}; one of {', '.join(SCHEMES)}")


SCHEMES = ("trapezoidal", "newmark", "generalized-alpha", "energy", "central-difference")


@dataclass(slots=True)
class Work:
    """Countable work of a run."""

    steps: int = 0
    rejected: int = 0
    newton_iterations: int = 0
    factorisations: int = 0
    residuals: int = 0


@dataclass(frozen=True, slots=True)
class Newton:
    """Newton's method on a step: |r| <= tol * system.force_scale + sqrt(n_dof) * system.force_floor, Euclidean norm.

    The tangent is kept while an iteration cuts the residual by `reuse` or more.  From the third iteration on a
    correction that does not lower the residual is halved, up to five times: a slack cable's tangent jumps.
    """

    tol: float = 1e-4
    max_iter: int = 25
    reuse: float = 0.1


class Settled(NamedTuple):
    """How Newton's method ended: the last |r|, converged if at most the bound, and the work it took."""

    norm: float
    iterations: int
    factorisations: int
    residuals: int


@dataclass(frozen=True, slots=True)
class ErrorControl:
    """Step sizes from the local error of Newmark's formula, |beta - 1/6| dt^2 |a1 - a0| (Zienkiewicz & Xie 1991).

    A step is accepted when the largest component of that vector is at most `tol` (in the units of q).
    """

    tol: float
    dt_first: float
    dt_max: float = math.inf
    dt_min: float = 0.0


def step_times(
    system: System, steps: int, *, entry: float = 1.0, exit: float = 1.0, growth: float = 1.15
) -> list[Array]:
    """Return per phase the instants to step on: about `steps` equal steps, whole ones in each phase.

    The last instant, where the mass sits on the far support, is left out: the boundary condition would answer there.

    entry, exit : first and last step as fractions of the uniform one; from there steps grow by `growth` each, up to
        the uniform step.  The ramps come on top of `steps`.
    """
    if steps < 2:
        raise ValueError(f"steps must be at least 2, got {steps!r}")
    for name, value in (("entry", entry), ("exit", exit)):
        if not 0.0 < value <= 1.0:
            raise ValueError(f"{name} must lie in (0, 1], got {value!r}")
    phases = system.phases
    dt = (phases[-1][1] - phases[0][0]) / steps
    grids = []
    for i, (t0, t1) in enumerate(phases):
        ramps = []
        for ramped, fraction in ((i == 0, entry), (i == len(phases) - 1, exit)):
            count = math.ceil(-math.log(fraction) / math.log(growth)) if ramped else 0
            ramps.append(np.minimum(dt, fraction * dt * growth ** np.arange(count)))
        length = sum(float(r.sum()) for r in ramps)
        inner = max(2, round((t1 - t0 - length) / dt)) if length < t1 - t0 else 2
        lengths = np.concatenate([ramps[0], np.full(inner, max((t1 - t0 - length) / inner, dt)), ramps[1][::-1]])
        grid = np.concatenate([[0.0], np.cumsum(lengths)])
        grid = t0 + (t1 - t0) * (grid / grid[-1])
        grid[-1] = t1
        grids.append(grid)
    grids[-1] = grids[-1][:-1]
    return grids


def consistent_acceleration(system: System, t: float, q: Array, v: Array, phase: int) -> State:
    """Solve r(t, q, v, a) = 0 for a: r is linear in a, one solve does it."""
    zero = np.zeros(system.n_dof)
    r, solve = system.linearise(t, q, v, zero, phase, 0.0, 0.0, 1.0)
    return State(t, q, v, -solve(r.copy()), phase)


def integrate(
    system: System,
    method: Scheme,
    times: Sequence[Array] | ErrorControl,
    *,
    newton: Newton = Newton(),
    work: Work | None = None,
    start: State | None = None,
) -> Iterator[State]:
    """Yield the states of a run, the first one included.

    times : per phase the instants to step on, first and last phase end included (`step_times`), or an
        `ErrorControl`, which finds them.
    start : go on from this state, inside its phase (a change of cable law, say), instead of from entry.

    Raises NewtonStalled or StepUnderflow; what was yielded before stays valid.  NaN never counts as converged.
    """
    work = Work() if work is None else work
    state = start
    first = 0 if start is None else start.phase
    for phase in range(first, len(system.phases)):
        if start is None or phase > first:
            entry = system.start(phase, state)
            if state is None:
                yield entry
            state = entry
        assert state is not None
        if isinstance(times, ErrorControl):
            last = phase == len(system.phases) - 1
            advance = _controlled(system, method, times, state, system.phases[phase][1], last, newton, work)
        else:
            grid = times[phase]
            advance = _prescribed(system, method, grid[grid > state.t], state, newton, work)
        for state in advance:
            yield state


def _prescribed(system: System, method: Scheme, grid: Array, state: State, newton: Newton, work: Work):
    stepper = _Stepper(system, method, newton, work)
    for t in grid.tolist():
        t0, halvings = state.t, 0
        while state.t < t:
            piece = (t - t0) * 0.5**halvings
            t1 = state.t + piece if state.t + 1.001 * piece < t else t
            try:
                state = stepper(state, t1)
                work.steps += 1
            except NewtonStalled:
                # a step may be too long for Newton's method (a cable that falls slack): take it in pieces
                work.rejected += 1
                halvings += 1
                if halvings > MOST_HALVINGS or work.rejected > MOST_CUTS + grid.size // 2:
                    raise
                stepper.forget()
        yield state


def _controlled(
    system: System, method: Scheme, control: ErrorControl, state: State, t_end: float, last: bool, newton: Newton,
    work: Work,
):  # fmt: skip
    stepper = _Stepper(system, method, newton, work)
    # |beta - 1/6| vanishes for Fox-Goodwin only; the energy rule has the local error of the trapezoidal one.
    constant = max(abs(method.newmark_beta - 1.0 / 6.0), 1.0 / 24.0)
    span = t_end - state.t
    dt = min(control.dt_first, control.dt_max, span)
    # On the far support itself the right part of a following mesh has no length: stop one rounding-safe step short.
    stop = t_end - (max(1e-6 * span, control.dt_min) if last else 0.0)
    while state.t < stop - 1e-12 * span:
        dt = min(dt, control.dt_max)
        remaining = stop - state.t
        if dt >= remaining * (1.0 - 1e-12):
            dt, t1 = remaining, stop
        else:
            if dt > 0.5 * remaining:
                dt = 0.5 * remaining  # two like steps instead of a long and a tiny one
            t1 = state.t + dt
        try:
            trial = stepper(state, t1)
            error = constant * dt * dt * float(np.max(np.abs(trial.a - state.a)))
        except NewtonStalled:
            error = math.inf
        if error <= control.tol:
            state = trial
            work.steps += 1
            yield state
        else:
            work.rejected += 1
            stepper.forget()
        factor = 0.9 * (control.tol / error) ** (1.0 / 3.0) if error > 0.0 else 2.0
        dt *= min(2.0, max(0.2, factor))
        if dt < max(control.dt_min, 1e-13 * span):
            raise StepUnderflow(state.t, f"step {dt:.2g} is too small", "loosen the tolerance or use a damped scheme")


MOST_HALVINGS = 6  # 1/64 of a step: where that does not converge the equations themselves have lost their solution
MOST_CUTS = 100  # and half the steps: a run that has to cut more steps than that creeps

# Gauss-Legendre points of the average over a step: the strain energy is not polynomial in q, four points
# leave a quadrature error far below rounding for slopes that change by a few percent per step.
_TAU, _WEIGHT = np.polynomial.legendre.leggauss(4)
_TAU, _WEIGHT = 0.5 * (_TAU + 1.0), 0.5 * _WEIGHT


def iterate(
    system: System, t: float, phase: int, start: Array, now: Array, rule: Array, bound: float, newton: Newton
) -> Settled:
    """Find the end of a step with the residuals and tangents of a system, as `System.settle` has it."""
    c, w = rule[:, 3:4], rule[:, 4:5]
    linear = (w * c)[:, 0].tolist()
    rest = (1.0 - w) * start
    now[:] = rule[:, :3] @ start
    q, v, a = balanced = np.empty_like(now)
    correction = np.empty_like(now)

    def residual() -> Array:
        np.add(np.multiply(w, now, out=balanced), rest, out=balanced)
        return system.residual(t, q, v, a, phase)

    def linearise() -> tuple[Array, Solve]:
        np.add(np.multiply(w, now, out=balanced), rest, out=balanced)
        return system.linearise(t, q, v, a, phase, *linear)

    def update(da: Array) -> None:
        np.subtract(now, np.multiply(c, da, out=correction), out=now)

    with np.errstate(over="ignore", invalid="ignore"):  # a diverging iteration is caught by its norm
        return _newton(residual, linearise, update, bound, newton)


def _newton(residual, linearise, update, bound: float, newton: Newton) -> Settled:
    norm, factorisations, residuals, anew = math.inf, 0, 0, True
    for iteration in range(newton.max_iter):
        if anew:
            r, solve = linearise()
            norm = math.sqrt(r.dot(r))
            factorisations += 1
        before, correction = norm, solve(r)
        update(correction)
        for halving in range(6):
            if halving:
                correction *= 0.5
                update(-correction)
            r = residual()
            residuals += 1
            norm = math.sqrt(r.dot(r))
            if norm < before or iteration < 2:
                break
        if norm <= bound or not norm < math.inf:
            break
        anew = norm > newton.reuse * before
    return Settled(norm, iteration + 1, factorisations, residuals)


class _Stepper:
    """One step of one scheme; remembers only what the next step's first guess needs."""

    def __init__(self, system: System, method: Scheme, newton: Newton, work: Work) -> None:
        self.system, self.method, self.newton, self.work = system, method, newton, work
        self._a_mid: Array | None = None
        self._bound = newton.tol * system.force_scale + math.sqrt(system.n_dof) * system.force_floor
        m = method
        self._rule = np.eye(3, 5)  # as `System.settle` has it
        self._rule[:, 3:] = [[0.0, 1.0 - m.alpha_f], [0.0, 1.0 - m.alpha_f], [1.0, 1.0 - m.alpha_m]]
        self._last: tuple[State | None, Array] = None, np.empty((3, system.n_dof))  # a state, and its rows in one array

    def forget(self) -> None:
        self._a_mid = None

    def __call__(self, x: State, t1: float) -> State:
        return self._averaged(x, t1) if self.method.average else self._newmark(x, t1)

    def _newmark(self, x: State, t1: float) -> State:
        m, dt, rule = self.method, t1 - x.t, self._rule
        t = t1 if m.alpha_f == 0.0 else x.t + (1.0 - m.alpha_f) * dt  # of the balance
        c0, c1 = m.newmark_beta * dt * dt, m.newmark_gamma * dt
        start = self._last[1] if self._last[0] is x else np.array([x.q, x.v, x.a])
        now = np.empty_like(start)
        rule[0, 1], rule[0, 3], rule[1, 3] = dt, c0, c1
        # first guess: the acceleration goes on as it was; where unresolved waves make that absurd: it vanishes
        for goes_on in (1.0, 0.0):
            rule[0, 2], rule[1, 2], rule[2, 2] = 0.5 * dt * dt - c0 + goes_on * c0, dt - c1 + goes_on * c1, goes_on
            done = self.system.settle(t, x.phase, start, now, rule, self._bound, self.newton)
            if self._settled(done):
                after = State(t1, now[0], now[1], now[2], x.phase)
                self._last = after, now
                return after
        raise self._stalled(t1, done)

    def _settled(self, done: Settled) -> bool:
        work = self.work
        work.newton_iterations += done.iterations
        work.factorisations += done.factorisations
        work.residuals += done.residuals
        return done.norm <= self._bound

    def _stalled(self, t1: float, done: Settled) -> NewtonStalled:
        return NewtonStalled(
            t1, f"Newton's method stalled (|r| = {done.norm:.2g}, allowed {self._bound:.2g})",
            "take more steps, a damped scheme (newmark, generalized-alpha), or the tension-only law for a slack cable",
        )  # fmt: skip

    def _averaged(self, x: State, t1: float) -> State:
        dt = t1 - x.t
        t_mid = x.t + 0.5 * dt
        a = x.a.copy() if self._a_mid is None else self._a_mid.copy()

        def mid() -> tuple[Array, Array]:
            return x.q + (0.5 * dt) * x.v + (0.25 * dt * dt) * a, x.v + (0.5 * dt) * a

        def residual() -> Array:
            v = mid()[1]
            r = np.zeros_like(a)
            for tau, weight in zip(_TAU, _WEIGHT, strict=True):
                r += weight * self.system.residual(x.t + tau * dt, x.q + tau * dt * v, v, a, x.phase)
            return r

        def linearise() -> tuple[Array, Solve]:
            q, v = mid()
            _, solve = self.system.linearise(t_mid, q, v, a, x.phase, 0.25 * dt * dt, 0.5 * dt, 1.0)
            return residual(), solve

        def update(da: Array) -> None:
            nonlocal a
            a = a - da

        with np.errstate(over="ignore", invalid="ignore"):
            done = _newton(residual, linearise, update, self._bound, self.newton)
        if not self._settled(done):
            raise self._stalled(t1, done)
        previous, self._a_mid = self._a_mid, a
        # the scheme knows the acceleration of the middle of the step; carry it to the end with second order
        a1 = a if previous is None else 1.5 * a - 0.5 * previous
        return State(t1, x.q + dt * x.v + (0.5 * dt * dt) * a, x.v + dt * a, a1, x.phase)
