"""Cars that roll: their balance along the mean tangent gives the travel, or the haul force.

    C = mu (p.. - sigma j) - F_ext,    tau . C - f cos(phi) = 0,    tau = <r'>/|<r'>|, cos(phi) = |<r'>|/<lam>

F_ext: outside force; f: force along the cable (friction, brake, hold); < >: mean of both sides; lam = |r'|.
This is no Lagrange equation: energy is kept to the error of the discretisation.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from cablefem.newmark import (
    ACCELERATION_ONLY,
    NO_STEPS,
    Newton,
    Solve,
    State,
    States,
    TangentFactors,
    quasi_static_start,
)
from cablefem.newmark.equilibrium import solve_equilibrium_on_haul_rope
from cablefem.response import Observation
from cablefem.scene import Groups
from cablefem.scene.motion import rest_motion
from cablefem.stickslip import CarForces, RollingCar
from galerkin import kernels
from galerkin.bases import Basis, Fourier
from galerkin.bases.kink import Array
from galerkin.equations import GalerkinSystem, overwriting_lu_solver_or_nan
from galerkin.kernels import rolling
from galerkin.kernels.rolling import Car

# single steps, without events
NO_BOUNDS = rolling.CarHistory(
    np.empty(0), np.empty(0), np.empty((0, 3)), 0.0, np.zeros(6), 0.0, 1.0, 0.0, 0.0, 0.0, False
)


NO_ACCELERATION = rolling.MeanAcceleration(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class RollingSystem(RollingCar, GalerkinSystem):
    """The equations (19) with a car that rolls: the last row is its balance.

    The last unknown of a free car is s_o.  That of a hauled car has the haul force as acceleration; s_o(t) is given.
    Friction and brakes keep their sign between events.  Other bases, models and loads raise ValueError.
    """

    short_steps_after_jumps = by_force = True

    def __init__(
        self, groups: Groups, basis: Basis, *, kink: bool = True, model: str = "full", load: str = "mass",
        law: str = "elastic",
    ) -> None:  # fmt: skip
        if model != "full":
            raise ValueError(f"a car that rolls needs model = full: {model!r} has no displacement along the cable")
        if load != "mass":
            raise ValueError("a car that rolls needs load = mass: without inertia it has no travel of its own")
        if not (kink and isinstance(basis, Fourier)):
            raise ValueError("a car that rolls needs sines with a hat that travels with it: take method fourier-kink")
        self.attach_drive_and_reset(groups)
        super().__init__(groups, basis, kink=kink, law=law)
        self.n_dof += 1
        self._past = np.empty((0, 3))  # rows t, p.
        self._mean_acceleration = NO_ACCELERATION
        window = 0.3  # of an axial round trip: for the mean acceleration of friction
        self._window = window * self.round_trip

    def position(self, x: State) -> float:
        return self._car_kinematics(x)[0]

    def mass_kinematics(self, states: States) -> Array:
        if not self.free:
            return super().mass_kinematics(states)
        return np.array([states.q[:, -1], states.v[:, -1], states.a[:, -1]])

    def _car_kinematics(self, x: State) -> tuple[float, float, float]:
        """s_o, ds_o, dds_o."""
        if not self.free:
            return self.motion.position_with_rates(x.t, x.phase)
        return float(x.q[-1]), float(x.v[-1]), float(x.a[-1])

    def _car_loads(self, t: float, phase: int) -> rolling.CarLoads:
        """What acts on the car at t besides the rope; its mean acceleration is extrapolated to t."""
        drive = self.drive
        ax = ay = math.nan
        if self.free:
            against = -self.mode.slip_sign
            mean = self._mean_acceleration
            ax = mean.ax + (t - mean.t) * mean.jx
            ay = mean.ay + (t - mean.t) * mean.jy
        else:
            speed = self.motion.position_with_rates(t, phase)[1]
            against = -math.copysign(1.0, speed)
        return rolling.CarLoads(
            mu=self.mu, sigma=self.groups.sigma, drag=drive.k, wind=drive.wind, hold=self.hold_force(t),
            friction=against * drive.mu_r, brake=against * self.brake_force, ax=ax, ay=ay,
        )  # fmt: skip

    def car_by_equilibrium_tension(self, x: State, held_loads: rolling.CarLoads | None = None) -> Car:
        """The car, by the tension from equilibrium; with `held_loads` it is held."""
        ride, sines, kinematics = self._kernel_arguments(x)
        state = np.array(x[1:4])
        if held_loads is not None:
            ride = rolling.Ride(rolling.STUCK, held_loads, 0.0)
        r = np.empty(self.n_dof)
        none = np.empty((0, self.n_dof, self.n_dof))
        return kernels.set_residual_and_derivatives(ride, sines, kinematics, state, r, none).car

    def _car_by_slopes_without_thrust(self, x: State) -> Car:
        """The car, by slopes of the basis and without thrust."""
        ride, sines, kinematics = self._kernel_arguments(x)
        return rolling.car_by_slopes_without_thrust(ride.loads, sines, kinematics, np.array(x[1:4]))

    def begin_step(self, x: State) -> None:
        """Update the car's mean acceleration, for friction and lift-off.

        With the present acceleration, friction has no solution on short steps (Painleve).
        """
        super().begin_step(x)
        if not self.free or (self._past.size and x.t <= self._past[-1, 0]):
            return
        car = self._car_by_slopes_without_thrust(x)
        past = np.concatenate([self._past, [[x.t, car.vx, car.vy]]])
        self._mean_acceleration = rolling.mean_acceleration_and_rate(past, 0, len(past) - 1, self._window)
        self._past = past[int(self._mean_acceleration.first) :]

    def hold_force(self, t: Any) -> Any:
        """F_hold on a free car at t; 0 on a hauled one."""
        return self.hold * self.drive.remaining_hold_fraction(t) if self.free else 0.0

    def observe(self, states: States, s: Array, frames: Array) -> Observation:
        """Adds the power of each force on the car."""
        o = super().observe(states, s, frames)
        drive = self.drive
        _, ds_o, _ = self.mass_kinematics(states)
        F = drive.thrust(states.t, states.phase) if self.free else states.a[:, -1]
        loads = rolling.CarLoads(self.mu, self.groups.sigma, drive.k, drive.wind)
        sides = np.array([o.slope_behind.T, o.slope_ahead.T])
        car = rolling.car_from_motion(loads, F, o.path_velocity.T, o.path_acceleration.T, sides)
        rate = np.abs(ds_o) * car.stretch
        powers = {}
        powers["thrust" if self.free else "haul"] = F * car.speed
        powers["drag"] = car.drag_x * car.vx + car.drag_y * car.vy
        powers["friction"] = -drive.mu_r * np.abs(car.pressing) * rate
        if self.free:
            powers["brake"] = -drive.brake_force(o.s_o) * rate
            powers["hold"] = self.hold_force(states.t) * ds_o
        powers |= o.powers
        power = np.sum(list(powers.values()), axis=0)
        contact = -np.stack([car.Cx, car.Cy], axis=1)
        haul = F if drive.thrust_table or not self.free else o.haul
        return replace(o, contact=contact, haul=haul, power=power, powers=powers)

    def residual(self, t: float, q: Array, v: Array, a: Array, phase: int) -> Array:
        return self._residual_and_derivatives(State(t, q, v, a, phase), 0)[0]

    def linearise(self, t: float, q: Array, v: Array, a: Array, phase: int, c: TangentFactors) -> tuple[Array, Solve]:
        r, derivatives = self._residual_and_derivatives(State(t, q, v, a, phase), 3)
        return r, overwriting_lu_solver_or_nan(np.tensordot(c, derivatives, 1))

    def _residual_and_derivatives(self, x: State, derivative_count: int) -> tuple[Array, Array]:
        """The residual, NaN off the cable, and the first of its derivatives by q, v, a; stores the smallest tension."""
        r = np.full(self.n_dof, np.nan)
        derivatives = np.zeros((derivative_count, self.n_dof, self.n_dof))
        if 0.0 < self.position(x) < 1.0:  # else a trial off the cable
            ride, sines, kinematics = self._kernel_arguments(x)
            state = np.array(x[1:4])
            result = kernels.set_residual_and_derivatives(ride, sines, kinematics, state, r, derivatives)
            self.min_tension_and_position = result.min_tension_and_position
        return r, derivatives

    def _kernel_arguments(self, x: State) -> tuple[rolling.Ride, kernels.CableSines, tuple[float, float, float]]:
        """How the car rolls, the cable, and s_o, ds_o, dds_o."""
        kinematics = self._car_kinematics(x)
        mode = rolling.HAULED
        if self.free:
            mode = rolling.FREE if self.mode.slip_sign != 0.0 else rolling.STUCK
        loads = self._car_loads(x.t, x.phase)
        sines = self._cable_sines(*self.sines.gauss_rules_of_sides(kinematics[0]))
        return rolling.Ride(mode, loads, self._thrust(x)), sines, kinematics

    def _thrust(self, x: State) -> float:
        return float(self.drive.thrust(x.t, x.phase)) if self.free else 0.0

    def _take_steps_without_events(
        self, t: Array, phase: int, start: Array, rules: Array, newton: Newton
    ) -> kernels.StepsTaken:
        q, v, a = start
        ride, sines, kinematics = self._kernel_arguments(State(float(t[0]), q, v, a, phase))
        return kernels.solve_steps(ride, NO_BOUNDS, sines, np.array([kinematics]), start, rules, newton)

    def _take_steps_until_event(
        self, t: Array, phase: int, start: Array, rules: Array, newton: Newton
    ) -> kernels.StepsTaken:
        """Steps end at an event, where the rules change, or where a hauled car turns."""
        drive = self.drive
        if not self.is_event_free_range_known or t[0] < drive.release:
            return kernels.StepsTaken(0, *NO_STEPS)
        q, v, a = start
        ride, _, at_start = self._kernel_arguments(State(t[0], q, v, a, phase))
        if self.free:
            kinematics = np.array([at_start])
            sines = self._cable_sines_for_reach(at_start, float(rules[:, 0, 1].sum()))
        else:
            kinematics = np.ascontiguousarray(self.motion.positions_with_rates(t, phase).T)
            backward = np.signbit(kinematics[:, 1])
            turned = np.flatnonzero(backward != backward[0])
            before_turn = turned[0] if turned.size else t.size
            same, sines = next(self.runs_with_equal_quadrature(kinematics[:before_turn, 0]))
            t = t[same]
            rules = rules[same]
        thrust = drive.thrust(t, phase) if self.free else np.zeros(t.size)
        past = np.concatenate([self._past, np.empty((t.size, 3))])
        mean_acceleration = np.zeros(6)
        history = rolling.CarHistory(
            t, thrust, past, self._window, mean_acceleration, *self.event_free_range(), self.mode.lifted_off
        )
        taken = kernels.solve_steps(ride, history, sines, kinematics, start, rules, newton)
        if taken.good:
            last = taken.good - 1
            w = float(rules[last, 0, 4])
            dt = float(rules[last, 0, 1])
            self.events_from = float(t[last]) + (1.0 - w + 1e-9) * dt
            if self.free:
                first = int(mean_acceleration[0])
                self._past = past[first : len(past) - t.size + taken.good]
        return taken

    def _cable_sines_for_reach(self, kinematics: tuple[float, float, float], duration: float) -> kernels.CableSines:
        """The cable with rules for both sides wherever the car gets in this time at its present speed."""
        s_o, ds_o, _ = kinematics
        reached = min(1.0, max(0.0, s_o + ds_o * duration))
        behind, _ = self.sines.gauss_rules_of_sides(max(s_o, reached))
        _, ahead = self.sines.gauss_rules_of_sides(min(s_o, reached))
        return self._cable_sines(behind, ahead)

    def start(self, phase: int, state: State | None) -> State:
        """In equilibrium, with a free car held, or a hauled one on its rope; later a jumps.

        A travel that begins at speed has the rate of change of the equilibrium.
        """
        if state is not None:
            return self.state_at_phase_start(state._replace(phase=phase))
        s_o = self.drive.start
        self.reset()
        self._past = np.empty((0, 3))
        self._mean_acceleration = NO_ACCELERATION
        if not self.free:
            speed = self.motion.position_with_rates(0.0, 0)[1]
            x = quasi_static_start(self, self._hauled_unknowns_at_rest, s_o, speed)
            return self.with_acceleration(x)
        q = np.append(self._unknowns_at_rest(s_o), s_o)
        still = np.zeros(self.n_dof)
        x = State(0.0, q, still, still, 0)
        car = self.car_by_equilibrium_tension(x, rolling.CarLoads(self.mu, self.groups.sigma, 0.0, 0.0))
        self.hold = car.needed_force_along_rope * car.stretch
        return self.release_car(x)

    def tension_only_at_rest_with_clamped_car(self, s_o: float) -> GalerkinSystem:
        """The cable at rest with the car clamped to it at s_o, by the tension-only law."""
        groups = replace(self.groups, motion=rest_motion(s_o, 1.0))
        return GalerkinSystem(groups, self.sines, kink=True, law="tension-only")

    def _hauled_unknowns_at_rest(self, s_o: float) -> Array:
        """q of a hauled car at rest on its rope, about to move."""
        still = replace(self.groups, motion=rest_motion(s_o, 1.0), drive=replace(self.drive, k=0.0))
        system = HauledCarAtRest(still, self.sines, law="tension-only")
        q = solve_equilibrium_on_haul_rope(system, self._unknowns_at_rest(s_o))
        return np.append(q[:-1], 0.0)

    def with_acceleration(self, x: State) -> State:
        """The state with the accelerations that its balance needs."""
        a = np.zeros(self.n_dof)
        for _ in range(3):  # friction is not linear
            r, solve = self.linearise(x.t, x.q, x.v, a, x.phase, ACCELERATION_ONLY)
            a = a - solve(r.copy())
        return State(x.t, x.q, x.v, a, x.phase)

    def car_forces(self, x: State) -> CarForces:
        """The larger normal force counts: the present one oscillates near a support, the mean one lags."""
        car = self._car_by_slopes_without_thrust(x)
        weight = self.mu * self.groups.sigma
        along = self._thrust(x) + car.tx * car.drag_x + car.ty * (car.drag_y + weight)
        return CarForces(max(car.pressing, car.normal), car.speed, along, weight * car.tx)

    def hold_and_normal_force(self, x: State) -> tuple[float, float]:
        car = self.car_by_equilibrium_tension(x)
        held = car.needed_force_along_rope - self.hold_force(x.t) / car.stretch
        return held, car.normal


class HauledCarAtRest(RollingSystem):
    """A hauled car at rest; its last unknown is the haul force."""

    def linearise(self, t: float, q: Array, v: Array, a: Array, phase: int, c: TangentFactors) -> tuple[Array, Solve]:
        haul = q[-1]
        x = State(t, q, v, np.append(a[:-1], haul), phase)
        r, derivatives = self._residual_and_derivatives(x, 3)
        derivatives[0, :, -1] = derivatives[2, :, -1]
        return r, overwriting_lu_solver_or_nan(np.tensordot(c, derivatives, 1))
