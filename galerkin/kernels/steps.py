"""Steps by Newton's method, for a mass that grips or a car that rolls."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from galerkin.kernels import rolling
from galerkin.kernels.cable import (
    Array,
    RealTangentFactors,
    add_inertia_and_gripping_mass,
    set_internal_force_return_energy,
    set_tangent_with_gripping_mass,
    smoothed_min_tension_and_position,
)
from galerkin.kernels.dense import allocate_lu_factors, set_lu_factors, solve_factored_in_place
from galerkin.kernels.instant import (
    CableSines,
    Instant,
    Kinematics,
    instant_at,
    kinematics_in_row,
    kinematics_of_free_car,
    quadrature_points_at,
)
from galerkin.kernels.rolling import Car, CarHistory, Ride
from galerkin.law import compiled, inner, shared

if TYPE_CHECKING:
    from cablefem.newmark import Newton


class Workspace(NamedTuple):
    """Memory of a step."""

    balanced: Array  # (3, n_dof) the state that is balanced
    r: Array  # (n_dof,) its residual
    internal: Array  # (2, n) the internal force in it
    weighted_stiffness: Array  # (3, m) weighted tangent xx, xy, yy
    tensions: Array  # (m,) tension of the elastic law
    side_forces: Array  # (2, 2) int (N t - T t_static) ds behind and ahead of the mass
    K: Array  # (n_dof, n_dof)
    factors: tuple[Array, Array]  # of K, see `set_lu_factors`
    step: Array  # (n_dof,)


class Step(NamedTuple):
    """A step to be solved; a mass that grips has no ride."""

    ride: Ride | None
    sines: CableSines
    begin: Array  # (3, n_dof)
    end: Array  # (3, n_dof), to be set
    rule: Array  # (3, 5), see `System.solve_step`
    workspace: Workspace


class CarAndMinTension(NamedTuple):
    """The car in a state, if one rolls, and the smallest tension with its s."""

    car: Car
    min_tension_and_position: tuple[float, float]


class StepOutcome(NamedTuple):
    """How a step was solved."""

    norm: float  # |r| at its end
    iterations: int
    factorisations: int
    evaluations: int
    min_tension: float
    min_tension_at: float  # its s


class StepsTaken(NamedTuple):
    """Steps up to one that fails, falls slack or ends in an event."""

    good: int  # number of steps before that one
    ends: Array  # (m, 3, n_dof)
    outcomes: Array  # (m, 6) of `StepOutcome`, NaN after the last


@inner
def allocate_workspace(size: int, sines: CableSines) -> Workspace:
    m = sines.behind.shape[1] + sines.ahead.shape[1]
    n = sines.left.size + 1
    balanced = np.empty((3, size))
    internal = np.empty((2, n))
    weighted_stiffness = np.empty((3, m))
    side_forces = np.empty((2, 2))
    K = np.empty((size, size))
    factors = allocate_lu_factors(size)
    return Workspace(
        balanced, np.empty(size), internal, weighted_stiffness, np.empty(m), side_forces, K, factors, np.empty(size)
    )


@inner
def copy_into(values: Array, target: Array) -> None:
    """Set target[:] = values; the slice would compile its error message for seconds."""
    a = values.reshape(values.size)
    b = target.reshape(target.size)
    for i in range(a.size):
        b[i] = a[i]


@compiled
def set_side_forces_and_strain_energies(
    sines: CableSines, s_o: Array, Q: Array, side_forces: Array, strain: Array
) -> None:
    """Set `side_forces` of `Workspace` (m, 2, 2) and int W ds (m,) of m instants with s_o (m,), Q (m, 2, n)."""
    workspace = allocate_workspace(2 * Q.shape[2], sines)
    for i in range(strain.size):
        points = quadrature_points_at(sines, s_o[i])
        strain[i] = set_internal_force_return_energy(points, Q[i], sines.cable, workspace.internal, workspace)
        copy_into(workspace.side_forces, side_forces[i])


@inner
def set_workspace_residual_return_car(now: Instant, ride: Ride | None, sines: CableSines, workspace: Workspace) -> Car:
    """Set r, internal, weighted_stiffness, tensions and side_forces of `Workspace`; return the car if it rolls."""
    n = now.at_mass.inertia.f.size
    R = workspace.r[: 2 * n].reshape(2, n)
    coefficients = rolling.coefficients_of_state(workspace.balanced, n)
    set_internal_force_return_energy(now.points, coefficients.Q, sines.cable, R, workspace)
    if ride is None:
        add_inertia_and_gripping_mass(now.at_mass, coefficients, sines.cable, R)
        return rolling.NO_CAR
    return rolling.complete_residual_return_car(now.at_mass, ride, sines, workspace, R)


@compiled
def set_residual_and_derivatives(
    ride: Ride | None, sines: CableSines, kinematics: Kinematics, state: Array, r: Array, derivatives: Array
) -> CarAndMinTension:
    """Set r (n_dof,), and the first len(derivatives) of dr/dq, dr/dv, dr/da, each (n_dof, n_dof).

    state : rows q, v, a
    """
    workspace = allocate_workspace(state.shape[1], sines)
    now = instant_at(sines, kinematics)
    copy_into(state, workspace.balanced)
    car = set_workspace_residual_return_car(now, ride, sines, workspace)
    copy_into(workspace.r, r)
    for k in range(derivatives.shape[0]):
        c = 1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0
        set_workspace_tangent(now, ride, sines, workspace, car, c)
        copy_into(workspace.K, derivatives[k])
    lowest = smoothed_min_tension_and_position(now.points, kinematics[0], workspace.tensions, hat=1)
    return CarAndMinTension(car, lowest)


@inner
def set_step_residual_return_instant_car_norm(now: Instant, step: Step) -> tuple[Instant, Car, float]:
    """Evaluate w end + (1 - w) begin, w of the rule; return `Instant`, car and |r|, NaN off the cable."""
    workspace = step.workspace
    for k in range(3):
        w = step.rule[k, 4]
        for i in range(workspace.r.size):
            workspace.balanced[k, i] = w * step.end[k, i] + (1.0 - w) * step.begin[k, i]
    if not has_prescribed_position(step.ride):
        kinematics = kinematics_of_free_car(workspace.balanced)
        if not 0.0 < kinematics[0] < 1.0:
            return now, rolling.NO_CAR, math.nan
        now = instant_at(step.sines, kinematics)
    car = set_workspace_residual_return_car(now, step.ride, step.sines, workspace)
    square = 0.0
    for value in workspace.r:
        square += value * value
    return now, car, math.sqrt(square)


@inner
def has_prescribed_position(ride: Ride | None) -> bool:
    """Whether s_o(t) is given, as of a mass that grips or a hauled car."""
    if ride is None:
        return True
    return ride.mode == rolling.HAULED


@shared
def set_workspace_tangent(
    now: Instant, ride: Ride | None, sines: CableSines, workspace: Workspace, car: Car, c: RealTangentFactors
) -> None:
    """Set K of `Workspace`; car : of `set_workspace_residual_return_car`."""
    n = now.at_mass.inertia.f.size
    set_tangent_with_gripping_mass(now, sines, workspace.weighted_stiffness, c, workspace.K[: 2 * n, : 2 * n])
    if ride is not None:
        rolling.complete_workspace_tangent_with_car(now, ride, sines, workspace, car, c)


@inner
def set_predicted_end_state(rule: Array, begin: Array, end_state: Array) -> None:
    """Set the end of a step (3, n_dof) to the rule's guess."""
    for k in range(3):
        for i in range(begin.shape[1]):
            end_state[k, i] = rule[k, 0] * begin[0, i] + rule[k, 1] * begin[1, i] + rule[k, 2] * begin[2, i]


@inner
def correct_end_state(rule: Array, end_state: Array, newton_step: Array, fraction: float) -> None:
    """Take a fraction of a Newton step from the end of a step (3, n_dof)."""
    for k in range(3):
        for i in range(newton_step.size):
            end_state[k, i] -= fraction * rule[k, 3] * newton_step[i]


@inner
def correct_end_state_until_residual_falls(
    now: Instant, step: Step, newton: Newton, norm_before: float, iterations: int
) -> tuple[Instant, Car, float, int]:
    """Correct the end by a Newton step, halved until |r| falls below `norm_before`.

    The first `newton.patience` iterations may let it grow.  Return `Instant`, car, |r| and the count of evaluations.
    """
    fraction = 1.0
    evaluations = 0
    car = rolling.NO_CAR
    norm = math.inf
    for _ in range(newton.halvings + 1):
        correct_end_state(step.rule, step.end, step.workspace.step, fraction)
        now, car, norm = set_step_residual_return_instant_car_norm(now, step)
        evaluations += 1
        if norm < norm_before or (iterations < newton.patience and norm < math.inf):
            break
        fraction = -0.5 * abs(fraction)  # take back half of the last one
    return now, car, norm, evaluations


@inner
def solve_step(now: Instant, step: Step, newton: Newton) -> StepOutcome:
    """Solve one step for its end, like `cablefem.newmark.find_root`."""
    rule = step.rule
    workspace = step.workspace
    c = rule[0, 4] * rule[0, 3], rule[1, 4] * rule[1, 3], rule[2, 4] * rule[2, 3]
    set_predicted_end_state(rule, step.begin, step.end)
    now, car, norm = set_step_residual_return_instant_car_norm(now, step)
    iterations = 0
    factorisations = 0
    evaluations = 0
    before = math.inf
    if math.isnan(norm):
        return StepOutcome(norm, 1, 0, 1, math.inf, 0.0)
    while iterations == 0 or (newton.bound < norm < math.inf and iterations < newton.max_iter):
        if iterations == 0 or norm > newton.reuse * before:
            factorisations += 1
            set_workspace_tangent(now, step.ride, step.sines, workspace, car, c)
            set_lu_factors(workspace.K, workspace.factors)
        copy_into(workspace.r, workspace.step)
        solve_factored_in_place(workspace.factors, workspace.step)
        before = norm
        now, car, norm, tried = correct_end_state_until_residual_falls(now, step, newton, before, iterations)
        evaluations += tried
        iterations += 1
    lowest, where = smoothed_min_tension_and_position(now.points, now.at_mass.s_o, workspace.tensions, hat=1)
    return StepOutcome(norm, iterations, factorisations, evaluations, lowest, where)


@compiled
def solve_steps(
    ride: Ride | None, history: CarHistory | None, sines: CableSines, kinematics: Array, start: Array, rules: Array,
    newton: Newton,
) -> StepsTaken:  # fmt: skip
    """Take m steps, up to one that fails, falls slack or ends in an event of the `CarHistory`.

    kinematics : (m, 3) s_o, ds_o, dds_o;  for a free car (1, 3), those at the start
    """
    m = rules.shape[0]
    size = start.shape[1]
    ends = np.empty((m, 3, size))
    outcomes = np.full((m, 6), math.nan)
    workspace = allocate_workspace(size, sines)
    at_start = kinematics_in_row(kinematics, 0)
    now = instant_at(sines, at_start)
    car = rolling.NO_CAR
    if ride is not None:
        car = rolling.car_by_slopes_without_thrust(ride.loads, sines, at_start, start)
    for i in range(m):
        rule = rules[i]
        begin = start if i == 0 else ends[i - 1]
        if i > 0 and has_prescribed_position(ride):
            now = instant_at(sines, kinematics_in_row(kinematics, i))
        ride_now = rolling.update_history_return_ride(ride, history, rule, i, car)
        outcome = solve_step(now, Step(ride_now, sines, begin, ends[i], rule, workspace), newton)
        outcomes[i, 0] = outcome.norm
        outcomes[i, 1] = outcome.iterations
        outcomes[i, 2] = outcome.factorisations
        outcomes[i, 3] = outcome.evaluations
        outcomes[i, 4] = outcome.min_tension
        outcomes[i, 5] = outcome.min_tension_at
        slack = sines.cable.slack_ends and not outcome.min_tension >= 0.0
        if slack or not outcome.norm <= newton.bound:
            return StepsTaken(i, ends, outcomes)
        car = rolling.car_at_step_end(ride, history, sines, kinematics, rule, i, ends[i])
        if rolling.has_event(ride, history, ends[i], car):
            return StepsTaken(i, ends, outcomes)
    return StepsTaken(m, ends, outcomes)
