"""A whole method in one file: sines, and the mass by the chain rule.

It shows what the method table asks for.  `validation.core.methods.METHODS["my-sines"] = METHOD` makes it known.
"""

import copy
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cablefem.newmark import System, consistent_acceleration
from cablefem.response import Observation
from validation.core.methods import TIME, Method, Resolution, Setting


class Stress(NamedTuple):
    """The cable strained by w' at m points."""

    N: np.ndarray  # tension (m,)
    force: np.ndarray  # over that at rest (m, 2)
    stiffness: np.ndarray  # derivative of the force by w' (m, 2, 2)
    energy: np.ndarray  # stored per length (m,)


class Sines(System):
    """The cable in sines, its mass by the chain rule; the full model, and a string of constant tension."""

    def __init__(self, groups, waves, *, model, load, law):
        if groups.drive.mode != "grip":  # an equation of the car, or of the haul rope, is missing
            raise ValueError(f"my-sines: drive.mode = {groups.drive.mode!r}: the car must grip the cable")
        if model not in ("full", "string"):
            raise ValueError(f"model must be full or string, got {model!r}")
        self.groups = groups
        self.full = model == "full"
        self.law = law
        self.weight = [0.0, groups.mu * groups.sigma]  # of the mass
        self.inertia = groups.mu if load == "mass" else 0.0
        self.k = np.pi * np.arange(1, waves + 1)
        self.n_dof = 2 * waves
        self.phases = groups.motion.phases
        self.force_scale = groups.mu * groups.sigma
        self.force_floor = 1e-15 * groups.alpha
        x, w = np.polynomial.legendre.leggauss(3 * waves)
        self.s = 0.5 * (x + 1.0)
        self.w = 0.5 * w
        _, self.slopes, _ = self.shapes(self.s)

    def shapes(self, s):
        """The sines and their first two derivatives (m, waves) at s (m,)."""
        sin = np.sin(np.outer(s, self.k))
        cos = np.cos(np.outer(s, self.k))
        return sin, self.k * cos, -(self.k**2) * sin

    def static(self, s):
        """T (m,), X' and X'' (m, 2) of the cable at rest."""
        if self.full:
            T, x1, y1, x2, y2 = self.groups.tension_and_shape_derivatives(s)
        else:  # a parabola
            T = x1 = np.ones_like(s)
            x2 = np.zeros_like(s)
            y1 = self.groups.sigma * (0.5 - s)
            y2 = np.full_like(s, -self.groups.sigma)
        return T, np.stack([x1, y1], -1), np.stack([x2, y2], -1)

    def stress(self, s, w1):
        """Of w' (m, 2) at s (m,)."""
        T, X1, _ = self.static(s)
        identity = np.eye(2)
        if not self.full:
            energy = 0.5 * T * np.sum(w1**2, axis=1)
            return Stress(T, T[:, None] * w1, T[:, None, None] * identity, energy)
        r = X1 + w1
        stretch = np.hypot(*r.T)
        t = r / stretch[:, None]
        strain = stretch - 1.0
        alpha = np.full_like(T, self.groups.alpha)
        N = T + alpha * strain
        energy = T * strain + 0.5 * alpha * strain**2
        if self.law == "tension-only":
            taut = N > 0.0
            energy = np.where(taut, energy, -0.5 * T**2 / alpha)
            alpha = np.where(taut, alpha, 0.0)
            N = np.where(taut, N, 0.0)
        force = N[:, None] * t - T[:, None] * X1
        across = (N / stretch)[:, None, None] * identity
        along = (alpha - N / stretch)[:, None, None] * t[:, :, None] * t[:, None, :]
        return Stress(N, force, across + along, energy)

    def linearise(self, t, q, v, a, phase, c):
        c0, c1, c2 = c
        s_o, ds, dds = self.groups.motion.position_with_rates(t, phase)
        Q, V, A = (x.reshape(-1, 2) for x in (q, v, a))  # (waves, 2)
        f, f1, f2 = (x[0] for x in self.shapes(s_o))  # (waves,)
        _, X1, X2 = self.static(np.array([s_o]))
        stress = self.stress(self.s, self.slopes @ Q)
        self.min_tension_and_position = float(self.w @ stress.N), 0.5  # the mean: sines resolve no slack piece
        rate = dds * f1 + ds**2 * f2
        acceleration = f @ A + 2.0 * ds * f1 @ V + rate @ Q + dds * X1[0] + ds**2 * X2[0]
        pull = self.inertia * acceleration - self.weight
        R = 0.5 * A + self.slopes.T @ (self.w[:, None] * stress.force) + np.outer(f, pull)
        K = np.einsum("m,mi,mfg,mj->ifjg", self.w, self.slopes, stress.stiffness, self.slopes, optimize=True)
        of_mass = np.outer(f, c2 * f + 2.0 * c1 * ds * f1 + c0 * rate)
        M = 0.5 * c2 * np.eye(f.size) + self.inertia * of_mass
        tangent = c0 * K.reshape(q.size, q.size) + np.kron(M, np.eye(2))
        return R.ravel(), lambda b: np.linalg.solve(tangent, b)

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
        observed = self.observe(states, np.zeros(0), np.zeros(0, int))
        return observed.s_o, observed.path

    def observe(self, states, s, frames):
        n = states.t.size
        motion = [self.groups.motion.position_with_rates(t, k) for t, k in zip(states.t, states.phase, strict=True)]
        s_o, ds, dds = np.array(motion).reshape(n, 3).T
        Q, V, A = (x.reshape(n, -1, 2) for x in (states.q, states.v, states.a))  # (n, waves, 2)
        f, f1, f2 = self.shapes(s_o)  # (n, waves)
        _, X1, X2 = self.static(s_o)

        def at_mass(shape, x):
            return np.einsum("tk,tkf->tf", shape, x)

        c = ds[:, None]
        d = dds[:, None]
        path = at_mass(f, Q)
        slope = X1 + at_mass(f1, Q)
        velocity = at_mass(f, V) + c * slope
        acceleration = at_mass(f, A) + 2.0 * c * at_mass(f1, V) + at_mass(d * f1 + c**2 * f2, Q)
        acceleration += d * X1 + c**2 * X2
        driving = self.inertia * acceleration - self.weight
        cable = [self.stress(self.s, self.slopes @ x) for x in Q]
        energy = 0.25 * np.sum(V**2, axis=(1, 2)) + 0.5 * self.inertia * np.sum(velocity**2, axis=1)
        energy += [self.w @ stress.energy for stress in cable]
        energy -= self.weight[1] * (path[:, 1] + self.groups.coordinates(s_o)[1])
        if self.full:
            integrals = (1.0 - np.cos(self.k)) / self.k  # of the sines
            energy -= self.groups.sigma * Q[:, :, 1] @ integrals
        T = self.stress(s_o, at_mass(f1, Q)).N
        tension_min = np.array([stress.N.min() for stress in cable]).reshape(n)
        at_stations, slopes, _ = self.shapes(s)  # (m, waves)
        tension = [self.stress(s, slopes @ x).N for x in Q[frames]]
        u, v = np.einsum("mk,tkf->ftm", at_stations, Q[frames])
        du, dv = np.einsum("mk,tkf->ftm", at_stations, V[frames])
        return Observation(
            t=states.t,
            s_o=s_o,
            path=path,
            path_velocity=velocity,
            path_acceleration=acceleration,
            slope_behind=slope,
            slope_ahead=slope,
            T_behind=T,
            T_ahead=T,
            energy=energy,
            power=ds * np.sum(driving * slope, axis=1),
            tension_min=tension_min,
            tension_min_at=np.full(n, 0.5),
            u=u,
            v=v,
            du=du,
            dv=dv,
            T=np.reshape(tension, (frames.size, s.size)),
        )


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
    text = Path(__file__).read_text(encoding="utf-8")
    module = {"__name__": "without coriolis"}
    exec(text.replace("2.0 * ds * f1 @ V", "0.0 * ds * f1 @ V"), module)
    return module["METHOD"]
