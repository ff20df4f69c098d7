"""Small systems with known answers for the tests of the driver."""

from __future__ import annotations

import numpy as np

from cablefem.newmark import State, consistent_acceleration, iterate


class Spring:
    """m a + d v + k q + k3 q^3 = f sin(w t + phi), one or several independent degrees of freedom; optional phases."""

    force_floor = 1e-15

    def __init__(self, m=1.7, d=0.0, k=5.3, k3=0.0, f=0.0, w=2.1, q0=0.31, v0=-0.42, end=3.0, phases=None):
        self.m, self.d, self.k, self.k3, self.f, self.w = (
            np.atleast_1d(np.asarray(x, float)) for x in (m, d, k, k3, f, w)
        )
        self.q0, self.v0 = q0, v0
        self.phases = phases or ((0.0, end),)
        self.n_dof = self.k.size
        self.force_scale = float(self.k.max() * abs(q0) + 1e-3)
        self.seen: list[float] = []

    def push(self, t, phase):
        return self.f * np.sin(self.w * t)

    def start(self, phase, state):
        if state is None:
            q, v = np.full(self.n_dof, self.q0), np.full(self.n_dof, self.v0)
            return consistent_acceleration(self, self.phases[0][0], q, v, 0)
        return consistent_acceleration(self, state.t, state.q, state.v, phase)

    def residual(self, t, q, v, a, phase):
        self.seen.append(t)
        return self.m * a + self.d * v + self.k * q + self.k3 * q**3 - self.push(t, phase)

    def linearise(self, t, q, v, a, phase, c0, c1, c2):
        tangent = c2 * self.m + c1 * self.d + c0 * (self.k + 3.0 * self.k3 * q**2)
        return self.residual(t, q, v, a, phase), lambda r: r / tangent

    def settle(self, *step):
        return iterate(self, *step)

    def energy(self, x: State):
        return float(np.sum(0.5 * self.m * x.v**2 + 0.5 * self.k * x.q**2 + 0.25 * self.k3 * x.q**4))
