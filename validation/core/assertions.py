"""Agreement as an assertion: of two answers, or of a user's own solver with ours."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from cablefem.response import Response
from cablefem.scene import Scene
from validation.commands.check.study import Check, check
from validation.core import foreign, measures
from validation.core.agreement import Agreement, Verdict
from validation.core.foreign import ForeignPath
from validation.core.measures import WINDOW, NotComparable, Window
from validation.core.store import Refused

Answer = Response | ForeignPath
Solver = Callable[[Scene], Any]  # scene -> (s_o [m], v [m] down) or (s_o, v, u [m]), or a Response


def assert_agree(
    a: Answer, b: Answer, *, path: float = 1e-3, tension: float | None = None, window: Window = WINDOW
) -> list[Agreement]:
    """Raise AssertionError unless two answers agree: in the mass path and, if asked, in the tension.

    path : largest gap of the mass paths, relative to the largest deflection of b.
    tension : rms gap of the tension fields, relative to H; of the tensions at the mass if one answer has no fields.
    window : s_o/l; cut at the earliest slack onset and where the shorter answer ends.

    The message gives the gap and what was allowed, where they part, and where the bound comes from.  Returns the
    rows of the verdict.
    """
    names = f"{a.method} and {b.method}"
    if not np.isclose(a.length, b.length, rtol=1e-6, atol=0.0):
        raise AssertionError(f"{names} are of different cables: {a.length:.6g} m and {b.length:.6g} m long")
    for answer in (a, b):
        if isinstance(answer, ForeignPath) and tension is not None and answer.T_behind is None:
            raise AssertionError(f"{names}: tension cannot be compared, {answer.method} brought none")
    try:
        cut = _window(a, b, window)
        rows = [_path_row(a, b, path, cut)]
        if tension is not None:
            rows.append(_tension_row(a, b, tension, cut))
    except NotComparable as reason:
        raise AssertionError(f"{names} cannot be compared: {reason}") from None
    failed = [row for row in rows if row.verdict is not Verdict.AGREE]
    if failed:
        raise AssertionError("\n".join([f"{names} disagree", *(f"  {told(row)}" for row in failed)]))
    return rows


def told(row: Agreement) -> str:
    """Return a row that did not agree as one line."""
    where = "" if row.where is None else f", largest at s_o/l = {row.where:.3f}"
    return f"{row.quantity}: gap {row.gap:.3g}, allowed {row.allowed:.3g}{where}; {row.allowed_because}"


def _window(a: Answer, b: Answer, window: Window) -> Window:
    start = max(window[0], *(float(x.s_o[0] / x.length) for x in (a, b)))
    return measures.window_of(a, b, window=(start, window[1]))  # type: ignore[arg-type]


def _over(window: Window, a: Answer, b: Answer) -> str:
    onsets = [x.slack_onset for x in (a, b) if x.slack_onset is not None]
    cut = ", cut at the slack onset" if onsets and window[1] == min(onsets) else ""
    return f"s_o/l {window[0]:.3g} to {window[1]:.3g}{cut}"


def _path_row(a: Answer, b: Answer, allowed: float, window: Window) -> Agreement:
    x, y = foreign.comparable(a, b)
    gap, rms = measures.path_gap(x, y, window)
    why = f"asked for by path = {allowed:g}, relative to the largest deflection {b.max_deflection:.4g} m"
    # An error of the equations shows from somewhere on, one of the resolution comes and goes.
    steps = x if x.t.size <= y.t.size else y
    places = (steps.s_o / steps.length)[measures.inside(steps, window)]
    first = next((p for p in places[4:] if measures.path_gap(x, y, (window[0], p))[0] > allowed), None)
    parts = "" if first is None else f"they part from s_o/l = {first:.3f} on; "
    bars = "".join(
        f"; error bar of {r.method} {r.path_error:.2g}"
        for r in (a, b) if isinstance(r, Response) and r.path_error is not None
    )  # fmt: skip
    return Agreement(
        "path_max", gap, allowed,
        f"{why}; {parts}rms gap {rms:.3g}; over {_over(window, a, b)}{bars}",
        measures.place_of_gap(x, y, window),
    )  # fmt: skip


def _tension_row(a: Answer, b: Answer, allowed: float, window: Window) -> Agreement:
    why = f"asked for by tension = {allowed:g}"
    if not (isinstance(a, Response) and isinstance(b, Response)):
        gap = foreign.mass_tension_gap(a, b, window)
        return Agreement("tension", gap, allowed, f"{why}, rms at the mass, both sides, relative to H")
    gap = measures.tension_gap(a, b, window)
    frames = np.intersect1d(np.round(a.fields.s_o / a.length, 9), np.round(b.fields.s_o / b.length, 9))
    frames = frames[(frames >= window[0]) & (frames <= window[1])]
    worst = max(frames.tolist(), key=lambda place: measures.tension_gap(a, b, (place, place)))
    return Agreement(
        "tension",
        gap,
        allowed,
        f"{why}, rms of the field off the mass, relative to H; over {_over(window, a, b)}",
        worst,
    )


def check_solver(
    scene: Scene | str | Path, solver: Solver, *, name: str | None = None, tol: float = 1e-3,
    with_tol: float = foreign.WITH_TOL, ours: Check | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Check:  # fmt: skip
    """Run a user's own solver on a scene and hold it against both of ours; its rows come last in the verdict.

    solver : scene -> (s_o, v) or (s_o, v, u) in [m], v down, along the scene's travel; or a Response.
    tol, progress : of our own solvers, as in `check`.
    with_tol : allowed to the solver beside our error bar, relative to the largest deflection.
    ours : a check of this scene that was made before.

    Raises Refused if what it returns is no path on that scene.
    """
    scene = scene if isinstance(scene, Scene) else Scene.load(scene)
    name = name or str(getattr(solver, "__name__", type(solver).__name__))
    answer = solver(scene)
    if not isinstance(answer, Response):
        if not (isinstance(answer, tuple | list) and len(answer) in (2, 3)):
            raise Refused(f"{name}: must return (s_o, v) or (s_o, v, u), or a Response; got {type(answer).__name__}")
        answer = ForeignPath.of(scene, *answer, name=name)
    ours = ours or check(scene, tol=tol, progress=progress)
    foreign.refuse_misnamed(answer, ours.a.run)
    return foreign.joined(ours, answer, with_tol)
