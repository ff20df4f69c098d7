"""From a solver's states to a Response in SI."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from copy import copy
from dataclasses import dataclass
from functools import cache, lru_cache, partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from cablefem.newmark import (
    Collocated,
    PassedEvent,
    State,
    StateHistory,
    States,
    Work,
    interpolate_hermite,
    stack_states,
    with_states_inside_steps,
)
from cablefem.response import Array, Fields, LazyValue, Observation, Response
from cablefem.scene import Motion, Scene
from validation.core.solver import Solver

FRAMES = 200  # of the fields: at s_o/l = 1/FRAMES, 2/FRAMES, ..., and at as many equal times
STATIONS = 201  # the fewest that the file contract allows
MAX_POSITION = 1.0 + 1e-9  # largest s_o/l on the cable
_TENSIONS = ("T_behind", "T_ahead", "T_behind_pointwise", "T_ahead_pointwise")
# fields of a `Response` named as in `Observation`
_STEP_FORCES = (
    "slope_behind", "slope_ahead", *_TENSIONS, "reaction_left", "reaction_right", "contact", "tension_min",
    "tension_min_at", "energy", "kinetic", "strain", "potential", "power",
)  # fmt: skip
OBSERVED = ("velocity", "acceleration", "F_haul", "powers", "fields", "events", *_STEP_FORCES)
SWING = 1e-3  # of the length: shortest way back after a turn
STICK_SLIP = ("standstill", "breaking loose", "brake off", "turn")  # events of friction: not of the car

_threads = cache(ThreadpoolController)  # cached: slow


def limited_to_one_blas_thread() -> AbstractContextManager[Any]:
    """One BLAS thread in the body: the matrices are small."""
    return _threads().limit(limits=1)


class Onset(NamedTuple):
    """The first slack state."""

    step: int
    s: float  # s/l of the slack point


@dataclass(slots=True)
class History:
    """States and costs of a march."""

    states: StateHistory
    work: Work
    seconds: float
    failure: tuple[str, str] | None  # cause and reason
    onset: Onset | None
    solver: Solver
    after: Solver | None  # tension-only, from the onset on


def _finite_states_noting_failure(history: History) -> States:
    """The states over time up to where they are not finite or the mass is past the cable; sets its failure there."""
    states = history.solver.states_over_time(stack_states(history.states))
    finite = [np.isfinite(x).all(axis=1) for x in (states.q, states.v, states.a)]  # (n,) each
    sound = np.logical_and.reduce(finite)
    sound[-1] &= history.solver.position(history.states[-1]) <= MAX_POSITION
    if sound.all():
        return states
    history.failure = "unstable", "the solution grew beyond all bounds; take more steps or a damped scheme"
    return _select_states(states, slice(0, int(np.argmin(sound))))


def scene_and_path_in_si(scene: Scene, t: Array, position: Array, w: Array) -> dict[str, Any]:
    """Fields of a `Response` that say which scene, and the path of its mass, in SI.

    t : times (n,);  position : s_o/l (n,);  w : displacements of the mass (n, 2); all dimensionless.
    """
    l = scene.length
    s_o = l * position
    u, v = l * w.T
    return {
        "scene": scene.name, "scene_toml": scene.to_toml(), "drive": scene.drive.mode, "length": l,
        "horizontal_tension": scene.horizontal_tension, "t": scene.time_scale * t, "s_o": s_o, "u": u, "v": v,
        "x": scene.catenary.x(s_o) + u, "y": scene.catenary.y(s_o) + v,
    }  # fmt: skip


def _slack_onset_within(history: History, states: States) -> Onset | None:
    """The slack onset, if it lies within the states."""
    return history.onset if history.onset is not None and history.onset.step < states.t.size else None


def response_of_history(scene: Scene, history: History, *, frames: int = FRAMES, **how: Any) -> Response:
    """The response of a history so far; all but the path is computed when it is looked at.

    how : the fields that say what was run;  frames : smallest number of instants with fields.
    """
    states = _finite_states_noting_failure(history)
    position, w = history.solver.mass_positions_and_displacements(states)
    observe = partial(_observed_fields, scene, copy(history), states, frames, list(history.work.events))
    onset = _slack_onset_within(history, states)
    slack_onset = None if onset is None else float(position[onset.step])
    counts = ("steps", "rejected", "newton_iterations", "factorisations", "residuals")
    motion = scene.groups.motion
    phases = [] if motion is None else motion.phases[1:]
    cause, reason = history.failure or (None, None)
    return Response(
        **how, **scene_and_path_in_si(scene, states.t, position, w), n_dof=history.states[0].q.size,
        seconds=history.seconds, work={name: getattr(history.work, name) for name in counts},
        breaks=[scene.time_scale * t for t, _ in phases if t < states.t[-1]],
        status="complete" if history.failure is None else "incomplete", cause=cause, reason=reason,
        slack_onset=slack_onset, slack_at=None if onset is None else float(onset.s),
        switched=None if history.after is None else slack_onset, later=computed_when_looked_at(observe, OBSERVED),
    )  # fmt: skip


def computed_when_looked_at(
    observe: Callable[[], dict[str, Any]], names: Sequence[str]
) -> dict[str, Callable[[Response], Any]]:
    """What computes the named fields of a `Response`: all of them, once, when one is looked at."""
    observed = LazyValue(observe)

    def field(name: str) -> Callable[[Response], Any]:
        return lambda r: observed()[name]

    return {name: field(name) for name in names}


def _observed_fields(
    scene: Scene, history: History, states: States, frames: int, passed: list[PassedEvent]
) -> dict[str, Any]:
    """The fields of a `Response` that are OBSERVED."""
    onset = _slack_onset_within(history, states)
    switch = states.t[onset.step] if onset is not None and history.after is not None else math.inf
    t = times_of_frames(scene, float(states.t[-1]), frames)
    s = np.linspace(0.0, 1.0, STATIONS)
    with limited_to_one_blas_thread():
        if t.size == 0 or states.t.size == 1:
            at_frames = _select_states(states, slice(0, 0))
        else:
            at_frames = _interpolated_states(_dense_states_around(history, states, t), t)
        observation, steps = _observe_steps_and_frames(history, states, at_frames, switch, s)
    result = observation_in_si(scene, observation, steps, s)
    result["events"] = _car_events(scene, passed, states.t, observation.s_o[steps], result["velocity"])
    return result


def observation_in_si(scene: Scene, observation: Observation, steps: NDArray[np.bool_], s: Array) -> dict[str, Any]:
    """The fields of a `Response` that are OBSERVED, without events.

    steps : which rows of the observation are steps (n,); the others are frames.  s : s/l of its stations (m,).
    """
    l = scene.length
    H = scene.horizontal_tension
    speed = l / scene.time_scale  # scale of velocities
    scale = {"t": scene.time_scale, "power": H * speed}
    scale |= dict.fromkeys(("slope_behind", "slope_ahead"), 1.0)
    scale |= dict.fromkeys(("s_o", "u", "v", "tension_min_at"), l)
    scale |= dict.fromkeys(("du", "dv"), speed)
    scale |= dict.fromkeys(("energy", "kinetic", "strain", "potential"), H * l)

    def scaled_rows(rows: Any, *names: str) -> dict[str, Any]:
        """Rows of the named ones, forces if nothing else."""
        return {name: scale.get(name, H) * getattr(observation, name)[rows] for name in names}

    at_frames = scaled_rows(~steps, "t", "s_o", *_TENSIONS)
    at_frames |= scaled_rows(slice(None), "u", "v", "du", "dv", "T", "T_pointwise")
    at_frames["mass_u"], at_frames["mass_v"] = l * observation.path[~steps].T
    x_rest, y_rest = scene.groups.coordinates(s)
    T_static = H * scene.groups.static_tension(s)
    return scaled_rows(steps, *_STEP_FORCES) | {
        "fields": Fields(**at_frames, s=l * s, x=l * x_rest, y=l * y_rest, T_static=T_static),
        "velocity": speed * observation.path_velocity[steps],
        "acceleration": speed / scene.time_scale * observation.path_acceleration[steps],
        "F_haul": H * observation.haul[steps],
        "powers": {name: H * speed * power[steps] for name, power in observation.powers.items()},
    }


def _nearest_index(times: Array, t: float) -> int:
    return int(np.argmin(np.abs(times - t)))


def _car_events(scene: Scene, passed: list[PassedEvent], t: Array, s_o: Array, velocity: Array) -> list[dict[str, Any]]:
    """Events of the car without stick-slip, with time [s], position [m] and speed [m/s] of the step next to them.

    passed : events of the march;  t, s_o : of the steps (n,), dimensionless;  velocity : (n, 2) [m/s].
    """
    drive = scene.groups.drive
    prescribed = [PassedEvent("release", drive.release)]
    prescribed += [PassedEvent("thrust_end", end) for end, _ in drive.thrust_table[-1:]]
    events = [event for event in prescribed if 0.0 < event.t <= t[-1]]
    for event in passed:
        if event.name == "stop":
            standstill = _time_of_lasting_standstill(scene, passed, t, s_o, event.t)
            events.append(PassedEvent("stop", standstill))
        elif event.name not in STICK_SLIP:
            events.append(event)
    if drive.mode == "free":
        events += [PassedEvent("turn", time) for time in _times_of_turning_back(t, s_o)]
    rows = []
    for event in sorted(events, key=lambda event: event.t):
        i = _nearest_index(t, event.t)
        row = {"event": event.name, "t": float(scene.time_scale * t[i]), "s_o": float(scene.length * s_o[i])}
        row["speed"] = 0.0 if event.name == "stop" else float(np.hypot(*velocity[i]))
        rows.append(row)
    return rows


def _time_of_lasting_standstill(scene: Scene, passed: list[PassedEvent], t: Array, s_o: Array, end: float) -> float:
    """Time of the first standstill after which the car stays; `end` if there is none."""
    round_trip = 2.0 / math.sqrt(scene.groups.alpha)  # of axial waves
    near = round_trip * scene.groups.drive.rest_speed_in_brakes(float(s_o[-1]), round_trip)
    for event in passed:
        if event.name == "standstill" and abs(s_o[_nearest_index(t, event.t)] - s_o[-1]) <= near:
            return event.t
    return end


def _times_of_turning_back(t: Array, s_o: Array) -> Iterator[float]:
    """The times at which a car turns back by more than SWING."""
    direction = 0.0
    farthest = 0
    for i, position in enumerate(s_o.tolist()):
        moved = position - s_o[farthest]
        if direction * moved < -SWING:
            yield float(t[farthest])
        if abs(moved) > SWING and direction * moved <= 0.0:
            direction = math.copysign(1.0, moved)
            farthest = i
        elif direction * moved > 0.0:
            farthest = i


def _select_states(states: States, rows: slice | NDArray[Any]) -> States:
    return States._make(x[rows] for x in states)


def times_of_frames(scene: Scene, t_last: float, frames: int = FRAMES) -> Array:
    """Times of the fields (k,): when a travel passes its marks, gaps filled; of a car that rolls also the end."""
    motion = scene.groups.motion
    if motion is None:
        nominal = scene.groups.drive.nominal
        t = nominal * np.arange(math.ceil(frames * t_last / nominal)) / frames
    else:
        t = _times_at_position_marks(motion, frames)
    t = t[t <= t_last]
    end_is_missing = scene.drive.mode != "grip" and t.size and t_last - t[-1] > 1e-9 * t_last
    return np.append(t, t_last) if end_is_missing else t


@lru_cache(maxsize=64)
def _times_at_position_marks(motion: Motion, frames: int) -> Array:
    """Times (k,) at which a travel passes s_o/l = 1/FRAMES, 2/FRAMES, ..., with at least `frames` intervals."""
    end_time = motion.end_time
    end = motion.position(np.array([end_time]))[0]
    marks = np.arange(1, FRAMES) / FRAMES
    on_the_way = (motion.start_position <= marks) & (marks < end)
    passed = motion.times_at_positions(marks[on_the_way])
    edges = np.unique(np.concatenate([[0.0], passed, [end_time]]))
    longest = end_time / frames
    filled = []
    for low, high in pairwise(edges.tolist()):
        count = math.ceil((high - low) / longest * (1.0 - 1e-9))
        filled.append(np.linspace(low, high, count, endpoint=False))
    first = 0 if motion.start_position > 0.0 else 1
    return np.concatenate(filled)[first:]


def _dense_states_around(history: History, states: States, t: Array) -> States:
    """States around t, with collocation steps in parts so that cubics suffice."""
    if not isinstance(history.states[states.t.size - 1], Collocated):
        return states
    steps = np.unique(np.clip(np.searchsorted(states.t, t), 1, states.t.size - 1))
    dense: list[State] = []
    parts = 6  # of a collocation step, for cubics
    for i in steps.tolist():
        dense += with_states_inside_steps([history.states[i - 1], history.states[i]], parts)
    return history.solver.states_over_time(stack_states(dense))


def _interpolated_states(states: States, t: Array) -> States:
    """States between steps by cubic Hermite in (q, v), without the accelerations, which alternate."""
    i = np.clip(np.searchsorted(states.t, t, side="left"), 1, states.t.size - 1)
    before = _select_states(states, i - 1)
    after = _select_states(states, i)
    dt = (after.t - before.t)[:, None]  # (k, 1)
    x = (t - before.t)[:, None] / dt
    a = (1.0 - x) * before.a + x * after.a  # (k, n_dof)
    return States(t, *interpolate_hermite(x, dt, before, after), a, after.phase)


def _observe_steps_and_frames(
    history: History, steps: States, frames: States, switch: float, s: Array
) -> tuple[Observation, NDArray[np.bool_]]:
    """Observe steps and frames together with the law in force; also which rows (n,) are steps."""
    observations = []
    is_step = []
    solvers = [history.solver] if history.after is None else [history.solver, history.after]
    for solver in solvers:
        before = solver is history.solver
        of_steps = _states_on_side(steps, switch, before)
        of_frames = _states_on_side(frames, switch, before)
        n = of_steps.t.size
        k = of_frames.t.size
        if n + k:
            together = States._make(map(np.concatenate, zip(of_steps, of_frames, strict=True)))
            observations.append(solver.observe(together, s, n + np.arange(k)))
            is_step.append(np.arange(n + k) < n)
    return Observation.concatenated(observations), np.concatenate(is_step)


def _states_on_side(states: States, switch: float, before: bool) -> States:
    """The states up to the time of a switch, or those after it."""
    end = int(np.searchsorted(states.t, switch, side="right"))
    return _select_states(states, slice(end) if before else slice(end, None))
