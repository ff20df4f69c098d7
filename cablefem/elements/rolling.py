"""A car that rolls on mass-following elements; its equation is `kernels.car`.

free : the last unknown is s_o(t).
haul : s_o(t) is given, and the last acceleration is the force of the rope along the mean tangent.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cablefem import newmark
from cablefem.elements.following import FollowingElements
from cablefem.elements.kernels import car as kernels
from cablefem.elements.kernels.balance import Factors, Instant
from cablefem.elements.kernels.newton import NO_TANGENT
from cablefem.newmark import Array, Newton, Solve, State, States, StepResult, Tableau, TangentFactors
from cablefem.newmark.equilibrium import solve_equilibrium, solve_equilibrium_on_haul_rope
from cablefem.response import Observation
from cablefem.scene import Groups
from cablefem.scene.drive import GRIP
from cablefem.scene.motion import rest_motion
from cablefem.stickslip import CarForces, EventFreeRange, RollingCar

NO_BOUNDS = np.empty(0)  # course of a car in single steps
TINY = 1e-30  # factor of dr/da, for a tangent that is regular for the rope's force


def make_following_elements(groups: Groups, **model_options: Any) -> FollowingElements:
    return (FollowingElements if groups.drive.mode == "grip" else RollingElements)(groups, **model_options)


class RollingElements(RollingCar, FollowingElements):
    """The cable with a car that rolls, drive "free" or "haul".

    Raises ValueError for the one-field models and for a moving force: no balance along the chord.
    """

    drives = ("free", "haul")
    short_steps_after_jumps = False

    def __init__(self, groups: Groups, **model_options: Any) -> None:
        super().__init__(groups, **model_options)
        self._at_rest = model_options | {"law": "tension-only"}
        if self.fields == 1 or self.load == "force":
            subject = f"model {self.model}" if self.fields == 1 else "a moving force without mass"
            raise ValueError(
                f"{subject} has no balance along the cable: a car that rolls needs the full model and a mass"
            )
        self.attach_drive_and_reset(groups)
        self._air = self.drive.k, self.drive.wind, self.drive.mu_r
        self.n_dof += 1

    def position(self, x: State) -> float:
        return float(x.q[-1]) if self.free else super().position(x)

    def start(self, phase: int, state: State | None) -> State:
        """Begin a phase; the first one as follows.

        free : the cable at rest with the car held; the car is let go.
        haul : the cable moves through states of rest with the first speed of the travel.
        """
        t = self.phases[phase][0]
        if state is not None:
            return self.state_at_phase_start(state._replace(t=t, phase=phase))
        self.reset()
        if not self.free:
            s_o, ds, _ = self.motion.position_with_rates(t, 0)
            return newmark.quasi_static_start(self, self._solve_rest_of_hauled_car, s_o, ds)
        s_o = self.drive.start
        zero = np.zeros(self.n_dof)
        q = np.append(solve_equilibrium(self.tension_only_at_rest_with_clamped_car(s_o)), s_o)
        x = State(t, q, zero, zero.copy(), 0)
        alone = self._kernel_car._replace(drag=0.0, friction=0.0, brake=0.0)
        self.hold = self._car_row(alone, np.zeros(3), x)
        return self.release_car(x)

    def needs_damped_steps(self, x: State, dt: float) -> bool:
        """After a jump of force the car slips until an axial wave stops it."""
        abrupt = 1e-5  # slip over l in a step that makes an acceleration abrupt
        return self.free and 0.5 * dt * dt * abs(float(x.a[-1])) > abrupt

    def _set_residual_and_tangent(self, t: float, phase: int, x: Array, r: Array, factors: Factors) -> None:
        drive_inputs = self._drive_inputs(np.array(t), phase)
        self._assemble_cable_and_car(self._kernel_car, drive_inputs, x, r, factors)

    def solve_steps(self, t: Array, *steps: Any) -> newmark.ManySteps:
        if not self.is_event_free_range_known:
            return newmark.NO_STEPS
        taken = super().solve_steps(t, *steps)
        self._set_start_of_event_search(t, len(taken.ends))
        return taken

    def _set_start_of_event_search(self, step_end_times: Array, taken: int) -> None:
        """Let events be looked for from the last tenth of the last step taken on; step_end_times : [s] of all."""
        if taken > 1:
            begin, end = step_end_times[taken - 2 : taken].tolist()
            self.events_from = begin + 0.9 * (end - begin)

    def _car_and_kernel_inputs(self, t: Array, phase: int) -> tuple[Any, Array]:
        bounds = self._event_free_bounds if len(t) > 1 else NO_BOUNDS
        return kernels.CarOnMesh(self._kernel_car, self._at_car, bounds), self._drive_inputs(t, phase)

    def _drive_inputs(self, t: Array, phase: int) -> Array:
        """`drive_inputs` of `kernels.Car` at t, (..., 3)."""
        if not self.free:
            kinematics = self.motion.positions_with_rates(t, phase)
            return np.ascontiguousarray(np.moveaxis(kinematics, 0, -1))
        inputs = np.zeros((*t.shape, 3))
        drive = self.drive
        if t.min() < drive.release:
            inputs[..., 0] = self.hold * drive.remaining_hold_fraction(t)
        if drive.thrust_table:
            inputs[..., 1] = drive.thrust(t, phase)
        return inputs

    @property
    def _event_free_bounds(self) -> Array:
        """`bounds` of `kernels.car_has_had_no_event`.

        A hauled car has a margin: schemes may balance it before the end of the step.
        """
        share = 0.0 if self.free else 0.1  # of the weight
        smallest_force = share * self.inertia * self.groups.sigma
        bounds = self.event_free_range() if self.free else EventFreeRange(-math.inf, math.inf, 0.0, 0.0, 0.0)
        return np.array([*bounds, -math.inf if self.mode.lifted_off else smallest_force])

    def collocate_steps(self, phase: int, steps: newmark.Steps, rule: Tableau, newton: Newton) -> Iterator[StepResult]:
        many = not self.free or rule.c[-1] == 1.0
        if not (many and self.is_event_free_range_known):
            steps = steps.section(0, 1)
        results = self._take_collocation_steps_until_event(phase, steps, rule, newton)
        self._set_start_of_event_search(steps.t[1:], len(results))
        return self._yield_results_noting_tension(results)

    def car_forces(self, x: State) -> CarForces:
        """Normal force, speed along the rope and forces along it; dimensionless."""
        forces = self._forces_on_car_at(x)
        tx, ty = forces.tau
        px, py = forces.velocity
        ex, ey = forces.outside
        weight = self.inertia * self.groups.sigma
        speed = px * tx + py * ty
        along = ex * tx + (ey + weight) * ty
        return CarForces(forces.normal, speed, along, weight * tx)

    def hold_and_normal_force(self, x: State) -> tuple[float, float]:
        forces = self._forces_on_car_at(x)
        needed = self._car_row(self._kernel_car, self._drive_inputs(np.array(x.t), x.phase), x)
        return needed / forces.stretch, forces.normal

    @property
    def _kernel_car(self) -> kernels.Car:
        fixed = self.node, self.inertia, self.groups.sigma, *self._air
        if not self.free:
            return kernels.Car(kernels.HAUL, *fixed, 0.0, 1.0)
        mode = kernels.HELD if self.mode.sticks else kernels.FREE
        return kernels.Car(mode, *fixed, self.brake_force, self.mode.slip_sign)

    def _forces_on_car_at(self, x: State) -> kernels.ForcesOnCar:
        inputs = self._drive_inputs(np.array(x.t), x.phase)
        return kernels.forces_on_car(self._cable, self._kernel_car, inputs, self._at_car, np.array(x[1:4]))

    def _assemble_cable_and_car(
        self, car: kernels.Car, drive_inputs: Array, x: Array, r: Array, factors: Factors = NO_TANGENT
    ) -> kernels.CarBalance:
        """Set r, `min_tension_and_position` and, unless the factors are 0, `_tangent` at x, rows q, v, a."""
        instant = Instant(drive_inputs, self._bands, self._coupling)
        car_on_mesh = kernels.CarOnMesh(car, self._at_car, NO_BOUNDS)
        balance = kernels.assemble_cable_and_car(self._cable, car_on_mesh, instant, x, r, self._tangent, factors)
        self.min_tension_and_position = balance.min_tension, balance.min_at
        return balance

    def _car_row(self, car: kernels.Car, drive_inputs: Array, x: State) -> float:
        """Left side of the row of s_o: the force along the cable that the car lacks."""
        r = np.empty(self.n_dof)
        return self._assemble_cable_and_car(car, drive_inputs, np.array(x[1:4]), r).row

    def tension_only_at_rest_with_clamped_car(self, s_o: float) -> FollowingElements:
        """The cable at rest with the car clamped to it."""
        at_rest = replace(self.groups, motion=rest_motion(s_o, 1.0), drive=GRIP)
        return FollowingElements(at_rest, **self._at_rest)

    def _solve_rest_of_hauled_car(self, s_o: float) -> Array:
        """q of a hauled car at rest on its rope, about to move."""
        still = replace(self.groups, motion=rest_motion(s_o, 1.0), drive=replace(self.drive, k=0.0))
        clamped = solve_equilibrium(self.tension_only_at_rest_with_clamped_car(s_o))
        on_its_rope = solve_equilibrium_on_haul_rope(HauledCarAtRest(still, **self._at_rest), clamped)
        return np.append(on_its_rope[:-1], 0.0)

    def _mass_kinematics(self, states: States) -> Array:
        if not self.free:
            return super()._mass_kinematics(states)
        s_o, ds, dds = (x[:, -1] for x in (states.q, states.v, states.a))
        return np.stack([s_o, ds, dds], axis=1)

    def observe(self, states: States, s: Array, frames: NDArray[np.intp]) -> Observation:
        """Adds the power of each force on the car."""
        o = super().observe(states, s, frames)
        drive = self.drive
        ds = self._mass_kinematics(states)[:, 1]
        mean = 0.5 * (o.slope_behind + o.slope_ahead)
        tau = mean / np.linalg.norm(mean, axis=1)[:, None]
        behind = np.linalg.norm(o.slope_behind, axis=1)
        ahead = np.linalg.norm(o.slope_ahead, axis=1)
        stretch = 0.5 * (behind + ahead)
        driving_force = drive.thrust(states.t, states.phase) if self.free else states.a[:, -1]
        driving = driving_force[:, None] * tau
        air = o.path_velocity - np.array([drive.wind, 0.0])
        speed = np.linalg.norm(air, axis=1)[:, None]
        drag = -drive.k * speed * air
        contact = o.contact + (driving + drag)
        across = contact[:, 1] * tau[:, 0] - contact[:, 0] * tau[:, 1]
        normal = np.abs(across)
        powers = {}
        powers["thrust" if self.free else "haul"] = np.sum(driving * o.path_velocity, axis=1)
        powers["drag"] = np.sum(drag * o.path_velocity, axis=1)
        powers["friction"] = -stretch * drive.mu_r * normal * np.abs(ds)
        if self.free:
            powers["brake"] = -stretch * drive.brake_force(o.s_o) * np.abs(ds)
            powers["hold"] = self.hold * drive.remaining_hold_fraction(states.t) * ds
        powers |= o.powers
        driven = not self.free or bool(drive.thrust_table)
        haul = driving_force if driven else o.haul
        return replace(o, contact=contact, powers=powers, power=sum(powers.values()), haul=haul)


class HauledCarAtRest(RollingElements):
    """A hauled car at rest; its last unknown is the force of the rope."""

    def linearise(self, t: float, q: Array, v: Array, a: Array, phase: int, c: TangentFactors) -> tuple[Array, Solve]:
        c0, c1, c2 = c
        c2 = c2 or TINY
        a = np.append(a[:-1], q[-1])
        r, solve = super().linearise(t, q, v, a, phase, (c0, c1, c2))

        def solve_for_force(b: Array) -> Array:
            x = solve(b)
            x[-1] *= c2
            return x

        return r, solve_for_force
