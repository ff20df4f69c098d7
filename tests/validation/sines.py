"""A whole method in one file: sines, and the mass by the chain rule.

It shows what the method table asks for.  `validation.core.methods.METHODS["my-sines"] = METHOD` makes it known.
"""

import copy
from pathlib import Path

import numpy as np

from cablefem.newmark import System, consistent_acceleration
from cablefem.response import Observation
from validation.core.methods import TIME, Method, Resolution, Setting


class Sines(System):
    """The cable in sines, its mass by the chain rule; the full model, and a string of constant tension."""

    def __init__(self, groups, waves, *, model, load, law):
        if model not in ("full", "string"):
            raise ValueError(f"model must be full or string, got {model!r}")
        self.groups, self.full, self.law = groups, model == "full", law
        self.inertia = groups.mu if load == "mass" else 0.0
        self.k = np.pi * np.arange(1, waves + 1)
        self.n_dof, self.phases = 2 * waves, groups.motion.phases
        self.force_scale, self.force_floor = groups.mu * groups.sigma, 1e-15 * groups.alpha
        x, w = np.polynomial.legendre.leggauss(3 * waves)
        self.s, self.w, self.slopes = 0.5 * (x + 1.0), 0.5 * w, self.shapes(0.5 * (x + 1.0))[1]

    def shapes(self, s):
        sin, cos = np.sin(np.outer(s, self.k)), np.cos(np.outer(s, self.k))
        return sin, self.k * cos, -(self.k**2) * sin

    def static(self, s):
        """T, X' and X'' of the cable at rest."""
        if not self.full:
            y1, y2 = self.groups.sigma * (0.5 - s), -self.groups.sigma + 0.0 * s
            return 1.0 + 0.0 * s, np.stack([1.0 + 0.0 * s, y1], -1), np.stack([0.0 * s, y2], -1)
        T, x1, y1, x2, y2 = self.groups.tension_and_shape_derivatives(s)
        return T, np.stack([x1, y1], -1), np.stack([x2, y2], -1)

    def stress(self, s, w1):
        """Tension, force over that at rest, its derivative by w', and the stored energy; w' (m, 2) at s (m,)."""
        T, X1, _ = self.static(s)
        if not self.full:
            return T, T[:, None] * w1, T[:, None, None] * np.eye(2), 0.5 * T * np.sum(w1**2, 1)
        r = X1 + w1
        stretch = np.hypot(r[:, 0], r[:, 1])
        t, strain = r / stretch[:, None], stretch - 1.0
        N, alpha = T + self.groups.alpha * strain, self.groups.alpha + 0.0 * T
        W = T * strain + 0.5 * alpha * strain**2
        if self.law == "tension-only":
            W, alpha, N = np.where(N > 0.0, W, -0.5 * T**2 / alpha), np.where(N > 0.0, alpha, 0.0), np.maximum(N, 0.0)
        across = (N / stretch)[:, None, None] * np.eye(2)
        along = (alpha - N / stretch)[:, None, None] * t[:, :, None] * t[:, None, :]
        return N, N[:, None] * t - T[:, None] * X1, across + along, W

    def linearise(self, t, q, v, a, phase, c):
        c0, c1, c2 = c
        s_o, ds, dds = self.groups.motion.position_with_rates(t, phase)
        Q, V, A = (x.reshape(-1, 2) for x in (q, v, a))
        f, f1, f2 = (x[0] for x in self.shapes(s_o))
        _, X1, X2 = self.static(np.array([s_o]))
        N, force, stiffness, _ = self.stress(self.s, self.slopes @ Q)
        self.min_tension_and_position = float(self.w @ N), 0.5  # the mean over the cable: sines resolve no slack piece
        rate = dds * f1 + ds**2 * f2
        pull = self.inertia * (f @ A + 2.0 * ds * f1 @ V + rate @ Q + dds * X1[0] + ds**2 * X2[0])
        pull[1] -= self.groups.mu * self.groups.sigma
        R = 0.5 * A + self.slopes.T @ (self.w[:, None] * force) + np.outer(f, pull)
        K = c0 * np.einsum("m,mi,mfg,mj->ifjg", self.w, self.slopes, stiffness, self.slopes, optimize=True)
        M = 0.5 * c2 * np.eye(f.size) + self.inertia * np.outer(f, c2 * f + 2.0 * c1 * ds * f1 + c0 * rate)
        K = K.reshape(q.size, q.size) + np.kron(M, np.eye(2))
        return R.ravel(), lambda b: np.linalg.solve(K, b)

    def residual(self, t, q, v, a, phase):
        return self.linearise(t, q, v, a, phase, (0.0, 0.0, 1.0))[0]

    def start(self, phase, x):
        q, v = np.zeros((2, self.n_dof)) if x is None else (x.q, x.v)
        return consistent_acceleration(self, self.phases[phase][0], q, v, phase)

    def with_law(self, law):
        other = copy.copy(self)
        other.law = law
        return other

    def position(self, x):
        return self.groups.motion.position_with_rates(x.t, x.phase)[0]

    def states_over_time(self, states):
        return states

    def mass_positions_and_displacements(self, states):
        seen = self.observe(states, np.zeros(0), np.zeros(0, int))
        return seen.s_o, seen.path

    def observe(self, states, s, frames):
        n, (mu, sigma) = states.t.size, (self.groups.mu, self.groups.sigma)
        motion = [self.groups.motion.position_with_rates(t, k) for t, k in zip(states.t, states.phase, strict=True)]
        s_o, ds, dds = np.array(motion).reshape(n, 3).T
        Q, V, A = (x.reshape(n, -1, 2) for x in (states.q, states.v, states.a))

        def at_mass(shape, x):
            return np.einsum("tk,tkf->tf", shape, x)

        f, f1, f2 = self.shapes(s_o)
        _, X1, X2 = self.static(s_o)
        slope, c, d = X1 + at_mass(f1, Q), ds[:, None], dds[:, None]
        path, velocity = at_mass(f, Q), at_mass(f, V) + c * slope
        acceleration = at_mass(f, A) + 2.0 * c * at_mass(f1, V) + at_mass(d * f1 + c**2 * f2, Q) + d * X1 + c**2 * X2
        drive = self.inertia * acceleration - [0.0, mu * sigma]
        seen = [self.stress(self.s, self.slopes @ x) for x in Q]
        energy = 0.25 * np.sum(V**2, (1, 2)) + 0.5 * self.inertia * np.sum(velocity**2, 1)
        energy += [self.w @ W for *_, W in seen] - mu * sigma * (path[:, 1] + self.groups.coordinates(s_o)[1])
        if self.full:  # the weight of the cable
            energy -= sigma * Q[:, :, 1] @ ((1.0 - np.cos(self.k)) / self.k)
        least = np.array([N.min() for N, *_ in seen]).reshape(n)
        T = self.stress(s_o, at_mass(f1, Q))[0]
        g, g1, _ = self.shapes(s)
        u, du = (np.einsum("mk,tkf->ftm", g, x[frames]) for x in (Q, V))
        field = np.array([self.stress(s, g1 @ x)[0] for x in Q[frames]]).reshape(frames.size, s.size)
        return Observation(
            t=states.t, s_o=s_o, path=path, path_velocity=velocity, path_acceleration=acceleration, slope_behind=slope,
            slope_ahead=slope, T_behind=T, T_ahead=T, energy=energy, power=ds * np.sum(drive * slope, 1),
            tension_min=least, tension_min_at=0.5 + 0.0 * least, u=u[0], v=u[1], du=du[0], dv=du[1], T=field,
        )  # fmt: skip


METHOD = Method(
    "my-sines",
    "mine",
    "one line for the list",
    {"waves": Setting(20, (1, 500), "sines"), **TIME},
    Resolution("waves", max_value=160, break_even=25, cost_exponent=2.5),
    1.0,  # order of the path
    lambda groups, x, **kind: Sines(groups, x["waves"], **kind),
    (6, 300),  # where its ladders begin
    atlas_settings=(20, 600),
)


def without_coriolis():
    """The same method with the classical slip: 2 mu ds phi phi' forgotten."""
    text, twin = Path(__file__).read_text(), {"__name__": "twin"}
    exec(compile(text.replace("2.0 * ds * f1 @ V", "0.0 * ds * f1 @ V"), "twin", "exec"), twin)
    return twin["METHOD"]
