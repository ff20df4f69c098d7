"""One answer: the run that was asked for, its design numbers and events, and bars from coarser runs."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from cablefem.response import Response
from cablefem.scene import Scene
from validation.core.climb import TooCoarse, climb, laddered, refined_until
from validation.core.design import design
from validation.core.methods import Method, find
from validation.core.quasi_static import quasi_static
from validation.core.rows import forces_left, with_bars
from validation.core.running import run
from validation.core.sampling import FRAMES
from validation.core.sidebyside import silent
from validation.page.answer import many as table
from validation.page.options import Point


def answer(
    scene: Scene, method: Method | None, *, tol: float | None, bars: bool, progress: Callable[..., None], **kind: Any
) -> tuple[Response, str]:
    """Run a method with the settings in `kind`, or with those that its bar needs to meet `tol`.

    Returns the response with its design numbers, and why the tolerance is out of reach, else "".
    Without a method: the quasi-static ride.
    """
    if method is None or (tol is None and not bars):
        response = quasi_static(scene) if method is None else run(scene, method, **kind, progress=progress)
        return replace(response, design=design(response)), ""
    missed = ""
    if tol is None:
        ladder = laddered(scene, method, **kind, progress=progress)
    else:
        try:
            ladder = climb(scene, method, tol, **kind, progress=progress)
            # mean forces, as in `check`
            ladder = refined_until(scene, ladder, lambda x: forces_left(scene, x, tol), **kind)
        except TooCoarse as error:
            ladder, missed = error.ladder, str(error)
    return replace(ladder.run, design=design(ladder), events=with_bars(ladder)), missed


def run_with_bars(
    scene: Scene, method: str = "following-p2", *, tol: float | None = None, bars: bool = True, model: str = "full",
    load: str = "mass", law: str = "auto", frames: int = FRAMES, **settings: Any,
) -> Response:  # fmt: skip
    """Run one method as `cablefem run` does: with design numbers, events and their bars.

    method : see `cablefem methods`; settings : of the method, as elements=20, steps=800.
    tol : of the path, relative to its largest deflection; resolution and steps are then chosen.
    frames : least number of instants at which the fields are kept, for `Response.at`; default 100.
    run("zipline", tol=1e-3).design
    """
    kind = {"model": model, "load": load, "law": law, "frames": frames, **settings}
    return answer(scene, find(method), tol=tol, bars=bars, progress=silent, **kind)[0]


def many(scene: Scene, points: Sequence[Point], answered: Callable[..., tuple[Response, str]], out: Path | None) -> int:
    """Answer every point of a grid; 2 where a run broke."""

    def row(point: Point) -> tuple[table.Row, Any]:
        found = answered(point, silent)[0]
        return table.row(point.scene, found), table.path(found)

    rows = table.grid("run", "grid", scene, points, out, row, table.columns)
    return 2 if any(x["outcome_kind"] == "incomplete" for x in rows) else 0
