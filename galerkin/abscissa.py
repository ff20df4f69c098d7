"""A Galerkin system with the place of the mass as independent variable, (45)-(48)."""

from __future__ import annotations

import copy
from functools import lru_cache
from typing import Any

import numpy as np

from cablefem.newmark import Solve, State, States, System, TangentFactors
from cablefem.response import Observation
from galerkin.bases.kink import Array
from galerkin.equations import GalerkinSystem


class SystemOverPosition(System):
    """Any Galerkin system with s_o for t (45): r(t, g, ds_o g', ds_o^2 g'' + dds_o g') = 0, prime = d/ds_o.

    States hold t = s_o, q = g, v = g', a = g''; `states_over_time` turns them back.

    ValueError if the mass stops on the way.
    """

    def __init__(self, system: GalerkinSystem) -> None:
        if system.groups.drive.mode != "grip":
            raise ValueError("the place of a car that rolls is no clock; use time")
        self.system = system
        self.motion = system.motion
        self.at_support = system.at_support
        self.n_dof = system.n_dof
        self.force_scale = system.force_scale
        self.force_floor = system.force_floor
        at = self.motion.position_with_rates
        starts = [at(t, k) for k, (t, _) in enumerate(system.phases)]
        ends = [at(t, k) for k, (_, t) in enumerate(system.phases)]
        self.phases = tuple((start[0], end[0]) for start, end in zip(starts, ends, strict=True))
        if any(ds_o <= 0.0 for _, ds_o, _ in starts[1:]):
            raise ValueError("the mass stands still on its way: s_o cannot be the independent variable; use time")
        if starts[0][1:] == (0.0, 0.0):
            raise ValueError("the mass starts with neither speed nor acceleration: g(s_o) has no series at 0; use time")
        self._time_speed_acceleration = lru_cache(maxsize=8)(self._time_speed_acceleration_at)

    @property
    def min_tension_and_position(self) -> tuple[float, float]:
        return self.system.min_tension_and_position

    def position(self, x: State) -> float:
        return x.t

    def with_law(self, law: str) -> SystemOverPosition:
        other = copy.copy(self)
        other.system = self.system.with_law(law)
        return other

    def _time_speed_acceleration_at(self, s_o: float, phase: int) -> tuple[float, float, float]:
        """t, ds_o, dds_o where the mass is at s_o."""
        t0, t1 = self.system.phases[phase]
        t = min(max(self.motion.time_at_position(s_o), t0), t1)
        _, ds_o, dds_o = self.motion.position_with_rates(t, phase)
        return t, ds_o, dds_o

    def start(self, phase: int, state: State | None) -> State:
        """The state at the start of a phase by place: q and its derivatives by s_o; (48) where the car is at rest."""
        s_o = self.phases[phase][0]
        t, ds_o, dds_o = self._time_speed_acceleration(s_o, phase)
        if state is None:
            x = self.system.start(phase, None)
        else:
            _, *rates = self._time_speed_acceleration(s_o, state.phase)
            q, v, a = time_derivatives(state.q, state.v, state.a, *rates)
            x = self.system.start(phase, State(t, q, v, a, state.phase))
        if ds_o > 0.0:
            first = x.v / ds_o
            second = (x.a - dds_o * first) / ds_o**2
        else:
            first = x.a / dds_o
            start = 1e-4  # s_o of the balance at a start from rest, over the travel; the limit (48) excites axial modes
            second = self.second_derivative_at_rest_start(first, start * self.phases[0][1])
        return State(s_o, x.q, first, second, phase)

    def second_derivative_at_rest_start(self, first_derivative: Array, s_o: float) -> Array:
        """g'' at a start from rest by s_o g' + s_o^2 g''/2 in balance at s_o; s_o -> 0 is (48)."""
        half_square = 0.5 * s_o * s_o
        second = np.zeros(self.n_dof)
        for _ in range(3):  # Newton; nearly linear
            q = s_o * first_derivative + half_square * second
            v = first_derivative + s_o * second
            r, solve = self.linearise(s_o, q, v, second, 0, (half_square, s_o, 1.0))
            second = second - solve(r.copy())
        return second

    def residual(self, s_o: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        t, ds_o, dds_o = self._time_speed_acceleration(s_o, phase)
        return self.system.residual(t, *time_derivatives(q, v, a, ds_o, dds_o), phase)

    def linearise(self, s_o: float, q: Array, v: Array, a: Array, phase: int, c: TangentFactors) -> tuple[Array, Solve]:
        c0, c1, c2 = c
        t, ds_o, dds_o = self._time_speed_acceleration(s_o, phase)
        x = time_derivatives(q, v, a, ds_o, dds_o)
        return self.system.linearise(t, *x, phase, (c0, c1 * ds_o, c1 * dds_o + c2 * ds_o**2))

    def states_over_time(self, states: States) -> States:
        """The states with t instead of s_o, and derivatives by it."""
        positions = zip(states.t.tolist(), states.phase.tolist(), strict=True)
        rows = [self._time_speed_acceleration(s_o, phase) for s_o, phase in positions]
        t, ds_o, dds_o = np.array(rows).reshape(-1, 3).T
        q, v, a = time_derivatives(states.q, states.v, states.a, ds_o[:, None], dds_o[:, None])
        return States(t, q, v, a, states.phase)

    def mass_positions_and_displacements(self, states: States) -> tuple[Array, Array]:
        return self.system.mass_positions_and_displacements(states)

    def observe(self, states: States, s: Array, frames: Array) -> Observation:
        return self.system.observe(states, s, frames)


def time_derivatives(g: Array, g1: Array, g2: Array, ds_o: Any, dds_o: Any) -> tuple[Array, Array, Array]:
    """q, dq/dt, d2q/dt2 from g, g', g''."""
    return g, ds_o * g1, ds_o**2 * g2 + dds_o * g1
