"""One run of one method on one scene: from names and settings to a Response in SI units."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from cablefem import newmark
from cablefem.newmark import NewtonStalled, Scheme, State, StepFailure, StepUnderflow, Work
from cablefem.response import Array, Fields, Flag, Observation, Response, States
from cablefem.scene import Scene
from validation.core import measures
from validation.core.flags import flag
from validation.core.methods import Method, find

FRAMES = 100  # fields are kept at s_o/l = 0, 1/FRAMES, 2/FRAMES, ... of every run, so that runs can be compared
STATIONS = 201  # the file contract's least number of fixed s

# Damping of the undamped schemes once the cable is slack.  With 0.55 the path between onset and s_o/l = 0.95 has half
# the error on the level scene, but at V/c = 0.8 a fine run (40 elements, 4000 steps) gained 30 times its energy.
SLACK_GAMMA = 0.6

Progress = Callable[[float], None]


def run(
    scene: Scene, method: str | Method, *, model: str = "full", load: str = "mass", law: str = "auto",
    until: float | None = None, progress: Progress | None = None, **settings: Any,
) -> Response:  # fmt: skip
    """Run one method on one scene and return its Response.

    method, settings : a name from `METHODS` and changes to its default settings.
    model : "full", "stretching", "sagged" or "string"; load : "mass" or "force".
    law : "elastic", "tension-only", or "auto": elastic until the cable goes slack, from there on tension-only
        with Newmark's damping (unless the scheme damps by itself), because an elastic law that carries compression is
        ill-posed.  Central differences never switch: their slack is their own instability.
    until : s_o/l; the run is over after the first step at or past it.  Comparisons need no more than
        `measures.WINDOW[1]`, and the steps of a slack cable cost the most.

    A run that cannot go on comes back with status "incomplete" and the reason; what was computed before is kept.
    A run that gains energy it was not given comes back flagged.
    Raises ValueError for settings that make no sense.
    """
    if law not in ("elastic", "tension-only", "auto"):
        raise ValueError(f"law must be elastic, tension-only or auto, got {law!r}")
    if scene.mass is None or scene.travel is None:
        raise ValueError(f"scene {scene.name!r} has no travelling mass: only its frequencies can be computed")
    if isinstance(method, str):
        method = find(method)
    settings = method.settings(settings)
    scheme = newmark.scheme(settings["scheme"], newmark_gamma=settings["newmark_gamma"], rho_inf=settings["rho_inf"])
    with threadpool_limits(1):  # the matrices are small: threads cost more than they give
        system = method.build(
            scene.groups, settings, model=model, load=load, law="tension-only" if law == "tension-only" else "elastic"
        )
        times = newmark.step_times(system, settings["steps"], entry=settings["entry"], exit=settings["exit"])
        history = _march(system, scheme, times, law == "auto", _stop(scene, system, until), progress)
        return watched(_respond(scene, method, settings, model, load, law, system, history), scene)


# Energy gained over the range the energy runs through anyway, before the slack onset.  On the level cable at V/c from
# 0.4 to 1.5 runs with a right path gained up to 0.12; with Coriolis terms left out, an undamped constraint or too long
# explicit steps 0.6 to 10^8 (a wrong but stable method is not seen by its energy).
MOST_GAIN = 0.2
# The same after the onset, where the cable whips: runs that agree gain up to 1.4, runs that do not 9 and more.
MOST_GAIN_SLACK = 2.0
SLACK_END = 0.95  # s_o/l to which the energy is watched after the onset


def watched(r: Response, scene: Scene) -> Response:
    """Return the response with the energy it gained without being given it before the law changed, and its flags."""
    assert scene.mass is not None
    stop = min(measures.WINDOW[1], r.reached, math.inf if r.switched is None else r.switched)
    if r.t.size < 3 or not r.max_deflection > 0.0:
        return r
    weight = scene.mass.mass * scene.gravity
    unit = max(1.0, float(np.ptp(r.energy[measures.inside(r, (0.0, stop))])) / (weight * r.max_deflection))
    gain = measures.energy_gain(r, weight, (0.0, stop))
    flags = []
    if scene.speed_ratio is not None and scene.speed_ratio >= 1.0:
        # level cable: bars are half the true error at V/c = 1.1, and at 1.5 refinement drives the paths apart
        flags.append(flag("fast", speed_ratio=scene.speed_ratio))
    flags += _hidden_slack(r)
    if not gain <= MOST_GAIN * unit:
        flags.append(flag("energy", gain=gain / unit, allowed=MOST_GAIN))
        if r.cause is not None:
            r = replace(r, cause="unstable", reason=f"{flags[-1]}; it broke at s_o/l = {r.reached:.3f}")
    elif r.switched is not None and r.switched < SLACK_END:
        later = measures.energy_gain(r, weight, (r.switched, SLACK_END))
        if not later <= MOST_GAIN_SLACK * unit:
            flags.append(flag("slack energy", gain=later / unit, since=r.switched))
    return replace(r, energy_gain=gain, flags=flags)


# s_o/l between compression at a point and in the mean of an element: on 65 random scenes points were first by at most
# 0.01 where the cable fell slack; on one it never did and refinement left the path 0.6 percent apart.
HIDDEN = 0.03


def _hidden_slack(r: Response) -> list[Flag]:
    """Return a flag if a piece shorter than an element is under compression and the cable not slack soon after.

    For methods that resolve the kink at the mass: the others ripple.
    """
    method = find(r.method)
    if method.wing != "elements" or method.space_order < 2.0:
        return []
    end = min(measures.WINDOW[1], r.reached, math.inf if r.slack_onset is None else r.slack_onset - HIDDEN)
    pressed = np.flatnonzero(measures.inside(r, (0.0, end)) & (r.tension_min < 0.0))
    if not pressed.size:
        return []
    first, most = pressed[0], r.tension_min[pressed].min() / r.horizontal_tension
    since, at = r.s_o[first] / r.length, r.tension_min_at[first] / r.length
    return [flag("hidden slack", most=float(-most), since=float(since), at=float(at))]


@dataclass(slots=True)
class _History:
    states: list[State]
    work: Work
    seconds: float
    failure: tuple[str, str] | None  # cause and reason
    onset: tuple[int, float] | None  # index of the state, s/l
    system_after: Any  # the system with the tension-only law, from the onset on


def _stop(scene: Scene, system: Any, until: float | None) -> float:
    """Return the instant (place, where that is the independent variable) at which the mass has come to `until`."""
    motion = scene.groups.motion
    assert motion is not None
    if until is None or until >= motion.end:
        return math.inf
    if not until > 0.0:
        raise ValueError(f"until must be a place s_o/l > 0, got {until!r}")
    return until if hasattr(system, "time_states") else motion.time_at(until)


def _march(
    system: Any, scheme: Scheme, times: Any, switch: bool, stop: float, progress: Progress | None
) -> _History:  # fmt: skip
    """Step through the travel, watching the least tension; after the slack onset go on with the other law."""
    work, states, onset, failure, after = Work(), [], None, None, None
    end = min(stop, system.phases[-1][1])
    switch = switch and scheme.newmark_beta > 0.0
    with suppress(
        StepFailure
    ):  # a step for nothing: compiled code is loaded when first called, which is no step's cost
        for _ in zip(newmark.integrate(system, scheme, times), range(2), strict=False):
            pass
    begin = time.perf_counter()
    advance: Iterable[State] = newmark.integrate(system, scheme, times, work=work)
    try:
        for state in advance:
            states.append(state)
            if progress is not None and len(states) % 32 == 0:
                progress(state.t / end)
            if state.t >= stop:
                break
            if onset is None and len(states) > 1 and system.least_tension[0] < 0.0:
                onset = (len(states) - 1, system.least_tension[1])
                if switch:
                    break
        if onset is not None and switch:
            after = system.with_law("tension-only")
            damped = newmark.scheme("newmark", newmark_gamma=SLACK_GAMMA) if scheme.newmark_gamma <= 0.5 else scheme
            for state in newmark.integrate(after, damped, times, work=work, start=states[-1]):
                states.append(state)
                if progress is not None and len(states) % 32 == 0:
                    progress(state.t / end)
                if state.t >= stop:
                    break
    except StepFailure as error:
        failure = _cause(error, onset is not None, after is not None)
        if not states:  # no start: all there is is the hanging cable
            rest = np.zeros(system.n_dof)
            states.append(State(system.phases[0][0], rest, rest, rest))
    seconds = time.perf_counter() - begin
    if progress is not None:
        progress(1.0)
    return _History(states, work, seconds, failure, onset, after)


def _cause(error: StepFailure, slack: bool, switched: bool) -> tuple[str, str]:
    """Name what stopped a run, and say what to try."""
    if isinstance(error, StepUnderflow):
        return "step underflow", f"{error.cause}; {error.advice}"
    if not isinstance(error, NewtonStalled):
        return "no start", f"{error.cause}; {error.advice}"
    if switched:
        return "slack", (
            f"{error.cause} on the slack cable; the answer up to there stands: more steps or a damped scheme may go "
            "on, but close to the far support refinement does not converge any more"
        )
    if slack:
        return "slack", f"{error.cause}: the cable is slack and its elastic law carries compression; take law = auto"
    return "Newton stalled", f"{error.cause}; {error.advice}, or the tension-only law for a slack cable"


def _stack(states: list[State]) -> States:
    return States(
        np.array([x.t for x in states]), np.array([x.q for x in states]), np.array([x.v for x in states]),
        np.array([x.a for x in states]), np.array([x.phase for x in states]),
    )  # fmt: skip


def _between(h: States, t: Array) -> States:
    """Return states at instants between the steps, cubic Hermite in (q, v).

    Accelerations stay out of it: those of unresolved axial waves alternate from step to step.  The phase is that of
    the step's end, so that the drive's acceleration is the one the step was taken with.
    """
    i = np.clip(np.searchsorted(h.t, t, side="left"), 1, h.t.size - 1)
    dt = (h.t[i] - h.t[i - 1])[:, None]
    x = (t - h.t[i - 1])[:, None] / dt
    q0, q1, v0, v1 = h.q[i - 1], h.q[i], dt * h.v[i - 1], dt * h.v[i]
    d = q1 - q0
    q = q0 + x * (v0 + x * (3.0 * d - 2.0 * v0 - v1 + x * (v0 + v1 - 2.0 * d)))
    v = (v0 + x * (2.0 * (3.0 * d - 2.0 * v0 - v1) + x * 3.0 * (v0 + v1 - 2.0 * d))) / dt
    a = (1.0 - x) * h.a[i - 1] + x * h.a[i]
    exact = (t == h.t[i])[:, None]
    return States(t, np.where(exact, h.q[i], q), np.where(exact, h.v[i], v), np.where(exact, h.a[i], a), h.phase[i])


def _frames(scene: Scene, t_last: float) -> Array:
    motion = scene.groups.motion
    assert motion is not None
    end = motion.position(np.array([motion.phases[-1][1]]))[0]
    marks = np.arange(1, FRAMES) / FRAMES
    t = np.array([motion.time_at(mark) for mark in marks[marks < end]])
    return t[t <= t_last]


def _respond(scene, method, settings, model, load, law, system, h: _History) -> Response:
    states, after = _stack(h.states), h.system_after
    if hasattr(system, "time_states"):  # s_o was the independent variable
        states, system = system.time_states(states), system.system
        after = None if after is None else after.system
    finite = np.isfinite(states.q).all(axis=1) & np.isfinite(states.v).all(axis=1) & np.isfinite(states.a).all(axis=1)
    if not finite.all():
        first = int(np.argmin(finite))
        states = States(states.t[:first], states.q[:first], states.v[:first], states.a[:first], states.phase[:first])
        h.failure = "unstable", "the solution grew beyond all bounds; take more steps or a damped scheme"
    motion = scene.groups.motion
    assert motion is not None
    s = np.linspace(0.0, 1.0, STATIONS)
    t_frames = _frames(scene, float(states.t[-1]))
    at_frames = _between(states, t_frames) if states.t.size > 1 else _take(states, slice(0, 0))
    switch_t = states.t[h.onset[0]] if h.onset is not None and after is not None else math.inf
    none = np.array([], dtype=np.intp)
    steps = _observe(system, after, states, switch_t, s, none)
    frames = _observe(system, after, at_frames, switch_t, s, np.arange(t_frames.size))
    l, H, tau = scene.length, scene.horizontal_tension, scene.time_scale
    s_o = motion.position(states.t)
    X = scene.catenary
    onset = None if h.onset is None or h.onset[0] >= states.t.size else float(s_o[h.onset[0]])
    cause, reason = (None, None) if h.failure is None else h.failure
    x_rest, y_rest = scene.groups.shape(s)
    fields = Fields(
        x=l * x_rest, y=l * y_rest, T_static=H * scene.groups.static(s)[0],
        t=tau * t_frames, s_o=l * motion.position(t_frames), s=l * s, u=l * frames.u, v=l * frames.v,
        du=l / tau * frames.du, dv=l / tau * frames.dv, T=H * frames.T,
        T_behind=H * frames.T_behind, T_ahead=H * frames.T_ahead,
        mass_u=l * frames.path[:, 0], mass_v=l * frames.path[:, 1], T_pointwise=H * frames.T_pointwise,
        T_behind_pointwise=H * frames.T_behind_pointwise, T_ahead_pointwise=H * frames.T_ahead_pointwise,
    )  # fmt: skip
    return Response(
        scene=scene.name, scene_toml=scene.to_toml(), method=method.name, settings=settings, model=model, load=load,
        law=law, status="complete" if h.failure is None else "incomplete", cause=cause, reason=reason,
        slack_onset=onset,
        slack_at=None if onset is None or h.onset is None else float(h.onset[1]),
        switched=onset if after is not None else None, length=l, horizontal_tension=H,
        t=tau * states.t, s_o=l * s_o, x=X.x(l * s_o) + l * steps.path[:, 0], y=X.y(l * s_o) + l * steps.path[:, 1],
        u=l * steps.path[:, 0], v=l * steps.path[:, 1], T_behind=H * steps.T_behind, T_ahead=H * steps.T_ahead,
        velocity=l / tau * steps.path_velocity, acceleration=l / tau**2 * steps.path_acceleration,
        slope_behind=steps.slope_behind, slope_ahead=steps.slope_ahead, energy=H * l * steps.energy,
        power=H * l / tau * steps.power, tension_min=H * steps.tension_min, tension_min_at=l * steps.tension_min_at,
        T_behind_pointwise=H * steps.T_behind_pointwise, T_ahead_pointwise=H * steps.T_ahead_pointwise,
        reaction_left=H * steps.reaction_left, reaction_right=H * steps.reaction_right,
        contact=H * steps.contact, F_haul=H * steps.haul, kinetic=H * l * steps.kinetic, strain=H * l * steps.strain,
        potential=H * l * steps.potential, powers={name: H * l / tau * power for name, power in steps.powers.items()},
        fields=fields, n_dof=system.n_dof, seconds=h.seconds,
        work={
            "steps": h.work.steps, "rejected": h.work.rejected, "newton_iterations": h.work.newton_iterations,
            "factorisations": h.work.factorisations, "residuals": h.work.residuals,
        },
    )  # fmt: skip


def _take(states: States, rows: Any) -> States:
    return States(states.t[rows], states.q[rows], states.v[rows], states.a[rows], states.phase[rows])


def _observe(system, after, states: States, switch_t: float, s: Array, frames) -> Observation:
    """Observe with the law that was in force: the elastic one up to and including the onset."""
    late = states.t > switch_t
    if after is None or not late.any():
        return system.observe(states, s, frames)
    if late.all():
        return after.observe(states, s, frames)
    n = int(np.argmax(late))
    parts = [
        system.observe(_take(states, slice(0, n)), s, frames[frames < n]),
        after.observe(_take(states, slice(n, None)), s, frames[frames >= n] - n),
    ]
    return Observation.joined(parts)
