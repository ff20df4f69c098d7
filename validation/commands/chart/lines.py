"""Speed against accuracy of both solvers, of time schemes and of states of rest on a line in motion.

Reference: elements, finer than the chart.
Path error: largest distance of a car at equal times, over the largest deflection of a car.
Tension error: the largest of mean tensions at contacts, over the largest tension at the start.
Seconds: processor time of the steps alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

from cablefem import catenary_line
from cablefem.newmark import SCHEMES
from cablefem.response import Array, write_json
from cablefem.scene.line import Line
from validation.commands.chart.front import Row, fastest_methods_at_error
from validation.commands.chart.study import SETTINGS, Series, versions_and_machine
from validation.commands.check.motion import deflection_tension_and_weight_scales
from validation.commands.run.motion import ELEMENTS, SINES, Factors, LineMethod, LineRuns, OutOfTime
from validation.commands.run.quasi import largest_distances_from_rest, line_at_timetable_positions_or_refused
from validation.core import store
from validation.core.motion_laws import tension_behind_or_ahead
from validation.core.motion_rows import LineRun, Scales, distances
from validation.core.sidebyside import Progress, no_progress

LADDER: tuple[Factors, ...] = tuple((space, time) for space, time in SETTINGS["line_ladder"])
NO_TIME = "more than its share of the time"


def chart_line_and_write(
    line: Line, out: Path, report: Progress = no_progress, *, budget: float = 240.0, ladder: Sequence[Factors] = LADDER
) -> Row:  # fmt: skip
    """Write chart.json of a line in motion.

    ladder : multiples of the coarsest resolution and of the fewest steps;  the reference has twice the largest.
    budget : [s] by the clock, the reference included; a line of the chart that has spent its share of what remains
        leaves rows "not run".
    """
    end = perf_counter() + budget
    report("reference", 0.0)
    runs = LineRuns(ELEMENTS, line)
    reference = _Reference.compute(line, runs, 2 * int(np.max(ladder)), 0.5 * budget)
    rows: list[Row] = []
    content: Row = {"scene": line.name, "scene_toml": line.to_toml(), "drive": "line"}
    content |= {"machine": versions_and_machine(), "window": [0.0, reference.run.end_time]}
    content |= {"reference": reference.stored, "rows": rows}
    methods = list(_charted_methods())
    for i, (series, method) in enumerate(methods):
        report(series.name, 0.5 + 0.5 * i / len(methods))
        solver = runs if method is ELEMENTS else LineRuns(method, line, runs)
        solver.cut_at = perf_counter() + (end - perf_counter()) / (len(methods) - i)
        rows += _rows_of_series(series, solver, ladder, reference)
        write_json(out / "chart.json", content)
    rows.append(_quasi_static_row(line, runs, reference, end))
    content["fastest"] = [fastest_methods_at_error(rows, error) for error in SETTINGS["decades"]]
    write_json(out / "chart.json", content)
    report("done", 1.0)
    return content


def _charted_methods() -> Iterator[tuple[Series, LineMethod]]:
    """Both solvers, and elements with the other schemes."""
    for method in (ELEMENTS, SINES):
        yield Series(method.name, "method", (), method.name), method
    for scheme in SCHEMES:
        if scheme not in (ELEMENTS.scheme, "central-difference"):
            yield Series(f"scheme {scheme}", "integrator", (), ELEMENTS.name), replace(ELEMENTS, scheme=scheme)


@dataclass(frozen=True, slots=True)
class _Reference:
    """The run that all others are compared with, and what chart.json stores of its error."""

    run: LineRun
    scales: Scales
    stored: Row

    @classmethod
    def compute(cls, line: Line, runs: LineRuns, finest: int, seconds: float) -> _Reference:
        """The finest run that the time allows; its error is its distance from one twice as coarse.

        runs : of elements;  finest : largest multiple of both settings.
        The witness is the sines' run of half these multiples.
        """
        longer = 6.0  # times, at most, takes a run of twice the resolution and steps
        finer = 2
        begin = perf_counter()
        run = runs.run(finer, finer)
        spent = perf_counter() - begin
        while finer < finest and longer * spent < seconds:
            finer *= 2
            run = runs.run(finer, finer)
            spent = perf_counter() - begin
        half = finer // 2
        reference = cls(run, deflection_tension_and_weight_scales(line, run), {})
        stored: Row = {"method": run.method, "settings": run.settings}
        stored |= reference.errors(runs.run(half, half))
        witness = LineRuns(SINES, line, runs).run(half, half)
        stored |= {"witness": witness.method, "witness_settings": witness.settings}
        stored["witness_path"] = reference.errors(witness)["path_error"]
        return replace(reference, stored=stored)

    def errors(self, moved: LineRun) -> dict[str, float]:
        """Errors of the cars' paths and of mean tensions at the contacts, dimensionless."""
        end_time = min(moved.end_time, self.run.end_time)
        path = [
            distances(moved.at_common_instants(a.point, end_time), self.run.at_common_instants(b.point, end_time))
            for a, b in zip(moved.motion.cars, self.run.motion.cars, strict=True)
        ]
        tension = [
            np.abs(
                _mean_tension_at_common_instants(moved, k, end_time)
                - _mean_tension_at_common_instants(self.run, k, end_time)
            )
            for k in range(len(self.run.motion.contacts))
        ]
        return {
            "path_error": float(np.max(path)) / self.scales.path,
            "path_rms": float(np.sqrt(np.mean(np.square(path)))) / self.scales.path,
            "tension_error": float(np.max(tension)) / self.scales.tension,
        }

    def failure_reason(self, moved: LineRun) -> str | None:
        """Why a run is not comparable: it broke, is the reference, or ends otherwise than the reference does."""
        if moved.reason is not None:
            return moved.reason
        if moved is self.run:
            return "it is the reference: a larger --budget takes a finer one"
        same_end = 0.02  # of the duration
        if abs(moved.end_time - self.run.end_time) <= same_end * self.run.end_time:
            return None
        last = f": {moved.events[-1][0]}" if moved.events else ""
        return f"ends after {moved.end_time:.1f} s instead of {self.run.end_time:.1f} s{last}"


def _mean_tension_at_common_instants(moved: LineRun, contact: int, end_time: float) -> Array:
    """Tension at a contact, averaged over an axial round trip, at the common instants (n,) [N]."""
    tension = tension_behind_or_ahead(moved.motion.contacts[contact])
    return moved.at_common_instants(moved.mean_over_axial_round_trip(tension), end_time)


def _rows_of_series(
    series: Series, solver: LineRuns, ladder: Sequence[Factors], reference: _Reference
) -> Iterator[Row]:
    """Rows of one line of the chart; a new run that is not likely to end before `cut_at` is left out."""
    name = solver.method.setting
    rate = 0.0  # seconds over the product of both factors, the largest so far
    for space, time in ladder:
        settings = {name: space * solver.coarsest, "steps": time * solver.fewest_steps}
        begin = perf_counter()
        if (space, time) in solver.known or begin + rate * space * time < solver.cut_at:
            yield _row_or_failure(series, settings, partial(solver.run, space, time), reference)
        else:
            yield series.chart_row(settings, status="not run", reason=NO_TIME)
        rate = max(rate, (perf_counter() - begin) / (space * time))


def _row_or_failure(series: Series, settings: Row, run: Callable[[], LineRun], reference: _Reference) -> Row:
    """The row of a run, or why there is none."""
    try:
        moved = run()
    except store.Refused as refused:
        return series.chart_row(settings, status="failed", reason=str(refused))
    except OutOfTime:
        return series.chart_row(settings, status="not run", reason=f"cut: it took {NO_TIME}")
    reason = reference.failure_reason(moved)
    if reason is not None:
        return series.chart_row(settings, status="failed", reason=reason)
    work = moved.work
    results: Row = {"status": "ok", "seconds": moved.seconds, "repeats": 1, "n_dof": moved.n_dof, "steps": work.steps}
    results |= {"newton_iterations": work.newton_iterations, "factorisations": work.factorisations}
    results |= {"unknown_steps": work.steps * moved.n_dof, "reached": moved.end_time}
    return series.chart_row(settings, **results, **reference.errors(moved))


def _quasi_static_row(line: Line, runs: LineRuns, reference: _Reference, cut_at: float) -> Row:
    """The row of the states of rest at the timetables' positions, if it begins before `cut_at` by the clock."""
    series = Series("model quasi-static", "model", (), model="quasi-static")
    if perf_counter() > cut_at:
        return series.chart_row({}, status="not run", reason=NO_TIME)
    begin = process_time()
    try:
        at_rest = line_at_timetable_positions_or_refused(line)
    except store.Refused as refused:
        return series.chart_row({}, status="failed", reason=str(refused))
    rest = at_rest.solve_at_rest(catenary_line.solve)
    seconds = process_time() - begin
    distances = largest_distances_from_rest(rest, runs.line, reference.run)
    path = max(distances[car.name]["path"] for car in reference.run.motion.cars)
    tension = max(distances[contact.name]["tension"] for contact in reference.run.motion.contacts)
    errors = {"path_error": path / reference.scales.path, "tension_error": tension / reference.scales.tension}
    return series.chart_row({"positions": at_rest.position_count}, status="ok", seconds=seconds, repeats=1, **errors)
