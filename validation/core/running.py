"""One run of one method on one scene: from names and settings to a Response in SI units."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache
from typing import Any

import numpy as np
from threadpoolctl import ThreadpoolController

from cablefem import newmark
from cablefem.newmark import EndlessEvents, NewtonStalled, Scheme, State, StepFailure, StepUnderflow, Work
from cablefem.response import Array, Response
from cablefem.scene import Groups, Scene
from validation.core.methods import Method, find
from validation.core.sampling import History, respond
from validation.core.solver import Solver
from validation.core.watch import watched

# Damping of the undamped schemes once the cable is slack.  With 0.55 the path between onset and s_o/l = 0.95 has half
# the error on the level scene, but at V/c = 0.8 a fine run (40 elements, 4000 steps) gained 30 times its energy.
SLACK_GAMMA = 0.6

Progress = Callable[[float], None]

_threads = cache(ThreadpoolController)  # finding the libraries takes longer than many a run


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
    if until is not None and not until > 0.0:
        raise ValueError(f"until must be a place s_o/l > 0, got {until!r}")
    groups = scene.groups
    if groups.motion is None and groups.drive.mode != "free":
        raise ValueError(f"scene {scene.name!r} has no travelling mass: only its frequencies can be computed")
    method = find(method) if isinstance(method, str) else method
    settings = method.settings_on(groups, settings)
    scheme = newmark.scheme(settings["scheme"], newmark_gamma=settings["newmark_gamma"], rho_inf=settings["rho_inf"])
    kind = {"model": model, "load": load}
    with _threads().limit(limits=1):  # the matrices are small: threads cost more than they give
        solver = method.build(groups, settings, **kind, law="tension-only" if law == "tension-only" else "elastic")
        times = steps_of(solver, groups, settings)
        switch = law == "auto" and scheme.implicit
        history = _march(solver, scheme, times, switch, until or math.inf, progress or (lambda done: None))
        response = respond(scene, history, method=method.name, settings=settings, **kind, law=law)
        return watched(response, scene, method)


def steps_of(solver: Solver, groups: Groups, settings: dict[str, Any]) -> list[Array]:
    """Return the instants to step on, phase by phase."""
    steps = settings["steps"]
    if groups.motion is None:  # a ride may last longer than it should
        steps = math.ceil(steps * (solver.phases[-1][1] - solver.phases[0][0]) / groups.drive.nominal)
    times = newmark.step_times(solver, steps, entry=settings["entry"], exit=settings["exit"])
    if groups.drive.mode != "grip":  # a ride ends off the support, where all has its meaning
        times[-1] = np.append(times[-1], solver.phases[-1][1])
    return times


def _march(
    solver: Solver, scheme: Scheme, times: Sequence[Array], switch: bool, until: float, progress: Progress
) -> History:  # fmt: skip
    """Step through the travel, watching the least tension; after the slack onset go on with the other law."""
    h = History([], Work(), 0.0, None, None, solver, None)
    with suppress(StepFailure):  # compiled code is loaded when first called, which is no step's cost
        for _ in zip(newmark.integrate(solver, scheme, times), range(2), strict=False):
            pass
    begin = time.perf_counter()
    try:
        if _advance(h, solver, scheme, times, switch, until, progress):
            h.after = solver.with_law("tension-only")
            damped = scheme if scheme.damps else newmark.scheme("newmark", newmark_gamma=SLACK_GAMMA)
            _advance(h, h.after, damped, times, False, until, progress)
    except StepFailure as error:
        h.failure = _cause(error, h.onset is not None, h.after is not None)
        if not h.states:  # no start: all there is is the hanging cable
            rest = np.zeros(solver.n_dof)
            h.states.append(State(solver.phases[0][0], rest, rest, rest))
    h.seconds = time.perf_counter() - begin
    progress(1.0)
    return h


def _advance(
    h: History, solver: Solver, scheme: Scheme, times: Sequence[Array], switch: bool, until: float, progress: Progress
) -> bool:  # fmt: skip
    """Append states up to the end, to `until` or, if the law is to switch, to the slack onset; return whether it is."""
    t0, t1 = solver.phases[0][0], solver.phases[-1][1]
    start = h.states[-1] if h.states else None
    for state in newmark.integrate(solver, scheme, times, work=h.work, start=start):
        h.states.append(state)
        place = solver.place(state)
        if len(h.states) % 32 == 0:
            progress(max((state.t - t0) / (t1 - t0), place / until))
        if place >= until:
            return False
        if h.onset is None and len(h.states) > 1 and solver.least_tension[0] < 0.0:
            h.onset = len(h.states) - 1, solver.least_tension[1]
            if switch:
                return True
    return False


def _cause(error: StepFailure, slack: bool, switched: bool) -> tuple[str, str]:
    """Name what stopped a run, and say what to try."""
    if isinstance(error, StepUnderflow):
        return "step underflow", f"{error.cause}; {error.advice}"
    if isinstance(error, EndlessEvents):
        return "endless events", f"{error.cause}; {error.advice}"
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
