"""Speed against accuracy of all methods, models, integrators and other codes (chart.toml).

Reference: far finer than the chart, in the window of comparison or up to the slack onset.
Path error: largest distance over the largest deflection (of a free ride at equal times, over a tenth of the length).
Tension error: rms off the mass, over H.
Seconds: time loop up to the end of the window, best of separate runs on one core, without what others took of it.
Lines of kind "waiting": processor time of all that a user waits for, from a fresh interpreter on.
"""

from __future__ import annotations

import platform
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from threadpoolctl import threadpool_limits

from cablefem import newmark
from cablefem.newmark import SCHEMES
from cablefem.response import Response, write_json, write_text
from cablefem.scene import Groups, Scene
from validation.commands.chart.cost import iteration_cost_over_bare_solve
from validation.commands.chart.front import Row, fastest_methods_at_error
from validation.core import measures, store
from validation.core.measures import NotComparable, Window
from validation.core.methods import METHODS, Method, scaled_settings
from validation.core.refine import TooCoarse, refine_to_tolerance, run_with_error_bars
from validation.core.running import Run, run
from validation.core.sidebyside import Progress, no_progress
from validation.page.page import package_versions
from validation.peers import PEERS, PeerPath, import_failure_reason

Settings = dict[str, Any]  # of a method or another code
STOP = measures.WINDOW[1]
SETTINGS = store.read_packaged_toml(__package__, "chart.toml")
REFERENCE = SETTINGS["reference"]
REFERENCE_OF_RIDES = SETTINGS["reference_of_rides"]
WITNESS = SETTINGS["witness"]
BASE = SETTINGS["base"]
FINER = tuple(2.0 ** (0.5 * k) for k in range(-3, 4))  # over the default resolution
FULL_PROGRAM = ", whole"  # short, for legends
RESULTS = (  # of a row, None where there is none
    "reason", "reached", "path_error", "path_rms", "tension_error", "seconds", "spread", "repeats", "n_dof",
    "steps", "newton_iterations", "factorisations", "unknown_steps", "wait",
)  # fmt: skip
DENSE = tuple(2.0 ** (-0.25 * k) for k in range(8, -1, -1))  # shares of steps, for short runs


@dataclass(frozen=True, slots=True)
class Series:
    """One line of the chart, its rungs from coarse to fine."""

    name: str
    kind: str  # "method" | "model" | "integrator" | "tolerance" | "waiting" | "peer"
    rungs: tuple[Settings, ...]  # of its runs
    method: str | None = None  # None: another code
    model: str = "full"

    def chart_row(self, settings: Settings, **results: Any) -> Row:
        """A row of chart.json; results that are not given are None."""
        row: Row = {"series": self.name, "kind": self.kind, "method": self.method, "model": self.model}
        return row | {"settings": settings} | dict.fromkeys(RESULTS) | results

    def refused_row(self, scene: Scene) -> Row | None:
        """The one row of a series that cannot run the scene; None: it can."""
        if self.kind == "peer" and (absent := import_failure_reason(self.name)):
            return self.chart_row({}, status="not installed", reason=absent)
        if reason := self.refusal_reason(scene):
            return self.chart_row({}, status="failed", reason=reason)
        return None

    def refusal_reason(self, scene: Scene) -> str | None:
        """Why the series cannot run the scene; None: it can."""
        drive = scene.groups.drive.mode
        if self.method is not None:
            try:
                Run(scene, self.method, model=self.model)
            except ValueError as error:
                return str(error)
        elif drive != "grip" and not (drive == "free" and PEERS[self.name].rides):
            return f"its mass grips the cable: it has no car that rolls (drive {drive})"
        return None


def chart(scene: Scene, out: Path, report: Progress = no_progress, *, repeats: int = 3, budget: float = 240.0) -> Row:
    """Write chart.json; go on with an earlier one.

    repeats : separate timed runs of each setting.
    budget : [s] by the clock, the reference included; a line of the chart that has spent its share of what remains
        leaves rows "not run".
    """
    end = time.perf_counter() + budget
    path = out / "chart.json"
    before = store.read_json_or_empty(path, scene_toml=scene.to_toml())
    report("reference", 0.0)
    earlier = before.get("reference")
    reference = _Reference.compute(scene, earlier, 0.4 * budget)
    rows: list[Row] = []
    if earlier and earlier["settings"] == reference.stored["settings"]:
        rows += [r for r in before["rows"] if r["status"] not in ("not run", "not installed")]
    todo = list(chart_series(scene.groups))
    content: Row = {"scene": scene.name, "scene_toml": scene.to_toml(), "drive": scene.groups.drive.mode}
    content |= {
        "machine": versions_and_machine(),
        "window": list(reference.window),
        "reference": reference.stored,
        "rows": rows,
    }
    weights = [4.0 if series.kind == "peer" else 1.0 for series in todo]  # other codes are slow
    for i, series in enumerate(todo):
        report(series.name, 0.05 + 0.85 * i / len(todo))
        share = weights[i] / sum(weights[i:])
        max_seconds = share * (end - time.perf_counter())
        rows += _SeriesTimer(scene, series, reference).run_for_missing_rows(rows, repeats, max_seconds)
        if series.kind == "peer":
            rows += _missing_full_program_rows(series.name, rows)
        write_json(path, content)
    if scene.groups.drive.mode == "grip":
        report("cost of a step", 0.9)
        content["floor"] = before.get("floor")
        if content["floor"] is None and time.perf_counter() < end:
            content["floor"] = iteration_cost_over_bare_solve(scene)
    floor = reference.stored["path_error"] or 0.0  # no smaller error can be read off
    content["fastest"] = [fastest_methods_at_error(rows, error) for error in SETTINGS["decades"] if error >= floor]
    write_json(path, content)
    report("done", 1.0)
    return content


def versions_and_machine() -> dict[str, str]:
    """What the seconds of a chart depend on beside the scene."""
    return package_versions() | {"machine": platform.machine(), "threads": "1"}


def chart_series(groups: Groups) -> Iterator[Series]:
    """All lines of the chart on a scene: methods, models, schemes, tolerances, whole commands and peers."""
    from cablefem.elements.cable import MODELS

    base = METHODS[BASE]
    for method in METHODS.values():
        step_shares = DENSE if method is base else SETTINGS["shares"]
        yield Series(method.name, "method", tuple(settings_ladder(method, step_shares)), method.name)
    for model in sorted(set(MODELS) - {"full"}, key=MODELS.index):
        yield Series(f"model {model}", "model", tuple(settings_ladder(base))[::4], BASE, model)
    yield from _integrator_series(base, base.settings_for_scene(groups, {})["scheme"])
    tolerances = tuple({"tol": tol} for tol in SETTINGS["asked"])
    for name in (BASE, WITNESS[0]):
        yield Series(f"{name} --tol", "tolerance", tolerances, name)
    yield Series(f"{BASE} --tol{FULL_PROGRAM}", "waiting", tolerances, BASE)
    for name, peer in PEERS.items():
        rungs = (groups.drive.mode == "free" and peer.rides) or peer.ladder
        yield Series(name, "peer", tuple(map(dict, rungs)))


def _integrator_series(base: Method, usual_scheme: str) -> Iterator[Series]:
    """The schemes besides the usual one, without one that is never on a front; and a method of fourth degree."""
    for scheme in SCHEMES:
        if scheme in (usual_scheme, "central-difference"):
            continue
        # with fewer, Newton's method fails at wave fronts
        few, min_steps = (4, 150) if newmark.scheme(scheme).nodes else (1, 20)
        rungs: list[Settings] = []
        for settings in settings_ladder(base):
            steps = max(min_steps, settings["steps"] // few)
            rung = settings | {"scheme": scheme, "steps": steps}
            if rung not in rungs:
                rungs.append(rung)
        yield Series(f"scheme {scheme}", "integrator", tuple(rungs[::2]), BASE)
    sharp = tuple({"elements": n, "steps": steps, "scheme": "radau"} for n, steps in SETTINGS["sharp"])
    yield Series("following-p4 radau", "integrator", sharp, "following-p4")


def settings_ladder(method: Method, step_shares: Sequence[float] = SETTINGS["shares"]) -> Iterator[Settings]:
    """A method's settings from coarse to fine, around its defaults.

    Steps grow with the resolution, between linearly and as its square; then `step_shares` of them.
    """
    settings = method.complete_settings({})
    # more steps take too long
    seen = []
    pace = min(2.0, method.steps_exponent)
    for finer in FINER:
        for share in step_shares:
            scaled = scaled_settings(method, settings, space=finer, time=share * finer**pace)
            rung = method.resolution_and_steps(scaled)
            if rung not in seen:
                seen.append(rung)
                yield rung


@dataclass(frozen=True, slots=True)
class _Reference:
    """The run that all others are compared with, the window, and what chart.json stores of its error."""

    run: Response
    window: Window
    stored: Row

    @classmethod
    def compute(cls, scene: Scene, stored: Row | None, seconds: float) -> _Reference:
        """Run the reference, as fine as the time allows; its error is by coarser runs and the other solver.

        stored : an earlier one, whose error holds if the settings are the same;  seconds : by the clock.
        Raises ValueError if the reference ends early.
        """
        stop = relative_stop_position_unless_free(scene)
        name, finest = REFERENCE if stop else REFERENCE_OF_RIDES
        shares = (1.0,) if stored and stored["settings"] == finest else (0.25, 0.5, 1.0)
        end = time.perf_counter() + seconds
        for share in shares:
            settings = _scaled_settings(finest, share)
            begin = time.perf_counter()
            reference = run(scene, name, until=stop, **settings)
            complete = not reference.reason if stop is None else reference.reached >= stop
            now = time.perf_counter()
            # four times as much work, its coarser runs and the other solver
            if complete and now + 12.0 * (now - begin) > end:
                break
        if not complete and reference.slack_onset is None:
            raise ValueError(f"the chart's reference stopped at s_o/l = {reference.reached:.3f}: {reference.reason}")
        window = measures.common_window(reference)
        if stored is None or stored["settings"] != settings:
            witness_settings = _scaled_settings(WITNESS[1], share)
            other = run(scene, WITNESS[0], until=stop, **witness_settings)
            try:
                witness = measures.relative_path_gap(other, reference, window).largest
            except NotComparable:
                witness = None
            bars = run_with_error_bars(scene, name, earlier_runs=[reference], until=stop, **settings).finest
            stored = {"method": name, "settings": settings}
            stored |= {"path_error": bars.path_error, "tension_error": bars.tension_error}
            stored |= {"witness": WITNESS[0], "witness_settings": witness_settings, "witness_path": witness}
            stored |= {"max_deflection": reference.max_deflection, "slack_onset": reference.slack_onset}
        return cls(reference, window, stored)

    def status_and_errors(
        self, reached: float, reason: str | None, compute_errors: Callable[[], dict[str, float]]
    ) -> Row:
        """Status and errors of a run, or why there are none; a free ride may end before the window does."""
        complete = not reason if self.run.drive == "free" else reached >= self.window[1] * (1.0 - 1e-9)
        if not complete:
            return {"status": "failed", "reason": reason or f"ended at s_o/l = {reached:.3f}"}
        try:
            return {"status": "ok", **compute_errors()}
        except NotComparable as error:
            return {"status": "failed", "reason": str(error)}

    def status_and_errors_of_response(self, r: Response) -> Row:
        """As `status_and_errors`, with errors of path and tension."""
        return self.status_and_errors(r.reached, r.reason, partial(self.response_errors, r))

    def response_errors(self, r: Response) -> dict[str, float]:
        """Errors of path and tension in the window, dimensionless."""
        gap = measures.relative_path_gap(r, self.run, self.window)
        return {
            "path_error": gap.largest,
            "path_rms": gap.rms,
            "tension_error": measures.rms_tension_gap_over_H(r, self.run, self.window),
        }

    def peer_path_errors(self, p: PeerPath, scene: Scene) -> dict[str, float]:
        """Errors of another code's path, dimensionless."""
        t = scene.time_scale * p.t
        path = np.stack(scene.groups.coordinates(p.s_o)) + np.stack([p.u, p.v])  # (2, n)
        low, high = self.window
        inside = (p.s_o >= low) & (p.s_o <= high) & (t <= self.run.t[-1])
        our_path = CubicSpline(self.run.t, np.stack([self.run.x, self.run.y], axis=1))
        distances = scene.length * path[:, inside] - our_path(t[inside]).T  # (2, n)
        gap = np.hypot(*distances) / self.run.path_scale
        return {"path_error": float(gap.max()), "path_rms": float(np.sqrt(np.mean(gap**2)))}


def _scaled_settings(settings: Settings, share: float) -> Settings:
    """Settings with a share of all their numbers."""
    return {name: x if isinstance(x, str) else round(share * x) for name, x in settings.items()}


def relative_stop_position_unless_free(scene: Scene) -> float | None:
    """Last s_o/l of runs; None for a free ride."""
    return None if scene.groups.drive.mode == "free" else STOP


@dataclass(frozen=True, slots=True)
class _SeriesTimer:
    """Runs a series on a scene, times its runs and compares them with the reference."""

    scene: Scene
    series: Series
    reference: _Reference

    def run_for_missing_rows(self, rows: list[Row], repeats: int, max_seconds: float) -> list[Row]:
        """Run the settings that have no row, while the next run is likely to fit into the time.

        max_seconds : by the clock; the first run has no earlier one that says what it takes, and may take longer.
        """
        series = self.series
        done = [r["settings"] for r in rows if r["series"] == series.name]
        refused = series.refused_row(self.scene)
        if refused is not None:
            return [] if {} in done else [refused]
        missing = [x for x in series.rungs if x not in done]
        begin = time.perf_counter()

        def remaining() -> float:
            return begin + max_seconds - time.perf_counter()

        if missing and remaining() > 0.0 and series.kind not in ("tolerance", "waiting", "peer"):
            self.repeat_and_keep_fastest(missing[0], 1, 0.0)  # the first run may compile
        new = []
        run_seconds = 0.0
        for settings in missing:
            before = remaining()
            if before > run_seconds:
                row = self.repeat_and_keep_fastest(settings, max(1, repeats), before)
                run_seconds = (before - remaining()) / (row["repeats"] or 1)
            else:
                row = series.chart_row(settings, status="not run", reason="more than its share of the time")
            new.append(row)
        return new

    def repeat_and_keep_fastest(self, settings: Settings, repeats: int, max_seconds: float) -> Row:
        """The row of a run: the best of separate repeats and their spread (slowest over best).

        Repeats end before `max_seconds` by the clock; short runs are repeated more often.
        """
        begin = time.perf_counter()
        time_once = {"peer": self._time_peer_run, "waiting": self._time_command}.get(self.series.kind, self._time_run)
        try:
            results, first = time_once(settings)
        except (ValueError, TooCoarse) as error:
            return self.series.chart_row(settings, status="failed", reason=str(error))
        seconds = [first]
        while results["status"] == "ok":
            spent = time.perf_counter() - begin
            if spent + spent / len(seconds) > max_seconds:
                break
            if len(seconds) >= repeats and (len(seconds) >= 3 * repeats or sum(seconds) > 0.2):
                break
            seconds.append(time_once(settings)[1])
        fastest = min(seconds)
        results["seconds"] = fastest
        results["spread"] = max(seconds) / fastest if len(seconds) > 1 else None
        results["repeats"] = len(seconds)
        return self.series.chart_row(settings, **results)

    def _time_run(self, settings: Settings) -> tuple[Row, float]:
        """Results and seconds of a run; by tolerance its seconds include all runs up to it."""
        method = self.series.method
        assert method is not None
        stop = relative_stop_position_unless_free(self.scene)
        results: Row = {}
        if "tol" in settings:
            begin = time.process_time()
            r = refine_to_tolerance(self.scene, method, settings["tol"], until=stop).finest
            seconds = time.process_time() - begin
            results = _error_bar_and_chosen_settings(r)
        else:
            r = run(self.scene, method, model=self.series.model, until=stop, **settings)
            seconds = r.seconds
        results |= {name: r.work[name] for name in ("steps", "newton_iterations", "factorisations")}
        results |= {"reached": r.reached, "n_dof": r.n_dof, "unknown_steps": r.work["steps"] * r.n_dof}
        results |= self.reference.status_and_errors_of_response(r)
        return results, seconds

    def _time_peer_run(self, settings: Settings) -> tuple[Row, float]:
        """Results and seconds of a run of another code, without what others took of the processor."""
        scene = self.scene
        peer = PEERS[self.series.name]
        stop = relative_stop_position_unless_free(scene)
        groups = scene.groups if stop is None else groups_until(scene.groups, stop)
        wall = time.perf_counter()
        own = time.process_time()
        try:
            with threadpool_limits(1):
                path = peer.run(groups, **settings)
        except Exception as error:  # other codes' failures
            raise ValueError(f"{type(error).__name__}: {error}") from error
        own = time.process_time() - own
        share = min(1.0, own / (time.perf_counter() - wall))  # of the processor
        results: Row = {"steps": path.t.size - 1, "reached": path.reached}
        compute_errors = partial(self.reference.peer_path_errors, path, scene)
        results |= self.reference.status_and_errors(path.reached, path.note, compute_errors)
        results["wait"] = own + _import_time(peer.module)
        return results, share * path.seconds

    def _time_command(self, settings: Settings) -> tuple[Row, float]:
        """Results and processor time of `cablefem run --tol`, with its bars, files and page."""
        method = self.series.method
        assert method is not None
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            file = folder / "scene.toml"
            write_text(file, self.scene.to_toml())
            arguments = ["--method", method, "--tol", repr(settings["tol"]), "--out", str(folder / "out")]
            seconds = _processor_time_of_python("-m", "validation.cli", "run", str(file), *arguments)
            try:
                r = Response.read(folder / "out" / method)
            except FileNotFoundError:
                raise ValueError("the command wrote no response") from None
        results = self.reference.status_and_errors_of_response(r)
        return results | _error_bar_and_chosen_settings(r) | {"reached": r.reached}, seconds


def _error_bar_and_chosen_settings(r: Response) -> Row:
    return {"bar": r.path_error, "chosen": METHODS[r.method].resolution_and_steps(r.settings)}


def _missing_full_program_rows(peer: str, rows: list[Row]) -> list[Row]:
    """Rows of another code with the time of all of its program; none if there are some already."""
    series = peer + FULL_PROGRAM
    if any(r["series"] == series for r in rows):
        return []
    timed = [r for r in rows if r["series"] == peer and r["wait"]]
    return [r | {"series": series, "kind": "waiting", "seconds": r["wait"], "spread": None} for r in timed]


def _processor_time_of_python(*arguments: str) -> float:
    """Processor time [s] of a fresh interpreter and its processes."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *arguments], capture_output=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


@cache
def _import_time(module: str) -> float:
    """Processor time [s] of a fresh interpreter that imports a module."""
    return _processor_time_of_python("-c", f"import {module}")


def groups_until(groups: Groups, position: float) -> Groups:
    """The groups with a motion that ends at a position s_o/l."""
    motion = groups.motion
    assert motion is not None
    if position >= motion.end_position:
        return groups
    shorter = motion.cut_at(motion.time_at_position(position))
    return replace(groups, motion=replace(shorter, end_position=position))
