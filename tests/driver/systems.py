"""Small systems with known answers for the tests of the driver."""

import numpy as np

from cablefem.newmark import State, System, consistent_acceleration


class Spring(System):
    """m a + d v + k q + k3 q^3 = f sin(w t + phi), one or several independent degrees of freedom; optional phases."""

    force_floor = 1e-15

    def __init__(self, m=1.7, d=0.0, k=5.3, k3=0.0, f=0.0, w=2.1, q0=0.31, v0=-0.42, end=3.0, phases=None):
        self.m, self.d, self.k, self.k3, self.f, self.w = (
            np.atleast_1d(np.asarray(x, float)) for x in (m, d, k, k3, f, w)
        )
        self.q0, self.v0 = q0, v0
        self.phases = phases or ((0.0, end),)
        self.n_dof = self.k.size
        self.force_scale = float(self.k.max() * np.abs(q0).max() + 1e-3)
        self.seen: list[float] = []

    def applied_force(self, t, phase):
        return self.f * np.sin(self.w * t)

    def start(self, phase, state):
        if state is None:
            q, v = self.q0 + np.zeros(self.n_dof), self.v0 + np.zeros(self.n_dof)
            return consistent_acceleration(self, self.phases[0][0], q, v, 0)
        return consistent_acceleration(self, state.t, state.q, state.v, phase)

    def residual(self, t, q, v, a, phase):
        self.seen.append(t)
        return self.m * a + self.d * v + self.k * q + self.k3 * q**3 - self.applied_force(t, phase)

    def linearise(self, t, q, v, a, phase, c):
        c0, c1, c2 = c
        tangent = c2 * self.m + c1 * self.d + c0 * (self.k + 3.0 * self.k3 * q**2)
        return self.residual(t, q, v, a, phase), lambda r: r / tangent

    def energy(self, x: State):
        return float(np.sum(0.5 * self.m * x.v**2 + 0.5 * self.k * x.q**2 + 0.25 * self.k3 * x.q**4))


class Kicked(Spring):
    """A force that jumps at the phase boundary."""

    def applied_force(self, t, phase):
        return np.array([0.0 if phase == 0 else 4.1])


class Ball(Spring):
    """Falls under g and comes back from the ground at q = 0 with `restitution` times its speed."""

    events = ("ground",)

    def __init__(self, height=1.3, g=3.7, restitution=0.7, end=3.0):
        super().__init__(m=1.0, k=0.0, q0=height, v0=0.0, end=end)
        self.g, self.restitution = g, restitution

    def applied_force(self, t, phase):
        return np.array([-self.g])

    def event_values(self, x):
        return (x.q[0],)

    def apply_event(self, name, x):
        # armed again at once: the next contact may come within the same step
        return State(x.t, np.array([1e-300]), -self.restitution * x.v, np.array([-self.g]), x.phase)


class Rubbed(Spring):
    """Dry friction f: slips against it until it stands still, and sticks while the spring pulls with less."""

    events = ("standstill",)

    def __init__(self, friction=0.8, **kw):
        super().__init__(**kw)
        self.friction, self.sign = friction, -1.0  # pulled back from q0 > 0

    def applied_force(self, t, phase):
        return np.array([-self.friction * self.sign])

    def event_values(self, x):
        return (self.sign * x.v[0] if self.sign else np.inf,)

    def residual(self, t, q, v, a, phase):
        return super().residual(t, q, v, a, phase) if self.sign else self.m * a + 1e3 * v

    def linearise(self, t, q, v, a, phase, c):
        _, c1, c2 = c
        r, solve = super().linearise(t, q, v, a, phase, c)
        return (r, solve) if self.sign else (self.residual(t, q, v, a, phase), lambda b: b / (c2 * self.m + c1 * 1e3))

    def apply_event(self, name, x):
        pull = -self.k[0] * x.q[0]
        self.sign = np.sign(pull) if abs(pull) > self.friction else 0.0
        rest = State(x.t, x.q, 1e-300 * np.full(1, self.sign), np.zeros(1), x.phase)
        return consistent_acceleration(self, x.t, rest.q, rest.v, x.phase)


class Alarms(Spring):
    """Watches functions of t alone, and goes on as if nothing had been; the last event named "over" ends the run."""

    def __init__(self, end=1.0, **alarms):
        super().__init__(end=end)
        self.alarms, self.events = alarms, tuple(alarms)

    def event_values(self, x):
        return tuple(alarm(x.t) for alarm in self.alarms.values())

    def apply_event(self, name, x):
        return None if name == "over" else x


class DoublePendulum(Spring):
    """Two points of mass on two bars, angles from below: a mass matrix that depends on q."""

    def __init__(self, m=(1.7, 0.6), length=(0.9, 1.3), g=3.1, q0=(1.4, -0.7), v0=(0.5, 1.1), end=10.0):
        (m1, m2), (l1, l2) = m, length
        super().__init__(m=np.ones(2), k=np.ones(2), q0=np.array(q0), v0=np.array(v0), end=end)
        self.own, self.both = np.array([(m1 + m2) * l1 * l1, m2 * l2 * l2]), m2 * l1 * l2
        self.weight = g * np.array([(m1 + m2) * l1, m2 * l2])
        self.force_scale = float(self.weight.max())

    def mass(self, q):
        b = self.both * np.cos(q[0] - q[1])
        return np.array([[self.own[0], b], [b, self.own[1]]])

    def residual(self, t, q, v, a, phase):
        turning = self.both * np.sin(q[0] - q[1]) * np.array([v[1] ** 2, -(v[0] ** 2)])
        return self.mass(q) @ a + turning + self.weight * np.sin(q)

    def linearise(self, t, q, v, a, phase, c):
        c0, c1, c2 = c
        s, c, both = np.sin(q[0] - q[1]), np.cos(q[0] - q[1]), self.both
        by_difference = both * (c * np.array([v[1] ** 2, -(v[0] ** 2)]) - s * np.array([a[1], a[0]]))
        by_q = np.outer(by_difference, [1.0, -1.0]) + np.diag(self.weight * np.cos(q))
        by_v = 2.0 * both * s * np.array([[0.0, v[1]], [-v[0], 0.0]])
        K = c0 * by_q + c1 * by_v + c2 * self.mass(q)
        return self.residual(t, q, v, a, phase), lambda r: np.linalg.solve(K, r)

    def energy(self, x):
        return float(0.5 * x.v @ self.mass(x.q) @ x.v - self.weight @ np.cos(x.q))


class Follower(Spring):
    """m a + d v + k (q - x(t)) + k3 (q - x)^3 = m x'' + d x' with x = sin(w t): q = x(t) however stiff k is."""

    def __init__(self, **kw):
        super().__init__(**kw)
        self.force_scale, self.force_floor = self.k.max(), 1e-15 * self.k.max()

    def residual(self, t, q, v, a, phase):
        x, dx = np.sin(self.w * t), self.w * np.cos(self.w * t)
        return super().residual(t, q - x, v - dx, a + self.w**2 * x, phase)

    def linearise(self, t, q, v, a, phase, c):
        c0, c1, c2 = c
        tangent = c2 * self.m + c1 * self.d + c0 * (self.k + 3.0 * self.k3 * (q - np.sin(self.w * t)) ** 2)
        return self.residual(t, q, v, a, phase), lambda r: r / tangent


class Guided(Spring):
    """A point guided by a constraint on positions, q1 = sin(w t), beside a spring that pulls it: an index of three.

    Unknowns (q0, q1): m (a0) + k (q0 - q1) = 0 and q1 - sin(w t) = 0 with the reaction on q0 proportional to a1.
    """

    def __init__(self, **kw):
        super().__init__(m=np.array([1.7, 0.9]), k=np.array([5.3, 5.3]), q0=np.zeros(2), v0=np.zeros(2), **kw)
        self.force_scale = 5.3

    def start(self, phase, state):
        w = self.w[0]
        q, v = np.zeros(2), np.array([0.3, w])
        return State(0.0, q, v, np.array([0.0, 0.0]), 0)

    def residual(self, t, q, v, a, phase):
        return np.array([1.7 * a[0] + 0.4 * a[1] + 5.3 * (q[0] - q[1]), q[1] - np.sin(self.w[0] * t)])

    def linearise(self, t, q, v, a, phase, c):
        c0, _, c2 = c
        K = np.array([[1.7 * c2 + 5.3 * c0, 0.4 * c2 - 5.3 * c0], [0.0, c0]])
        r = self.residual(t, q, v, a, phase)
        return r, lambda b: np.linalg.solve(K, b) if c0 else np.full_like(b, np.nan)
