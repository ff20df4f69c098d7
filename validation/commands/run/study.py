"""One answer: the run that was asked for, its design numbers and events, and bars from coarser runs."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from cablefem.response import MassPath, Response
from cablefem.scene import Scene
from validation.core.agreement import with_bars
from validation.core.design import design, numbers
from validation.core.estimate import companions, estimated
from validation.core.methods import Method
from validation.core.resolution import TooCoarse, past_window, resolve
from validation.core.running import run


@dataclass(frozen=True, slots=True)
class Answer:
    """A response, and what else is to be said of it."""

    response: Response
    missed: str = ""  # why the tolerance is out of reach
    extrapolated: str = ""  # what the runs that it was extrapolated from have shown


def answer(
    scene: Scene, method: Method, *, tol: float | None, bars: bool, extrapolate: bool, progress: Callable[..., None],
    **kind: Any,
) -> Answer:  # fmt: skip
    """Run a method with the settings in `kind`, or with those that its own bar needs to meet `tol`."""
    missed, seen, known = "", "", list[MassPath]()
    if tol is not None:
        try:
            response = resolve(scene, method, tol, **kind, progress=progress, runs=known if bars else None)
        except TooCoarse as error:
            response, missed = error.best, str(error)
        else:
            bar = {x: getattr(response, x) for x in ("path_error", "tension_error", "error_parts")}
            response = replace(past_window(scene, method, response, known, **kind), **bar)
        if bars:  # the ladder has told the bar of the path
            e = companions(scene, method, known=known, **kind | response.settings, progress=progress)
    elif extrapolate:
        from validation.core.extrapolation import extrapolated

        better = extrapolated(scene, method, **kind, progress=progress)
        response = better.response
        if better.seen:
            seen = f"order {better.observed[1]:.2f} seen, bar of time alone {better.path_bar:.1e} of the largest "
            seen += f"deflection, tension {better.tension_bar:.1e} H"
        if bars:
            e = estimated(scene, method, known=better.runs, **kind, progress=progress)
            response = better.with_bars(e)
    elif bars:
        e = estimated(scene, method, **kind, progress=progress)
        response = e.run
    else:
        response = run(scene, method, **kind, progress=progress)
    if not bars:
        return Answer(replace(response, design=design(response)), missed, seen)
    told = [number.row() for number in numbers(e)]
    return Answer(replace(response, design=told, events=with_bars(scene, e)), missed, seen)
