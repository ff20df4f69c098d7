"""From a solver's states to a Response in SI."""

import math
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cache, lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from cablefem import newmark
from cablefem.newmark import Collocated, Passed, State, StateHistory, Work, densified, hermite
from cablefem.response import Array, Fields, Observation, Once, Response, States
from cablefem.scene import Motion, Scene
from validation.core.solver import Solver

FRAMES = 200  # of the fields: at s_o/l = 1/FRAMES, 2/FRAMES, ..., and so often in time
STATIONS = 201  # least in the file contract
ON_CABLE = 1.0 + 1e-9  # largest s_o/l on the cable
WITHIN = 6  # parts of a collocation step, for cubics
OBSERVED = (
    "velocity", "acceleration", "slope_behind", "slope_ahead", "T_behind", "T_ahead", "T_behind_pointwise",
    "T_ahead_pointwise", "reaction_left", "reaction_right", "contact", "F_haul", "tension_min", "tension_min_at",
    "energy", "kinetic", "strain", "potential", "power", "powers", "fields", "events",
)  # fmt: skip

_threads = cache(ThreadpoolController)  # cached: slow


def one_thread() -> Any:
    """One BLAS thread while in force: the matrices are small."""
    return _threads().limit(limits=1)


@dataclass(slots=True)
class History:
    """States and costs of a march."""

    states: StateHistory
    work: Work
    seconds: float
    failure: tuple[str, str] | None  # cause and reason
    onset: tuple[int, float] | None  # of the first slack state, s/l
    solver: Solver
    after: Solver | None  # tension-only, from the onset on


def finite(h: History) -> States:
    """A history over time, cut and marked failed where it leaves finite numbers or the cable."""
    states = h.solver.in_time(stacked(h.states))
    sound = np.logical_and.reduce([np.isfinite(x).all(axis=1) for x in (states.q, states.v, states.a)])
    sound[-1] &= h.solver.position(h.states[-1]) <= ON_CABLE
    if sound.all():
        return states
    h.failure = "unstable", "the solution grew beyond all bounds; take more steps or a damped scheme"
    return _rows(states, slice(0, int(np.argmin(sound))))


def _ended(h: History, states: States, position: Array) -> dict[str, Any]:
    onset = _onset(h, states)
    work = ("steps", "rejected", "newton_iterations", "factorisations", "residuals")
    return {
        "status": "complete" if h.failure is None else "incomplete",
        "slack_onset": None if onset is None else float(position[onset[0]]),
        "work": {name: getattr(h.work, name) for name in work},
    }


def path_in_si(scene: Scene, t: Array, position: Array, w: Array) -> dict[str, Any]:
    """Fields of a `MassPath` from times, s_o and displacements (n, 2)."""
    l = scene.length
    X = scene.catenary
    s_o = l * position
    u, v = l * w.T
    return {
        "drive": scene.drive.mode, "length": l, "t": scene.time_scale * t, "s_o": s_o, "x": X.x(s_o) + u,
        "y": X.y(s_o) + v, "u": u, "v": v,
    }  # fmt: skip


def _onset(h: History, states: States) -> tuple[int, float] | None:
    return h.onset if h.onset is not None and h.onset[0] < states.t.size else None


def respond(scene: Scene, h: History, *, frames: int = FRAMES, **how: Any) -> Response:
    """The response of a history so far; all but the path is computed when it is looked at.

    how : the fields that say what was run;  frames : least number of instants with fields.
    """
    states = finite(h)
    onset = _onset(h, states)
    s_o, w = h.solver.path(states)
    ended = _ended(h, states, s_o)
    cause, reason = h.failure or (None, None)
    motion = scene.groups.motion
    breaks = [] if motion is None else [scene.time_scale * t for t, _ in motion.phases[1:] if t < states.t[-1]]
    observed = Once(partial(_observed, scene, copy(h), states, frames, list(h.work.events)))

    def look(name: str) -> Callable[[Response], Any]:
        return lambda r: observed()[name]

    return Response(
        **how, **ended, **path_in_si(scene, states.t, s_o, w), scene=scene.name, scene_toml=scene.to_toml(),
        horizontal_tension=scene.horizontal_tension, cause=cause, reason=reason,
        slack_at=None if onset is None else float(onset[1]),
        switched=None if h.after is None else ended["slack_onset"], breaks=breaks,
        n_dof=h.states[0].q.size, seconds=h.seconds, later={name: look(name) for name in OBSERVED},
    )  # fmt: skip


def _observed(scene: Scene, h: History, states: States, frames: int, events: list[Passed]) -> dict[str, Any]:
    """The fields of a `Response` that are OBSERVED."""
    n = states.t.size
    onset = _onset(h, states)
    switch = states.t[onset[0]] if onset is not None and h.after is not None else math.inf
    t = frame_times(scene, float(states.t[-1]), frames)
    with one_thread():
        at_frames = _between(_around(h, states, t), t) if t.size and n > 1 else _rows(states, slice(0, 0))
        s = np.linspace(0.0, 1.0, STATIONS)
        observed, steps = _observe(h, states, at_frames, switch, s)
    result = in_si(scene, observed, steps, s)
    result["events"] = _events(scene, events, states.t, observed.s_o[steps], result)
    return result


def in_si(scene: Scene, observed: Observation, steps: NDArray[np.bool_], s: Array) -> dict[str, Any]:
    """Fields of a `Response`; rows are `steps`, or frames with fields at stations s."""
    l = scene.length
    H = scene.horizontal_tension
    tau = scene.time_scale
    scale = {"t": tau, "slope_behind": 1.0, "slope_ahead": 1.0, "du": l / tau, "dv": l / tau, "power": H * l / tau}
    scale |= dict.fromkeys(("s_o", "u", "v", "tension_min_at"), l)
    scale |= dict.fromkeys(("energy", "kinetic", "strain", "potential"), H * l)

    def si(rows: Any, *names: str) -> dict[str, Any]:
        """The named ones, forces if nothing else."""
        return {name: scale.get(name, H) * getattr(observed, name)[rows] for name in names}

    x_rest, y_rest = scene.groups.shape(s)
    fields = Fields(
        **si(~steps, "t", "s_o", *_TENSIONS), **si(slice(None), "u", "v", "du", "dv", "T", "T_pointwise"), s=l * s,
        mass_u=l * observed.path[~steps, 0], mass_v=l * observed.path[~steps, 1], x=l * x_rest, y=l * y_rest,
        T_static=H * scene.groups.static(s)[0],
    )  # fmt: skip
    series = (
        "slope_behind", "slope_ahead", "energy", "power", "tension_min", "tension_min_at", "reaction_left",
        "reaction_right", "contact", "kinetic", "strain", "potential", *_TENSIONS,
    )  # fmt: skip
    return {
        "scene": scene.name,
        "scene_toml": scene.to_toml(),
        "horizontal_tension": H,
        "fields": fields,
        **path_in_si(scene, observed.t[steps], observed.s_o[steps], observed.path[steps]),
        "velocity": l / tau * observed.path_velocity[steps],
        "acceleration": l / tau**2 * observed.path_acceleration[steps],
        "F_haul": H * observed.haul[steps],
        "powers": {name: H * l / tau * x[steps] for name, x in observed.powers.items()},
        **si(steps, *series),
    }


def _at(times: Array, t: float) -> int:
    return int(np.argmin(np.abs(times - t)))


def _events(
    scene: Scene, passed: list[Passed], t: Array, s_o: Array, values: dict[str, Any]
) -> list[dict[str, Any]]:  # fmt: skip
    """Events of the car without stick-slip, with time [s], place [m] and speed [m/s] of the step next to them."""
    drive = scene.groups.drive
    phases = [("release", drive.release), *[("thrust_end", t) for t, _ in drive.thrust_table[-1:]]]
    times = [(name, at) for name, at in phases if 0.0 < at <= t[-1]]
    for e in passed:
        if e.name not in ("standstill", "breaking loose", "brake off", "turn"):
            times.append((e.name, _stopped(scene, passed, t, s_o, e.t) if e.name == "stop" else e.t))
    if drive.mode == "free":
        times += [("turn", x) for x in _turns(t, s_o)]
    rows = []
    for name, at in sorted(times, key=lambda event: event[1]):
        i = _at(t, at)
        speed = 0.0 if name == "stop" else float(np.hypot(*values["velocity"][i]))
        rows.append({"event": name, "t": float(values["t"][i]), "s_o": float(values["s_o"][i]), "speed": speed})
    return rows


def _stopped(scene: Scene, passed: list[Passed], t: Array, s_o: Array, end: float) -> float:
    """The first standstill that lasts; else the end of the ride."""
    near = scene.groups.drive.rest_speed * 2.0 / math.sqrt(scene.groups.alpha)  # the way in an axial round trip
    still = (e.t for e in passed if e.name == "standstill")
    return next((x for x in still if abs(s_o[_at(t, x)] - s_o[-1]) <= near), end)


SWING = 1e-3  # of the length: least way back after a turn


def _turns(t: Array, s_o: Array) -> Iterator[float]:
    sense = 0.0
    far = 0
    for i, position in enumerate(s_o.tolist()):
        gone = position - s_o[far]
        if sense * gone < -SWING:
            yield float(t[far])
        if abs(gone) > SWING and sense * gone <= 0.0:
            sense = math.copysign(1.0, gone)
            far = i
        elif sense * gone > 0.0:
            far = i


_TENSIONS = ("T_behind", "T_ahead", "T_behind_pointwise", "T_ahead_pointwise")


def stacked(states: Sequence[State]) -> States:
    return States(*newmark.stacked(states))


def _rows(states: States, rows: slice | NDArray[Any]) -> States:
    return States(states.t[rows], states.q[rows], states.v[rows], states.a[rows], states.phase[rows])


def frame_times(scene: Scene, t_last: float, frames: int = FRAMES) -> Array:
    """Times of the fields: when a travel passes its marks, gaps filled; of a car that rolls also the end."""
    motion = scene.groups.motion
    if motion is None:
        nominal = scene.groups.drive.nominal
        t = nominal * np.arange(math.ceil(frames * t_last / nominal)) / frames
    else:
        t = _passages(motion, frames)
    t = t[t <= t_last]
    ends = scene.drive.mode != "grip" and t.size and t_last - t[-1] > 1e-9 * t_last
    return np.append(t, t_last) if ends else t


@lru_cache(maxsize=64)
def _passages(motion: Motion, frames: int) -> Array:
    end = motion.position(np.array([motion.phases[-1][1]]))[0]
    marks = np.arange(1, FRAMES) / FRAMES
    longest = motion.phases[-1][1] / frames
    passed = motion.times_at(marks[(motion.start_position <= marks) & (marks < end)])
    known = np.unique(np.concatenate([[0.0], passed, [motion.phases[-1][1]]]))
    parts = np.ceil(np.diff(known) / longest * (1.0 - 1e-9)).astype(int)
    filled = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(known[:-1], known[1:], parts, strict=True)]
    return np.concatenate(filled)[0 if motion.start_position > 0.0 else 1 :]


def _around(h: History, states: States, t: Array) -> States:
    """States around t, with collocation steps in parts so that cubics suffice."""
    if not isinstance(h.states[states.t.size - 1], Collocated):
        return states
    steps = np.unique(np.clip(np.searchsorted(states.t, t), 1, states.t.size - 1)).tolist()
    parts = [x for i in steps for x in densified([h.states[i - 1], h.states[i]], WITHIN)]
    return h.solver.in_time(stacked(parts))


def _between(h: States, t: Array) -> States:
    """States between steps by cubic Hermite in (q, v), without the accelerations, which alternate."""
    i = np.clip(np.searchsorted(h.t, t, side="left"), 1, h.t.size - 1)
    before = _rows(h, i - 1)
    after = _rows(h, i)
    dt = (after.t - before.t)[:, None]
    x = (t - before.t)[:, None] / dt
    return States(t, *hermite(x, dt, before, after), (1.0 - x) * before.a + x * after.a, after.phase)


def _observe(
    h: History, steps: States, frames: States, switch: float, s: Array
) -> tuple[Observation, NDArray[np.bool_]]:
    """Observe steps and frames together with the law in force; also tells which rows are steps."""
    parts = []
    is_step = []
    for solver, late in ((h.solver, False), (h.after, True)):
        mine = []
        for x in (steps, frames):
            taut = int(np.searchsorted(x.t, switch, side="right"))
            mine.append(_rows(x, slice(taut, None) if late else slice(taut)))
        n, k = (x.t.size for x in mine)
        if solver is not None and n + k:
            both = States(*(np.concatenate([getattr(x, name) for x in mine]) for name in States.__dataclass_fields__))
            parts.append(solver.observe(both, s, n + np.arange(k)))
            is_step.append(np.arange(n + k) < n)
    return Observation.joined(parts), np.concatenate(is_step)
