"""The work of a sweep, one scene at a time: whatever happens, a scene comes back as a row with a status."""

from __future__ import annotations

import ctypes
import json
import math
import os
import threading
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from validation.commands.sweep.study import Point, Study
from validation.core import store
from validation.core.quantities import KNOWN

if TYPE_CHECKING:
    from cablefem.response import Response
    from cablefem.scene import Scene
    from cablefem.scene.line import Line

Row = dict[str, Any]
# status: "complete" | "incomplete" | "refused" (the scene's own faults) | "cut off" (too long) | "failed" | "died"
BROKEN = ("cut off", "failed", "died")
GRACE = 5.0  # [s] between asking a scene to stop and ending its worker
FRESH = 120.0  # [s] more for a new process, which may load and compile
LARGEST_TRUTH = 2e6  # steps times elements of a reference
COLUMNS = store.read_packaged_toml(__package__, "columns.toml")
GROUPS = COLUMNS["groups"]
DESIGN = [name for name in KNOWN if name not in COLUMNS["numbers"]]


class CutOff(BaseException):
    """Raised inside a scene that has used up its time; `except Exception` does not catch it."""


@contextmanager
def cut_off_after(seconds: float) -> Iterator[None]:
    """Raise CutOff in this thread after that time; end the process if that has no effect within GRACE.

    Compiled code may turn it into another exception.
    """
    thread = ctypes.c_ulong(threading.get_ident())
    begin = time.perf_counter()
    interrupt = ctypes.pythonapi.PyThreadState_SetAsyncExc
    interruption = threading.Timer(seconds, interrupt, (thread, ctypes.py_object(CutOff)))
    timers = [interruption, threading.Timer(seconds + GRACE, os._exit, (1,))]
    for timer in timers:
        timer.daemon = True
        timer.start()
    try:
        yield
    except Exception:
        if time.perf_counter() - begin > seconds:
            raise CutOff from None
        raise
    finally:
        for timer in timers:
            timer.cancel()


def compute_rows_of_points(study: Study, numbered_points: list[tuple[int, Point]]) -> list[Row]:
    return [row_of_point_or_failure(study, index, point) for index, point in numbered_points]


def row_of_point_or_failure(study: Study, index: int, point: Point) -> Row:
    """The row of one point: index, inputs, groups, status and the results of the job, within the study's time."""
    begin = time.perf_counter()
    out: Row = {"index": index, **point}
    try:
        with cut_off_after(study.seconds + max(0.0, FRESH - time.process_time())):
            out |= _results_of_job(study, point, index)
    except CutOff:
        out |= {"status": "cut off", "cause": "time", "reason": f"more than {study.seconds:g} s"}
    except Exception as error:
        reason = traceback.format_exc(limit=-4)
        out |= {"status": "failed", "cause": type(error).__name__, "reason": reason}
    return out | {"seconds": time.perf_counter() - begin}


def reason_on_one_line(status: str, reason: str) -> str:
    """Faults one after the other; of a traceback, which a failed scene has, its last line."""
    lines = reason.splitlines()
    return lines[-1] if status == "failed" else "; ".join(lines)


def row_of_lost_scene(study: Study, index: int, cause: str) -> Row:
    """The row of a scene that ends its worker."""
    reason = "each worker died that computed it"
    return {"index": index, **study.point(index), "status": "died", "cause": cause, "reason": reason}


def _results_of_job(study: Study, point: Point, index: int) -> Row:
    """Run, check, advise or test the judge on the scene of a point; "refused" for a scene with faults."""
    from cablefem.scene import SceneError

    try:
        scene: Any = study.scene_at(point)
        groups = {name: getattr(scene, name, None) for name in GROUPS}
    except (SceneError, ValueError) as error:
        return {"status": "refused", "cause": "scene", "reason": str(error)}
    out = {name: x for name, x in groups.items() if x is not None and math.isfinite(x)}
    how = study.run_options(point)
    match study.job:
        case "run":
            return out | _run_row(study, how, scene, index)
        case "check":
            return out | _check_row(scene, how["tol"], None)
        case "advise":
            return out | _advice_row(scene, how["tol"])
    return out | _check_row_with_planted_fault(scene, study.scene_and_fault_key(point)[1], how["tol"])


def _check_row_with_planted_fault(scene: Scene | Line, key: str | None, tol: float) -> Row:
    """The row of a check whose second solver has a fault of 1 % in a key; None: no fault."""
    from cablefem.scene.line import Line

    fault = "none" if key is None else f"{key} +1 %"
    second: Any = None if key is None else scene.replace({key: "+1%"})
    row = _moving_line_check_row(scene, tol, second) if isinstance(scene, Line) else _check_row(scene, tol, second)
    return {"family": scene.name, "fault": fault} | row


def _run_row(study: Study, run_options: dict[str, Any], scene: Scene, index: int) -> Row:
    """Results of a run with error bars, by the advised method if none is named; of some scenes also true errors."""
    from validation.core.design import design_numbers
    from validation.core.methods import find_method
    from validation.core.refine import TooCoarse, refine_to_tolerance, run_with_error_bars
    from validation.core.running import Run

    how = dict(run_options)
    tol = how.pop("tol", None)
    if "method" not in how:
        how |= _advised_options(scene, tol)
    method = how.pop("method")
    how |= {k: v for k, v in study.settings.items() if k in find_method(method).all_settings}
    too_coarse: Row = {}
    try:
        Run(scene, method, **how)
    except ValueError as error:  # a method that cannot do what the scene asks for
        return {"status": "refused", "cause": "method", "reason": str(error)}
    how["until"] = _relative_end_position_of_run(scene)
    try:
        if tol is None:
            ladder = run_with_error_bars(scene, method, **how)
        else:
            ladder = refine_to_tolerance(scene, method, tol, **how)
    except TooCoarse as error:
        ladder = error.ladder
        too_coarse = {"verdict": "too coarse", "reason": str(error)}
    r = replace(ladder.finest, design=design_numbers(ladder))
    out = _response_columns(r, scene) | too_coarse
    faults = response_faults(r)
    if faults:
        return out | {"status": "failed", "cause": "not finite", "reason": "; ".join(faults)}
    if study.truth is None or index % study.truth.every:
        return out
    return out | errors_against_finer_run(scene, r, study.truth.finer)


def _relative_end_position_of_run(scene: Scene) -> float | None:
    """s_o/l at which a run ends: rows say nothing of the slack cable, which a car that grips leaves behind at the far
    support; None: the end of the motion, past the last obstacle.
    """
    from validation.core.measures import SLACK_END

    has_clearance = bool(scene.obstacle or scene.ground)
    return SLACK_END if scene.drive.mode == "grip" and not has_clearance else None


def errors_against_finer_run(scene: Scene, r: Response, finer_factor: int) -> Row:
    """Errors of a run, and of one half as fine as the reference, over the range of the run's bar.

    The reference, by following-p2, is `finer_factor` times as fine as the run; {} if that exceeds LARGEST_TRUTH.
    """
    from validation.core import measures
    from validation.core.running import run

    elements = max(32, finer_factor * r.settings.get("elements", 0))
    steps = max(2400, finer_factor * r.settings.get("steps", 0))
    if r.path_error is None or steps * elements > LARGEST_TRUTH:
        return {}
    how: dict[str, Any] = {"model": r.model, "load": r.load, "until": measures.WINDOW[1]}
    best = run(scene, "following-p2", **how, elements=elements, steps=steps)
    half = run(scene, "following-p2", **how, elements=elements // 2, steps=steps // 2)
    try:
        low, high = r.error_window or measures.WINDOW
        window = measures.common_window(r, best, half, window=(low, high))
        true, doubt = (measures.relative_path_gap(x, best, window).largest for x in (r, half))
        tension, unsure = (measures.rms_tension_gap_over_H(x, best, window) for x in (r, half))
    except measures.NotComparable:
        return {}
    return {"true_error": true, "doubt": doubt, "true_tension": tension, "doubt_tension": unsure}


def response_faults(r: Response) -> list[str]:
    """Faults of a response: numbers that are not finite, an end without a reason."""
    import numpy as np

    names = ("t", "s_o", "x", "y", "u", "v", "velocity", "acceleration", "energy", "power", "tension_min")
    arrays = {name: getattr(r, name) for name in names}
    inner = (r.s_o > 0.0) & (r.s_o < r.length)
    arrays |= {"T_behind": r.T_behind[inner], "T_ahead": r.T_ahead[inner]}
    arrays |= {f"fields.{name}": getattr(r.fields, name) for name in ("T", "u", "v", "du", "dv")}
    out = [f"{name} is not finite" for name, values in arrays.items() if not np.isfinite(values).all()]
    if r.status == "incomplete" and not (r.reason and r.cause):
        out.append("incomplete without a reason")
    return out


def _advised_options(scene: Scene, tol: float) -> dict[str, Any]:
    """Simplest model and method that `advise` finds; of a car that rolls, a method that can ride."""
    from validation import advice

    if scene.drive.mode != "grip":
        return {"method": "following-p2"}
    advised = advice(scene, tol)
    return {k: advised[k] for k in ("method", "model", "load")}


def _check_row(scene: Scene, tol: float, second_scene: Scene | None) -> Row:
    """Verdict, what does not agree, and numbers of the better solver; second_scene : what the second one solves."""
    from validation import check

    def path_error(ladder: Any) -> float:
        return math.inf if ladder.finest.path_error is None else float(ladder.finest.path_error)

    result = check(scene, tol=tol, until=_relative_end_position_of_run(scene), second=second_scene)
    best = min((result.a, result.b), key=path_error)
    return _response_columns(best.finest, scene) | _verdict_columns(result)


def _moving_line_check_row(line: Line, tol: float, second_line: Line | None) -> Row:
    """Verdict and what does not agree on a line in motion; second_line : what the second solver solves."""
    from validation.commands.check.motion import check_line

    result: Any = check_line(line, tol, second=second_line)
    return _verdict_columns(result) | {
        "status": result.status,
        "reason": result.moved.reason,
        "method": result.moved.method,
    }


def _verdict_columns(result: Any) -> Row:
    """The verdict of a check, and the quantities that decide and do not agree."""
    agree = type(result.verdict).AGREE
    differ = dict.fromkeys(row.quantity for row in result.rows if row.decides and row.verdict is not agree)
    return {"verdict": result.verdict.value, "not_agreed": ", ".join(differ) or None}


def _advice_row(scene: Scene, tol: float) -> Row:
    from validation import advice

    advised = advice(scene, tol)
    out = {k: advised[k] for k in ("model", "load", "method", "path_error", "tension_error")}
    verdict = "meets" if advised["meets"] else "too coarse"
    return out | {"status": "complete", "settings": json.dumps(advised["settings"]), "verdict": verdict}


def _response_columns(r: Response, scene: Scene) -> Row:
    """What a row holds of a response."""
    from validation.core import limits
    from validation.core.answers import outcome_of_run

    same = ("status", "cause", "reason", "method", "model", "load", "max_deflection", "path_error", "tension_error")
    out = {name: getattr(r, name) for name in (*same, "slack_onset", "reached")}
    out |= {name: r.work[name] for name in COLUMNS["counts"]}
    out["flags"] = "; ".join(map(str, r.flags)) or None
    out["settings"] = json.dumps(r.settings)
    out["events"] = json.dumps(r.events) if r.events else None
    end = outcome_of_run(scene, r)
    out |= {"outcome": end.sentence, "outcome_kind": end.kind}
    out |= limits.worst_limit_columns(limits.limit_rows(scene, r.design, r.events))
    known = [number for number in r.design if number["value"] is not None]
    for number in sorted(known, key=lambda number: float(number["value"]), reverse=True):
        name = number["quantity"].partition(":")[0]  # of several obstacles the least clearance stays
        out[name] = number["value"]
        out[f"{name}_bar"] = number["bar"]
    return out
