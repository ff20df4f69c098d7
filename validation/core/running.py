"""One run of one method on one scene, to a Response in SI."""

import bisect
import math
import time
from collections.abc import Iterator, Sequence
from functools import partial
from numbers import Real
from typing import Any

import numpy as np

from cablefem import newmark
from cablefem.newmark import (
    EndlessEvents,
    Newton,
    NewtonStalled,
    Scheme,
    State,
    StateHistory,
    StepFailure,
    StepUnderflow,
    Work,
)
from cablefem.response import Array, Response
from cablefem.scene import Groups, Scene
from validation.core.flags import with_energy_gain_flags_and_cause
from validation.core.methods import Method, find_method
from validation.core.sampling import FRAMES, History, Onset, limited_to_one_blas_thread, response_of_history
from validation.core.sidebyside import Progress, no_progress
from validation.core.solver import Solver

# for rules that do not damp, on the slack cable; Newmark's damping is of first order
ON_SLACK = newmark.scheme("generalized-alpha", rho_inf=0.8)
# Undamped rules turn Newton's residual into energy that stays.
TRAPEZOIDAL_NEWTON = Newton(tol=1e-6)

_EMPTY = np.empty(0)


def run(
    scene: Scene,
    method: str | Method,
    *,
    until: float | None = None,
    progress: Progress = no_progress,
    **options: Any,
) -> Response:
    """Run one method on one scene; see `Run`."""
    return Run(scene, method, **options).run_to(until, progress)


class Run:
    """One method on one scene, marched up to a position, and later further.

    method, settings : a name from `METHODS` and changes to its defaults.
    model : "full", "stretching", "sagged" or "string"; load : "mass" or "force".
    law : "elastic", "tension-only" or "auto": elastic until slack, then tension-only by a rule that damps.
        Central differences never switch: their slack is instability.

    frames : least number of instants at which the fields of the cable are kept.

    Raises ValueError for invalid settings.
    """

    def __init__(
        self, scene: Scene, method: str | Method, *, model: str = "full", load: str = "mass", law: str = "auto",
        frames: int = FRAMES, **settings: Any,
    ) -> None:  # fmt: skip
        groups = scene.groups
        _refuse_bad_arguments(scene, law, frames)
        self.scene = scene
        self.method = find_method(method)
        self.frames = frames
        self.settings = settings = self.method.settings_for_scene(groups, settings)
        self.run_options = {"model": model, "load": load, "law": law}
        self.scheme = newmark.scheme(
            settings["scheme"], newmark_gamma=settings["newmark_gamma"], rho_inf=settings["rho_inf"]
        )
        self.switches_when_slack = law == "auto" and self.scheme.implicit
        first_law = "elastic" if law == "auto" else law
        solver = self.method.build(groups, settings, model=model, load=load, law=first_law)
        if solver.at_support and groups.motion is not None and groups.motion.start_position > 0.0:
            raise ValueError(f"not yet: travel.from with {self.method.name}; take following-p2 or fourier-kink")
        self.times = step_times_of_phases(solver, groups, settings)
        self.history = History(StateHistory(), Work(), 0.0, None, None, solver, None)
        self._ended = False
        self._latest: tuple[tuple[int, Any], Response] | None = None  # states, failure and their response

    def run_to(self, until: float | None = None, progress: Progress = no_progress) -> Response:
        """March to the first step at or past s_o/l = until (default: the end); return the response so far.

        A failed run has status "incomplete" and the reason.  Energy gained without work is flagged.
        """
        self.march_until_end_or_failure(until, progress)
        return self.response_so_far()

    def response_so_far(self) -> Response:
        """The response so far; all but the path is computed when it is looked at."""
        now = len(self.history.states), self.history.failure
        if self._latest is None or self._latest[0] != now:
            options = {"method": self.method.name, "settings": self.settings, **self.run_options}
            response = response_of_history(self.scene, self.history, frames=self.frames, **options)
            self._latest = now, with_energy_gain_flags_and_cause(response, self.scene, self.method)
        return self._latest[1]

    def march_until_end_or_failure(self, until: float | None, progress: Progress = no_progress) -> None:
        """Compute states to s_o/l = until; a failure ends the run with its reason."""
        if until is not None and not (isinstance(until, Real) and until > 0.0):
            raise ValueError(f"until must be a place s_o/l > 0, got {until!r}")
        if self._ended:
            return
        self._ended = until is None
        h = self.history
        begin = time.perf_counter()
        try:
            if h.failure is None:
                with limited_to_one_blas_thread():
                    self._march_with_law_switch(until or math.inf, progress)
        except StepFailure as error:
            h.failure = _failure_cause_and_reason(error, h.onset is not None, h.after is not None)
            if not h.states:  # only the hanging cable
                rest = np.zeros(h.solver.n_dof)
                h.states.append(State(h.solver.phases[0][0], rest, rest, rest))
        h.seconds += time.perf_counter() - begin
        progress(1.0)

    def _march_with_law_switch(self, until: float, progress: Progress) -> None:
        """March to s_o/l = `until`; from the slack onset on with the tension-only law, if law is "auto"."""
        h = self.history
        if h.after is None and self._march_solver(h.solver, self.scheme, until, progress, self.switches_when_slack):
            h.after = h.solver.with_law("tension-only")
        if h.after is not None:
            # collocation loses its order at the law's kink
            goes_on = self.scheme.damps and not self.scheme.nodes
            damped = self.scheme if goes_on else ON_SLACK
            self._march_solver(h.after, damped, until, progress)

    def _march_solver(
        self, solver: Solver, scheme: Scheme, until: float, progress: Progress, stop_at_slack: bool = False
    ) -> bool:
        """Append states up to the end or `until`, or to the slack onset if asked; return whether it stopped there."""
        h = self.history
        for states in self._blocks_of_new_states(solver, scheme, until):
            h.states.extend(states)
            position = solver.position(states[-1])
            if len(h.states) % 32 < len(states):
                progress(max(_fraction_of_duration(solver, states[-1].t), position / until))
            if self._note_slack_onset(solver) and stop_at_slack:
                return True
            if position >= until and self.scene.groups.motion is None:  # otherwise the times end there
                break
        return False

    def _blocks_of_new_states(self, solver: Solver, scheme: Scheme, until: float) -> Iterator[Sequence[State]]:
        """States after the last one; those of a prescribed travel end at s_o/l = `until`."""
        h = self.history
        start = h.states[-1] if h.states else None
        if start is not None and solver.position(start) >= until:
            return
        free = self.scene.groups.motion is None
        newton = TRAPEZOIDAL_NEWTON if free and scheme.name == "trapezoidal" else Newton()
        times = self.step_times_until_position(until)
        yield from newmark.integrate_blocks(solver, scheme, times, newton=newton, work=h.work, start=start)

    def _note_slack_onset(self, solver: Solver) -> bool:
        """Note the slack onset if the last state is the first slack one, and return whether it is."""
        h = self.history
        if h.onset is not None or len(h.states) < 2:
            return False
        tension, s = solver.min_tension_and_position
        if tension < 0.0:
            h.onset = Onset(len(h.states) - 1, s)
            solver.slack_ends = False  # here and in copies: no later one is looked for
        return tension < 0.0

    def step_times_until_position(self, until: float) -> list[Array]:
        """The step times up to s_o/l = until."""
        if self.scene.groups.motion is None or until >= 1.0:
            return self.times

        def position(t: float, phase: int) -> float:
            return self.history.solver.position(State(t, _EMPTY, _EMPTY, _EMPTY, phase))

        times = []
        for k, t in enumerate(self.times):
            reached = position(t[0], k) >= until  # in an earlier phase
            end = 0 if reached else bisect.bisect_left(t, until, key=partial(position, phase=k)) + 1
            times.append(t[:end])
        return times


def _refuse_bad_arguments(scene: Scene, law: str, frames: int) -> None:
    """Raise ValueError for arguments of `Run` out of their range, and for a scene without travelling mass."""
    if law not in ("elastic", "tension-only", "auto"):
        raise ValueError(f"law must be elastic, tension-only or auto, got {law!r}")
    max_frames = 20_000  # 300 MB
    if not (isinstance(frames, int) and 2 <= frames <= max_frames):
        raise ValueError(f"frames must be a whole number from 2 to {max_frames}, got {frames!r}")
    if scene.groups.motion is None and scene.drive.mode != "free":
        raise ValueError(f"scene {scene.name!r} has no travelling mass: only its frequencies can be computed")


def step_times_of_phases(solver: Solver, groups: Groups, settings: dict[str, Any]) -> list[Array]:
    """Step times of each phase (n,)."""
    steps = settings["steps"]
    if groups.motion is None:  # rides may last longer
        duration = solver.phases[-1][1] - solver.phases[0][0]
        steps = math.ceil(steps * duration / groups.drive.nominal)
    times = newmark.step_times_by_phase(solver, steps, entry_ratio=settings["entry"], exit_ratio=settings["exit"])
    if groups.motion is None or groups.motion.end_position < 1.0:  # ends off the support
        times[-1] = np.append(times[-1], solver.phases[-1][1])
    return times


def _fraction_of_duration(solver: Solver, t: float) -> float:
    """Fraction of the duration up to t."""
    begin = solver.phases[0][0]
    return (t - begin) / (solver.phases[-1][1] - begin)


def _failure_cause_and_reason(error: StepFailure, slack: bool, switched: bool) -> tuple[str, str]:
    """The kind of a failure, and its reason in words."""
    kinds = {StepUnderflow: "step underflow", EndlessEvents: "endless events", NewtonStalled: "Newton stalled"}
    kind = next((kind for cause, kind in kinds.items() if isinstance(error, cause)), "no start")
    if kind != "Newton stalled":
        return kind, f"{error.cause}; {error.advice}"
    if switched:
        return "slack", (
            f"{error.cause} on the slack cable; the answer up to there stands: more steps or a damped scheme may go "
            "on, but close to the far support refinement does not converge any more"
        )
    if slack:
        return "slack", f"{error.cause}: the cable is slack and its elastic law carries compression; take law = auto"
    return kind, f"{error.cause}; {error.advice}, or the tension-only law for a slack cable"
