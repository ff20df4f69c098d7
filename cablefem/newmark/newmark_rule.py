"""A step of Newmark's family, generalised-alpha included."""

import numpy as np

from cablefem.newmark.newton import Newton, Settled, find_root
from cablefem.newmark.schemes import Scheme
from cablefem.newmark.stepper import Stepper, Work
from cablefem.newmark.system import Array, Solve, State, System, Travelling


class NewmarkRule(Stepper):
    """q1 = q0 + dt v0 + dt^2 [ (1/2 - beta) a0 + beta a1 ],  v1 = v0 + dt [ (1 - gamma) a0 + gamma a1 ],  r = 0."""

    def __init__(self, system: System, method: Scheme, newton: Newton, work: Work) -> None:
        super().__init__(system, method, newton, work)
        self._travels = system if isinstance(system, Travelling) else None
        self._rule = np.eye(3, 5)  # as `System.settle` has it
        self._predictor, self._corrector, balance = self._rule[:, :3], self._rule[:, 3], self._rule[:, 4]
        balance[0] = 1.0 - method.alpha_f
        balance[1] = 1.0 - method.alpha_f
        balance[2] = 1.0 - method.alpha_m

    def __call__(self, x: State, t1: float) -> State:
        dt, beta, gamma = t1 - x.t, self.method.newmark_beta, self.method.newmark_gamma
        t = t1  # of the balance
        if self.method.alpha_f != 0.0:
            w = 1.0 - self.method.alpha_f
            t = x.t + w * dt if self._travels is None else self._travels.between(x.t, t1, w, x.phase)
        rows = self.remembered(x)
        start = np.array([x.q, x.v, x.a]) if rows is None else rows
        now = np.empty_like(start)
        # first guess: the acceleration goes on as it was; where unresolved waves make that absurd: it vanishes
        for goes_on in (1.0, 0.0):
            self._predictor[0, 1:] = dt, dt * dt * (0.5 - beta + goes_on * beta)
            self._predictor[1, 2] = dt * (1.0 - gamma + goes_on * gamma)
            self._predictor[2, 2] = goes_on
            self._corrector[0] = dt * dt * beta
            self._corrector[1] = dt * gamma
            self._corrector[2] = 1.0
            done = self.system.settle(t, x.phase, start, now, self._rule, self.bound, self.newton)
            if self.balanced(done):
                after = State(t1, now[0], now[1], now[2], x.phase)
                self.remember(after, now)
                return after
        raise self.stalled(t1, done)


def iterate(
    system: System, t: float, phase: int, start: Array, now: Array, rule: Array, bound: float, newton: Newton
) -> Settled:
    """Find the end of a step with the residuals and tangents of a system, as `System.settle` has it."""
    predictor, c, w = rule[:, :3], rule[:, 3:4], rule[:, 4:5]
    linear = (w * c)[:, 0].tolist()
    rest = (1.0 - w) * start
    now[:] = predictor @ start
    q, v, a = at = np.empty_like(now)
    correction = np.empty_like(now)

    def residual() -> Array:
        np.add(np.multiply(w, now, out=at), rest, out=at)
        return system.residual(t, q, v, a, phase)

    def linearise() -> tuple[Array, Solve]:
        np.add(np.multiply(w, now, out=at), rest, out=at)
        return system.linearise(t, q, v, a, phase, *linear)

    def update(da: Array) -> None:
        np.subtract(now, np.multiply(c, da, out=correction), out=now)

    with np.errstate(over="ignore", invalid="ignore"):  # a diverging iteration is caught by its norm
        return find_root(residual, linearise, update, bound, newton)
