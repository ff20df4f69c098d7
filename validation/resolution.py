"""From a tolerance to a resolution: a coarse run tells what space and time each contribute, orders predict the rest."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from cablefem.response import Response
from cablefem.scene import Scene
from validation import measures
from validation.estimate import SAFETY, TIME_ORDER, Estimated, estimated, space_order
from validation.methods import Method, find
from validation.run import run

# First run for tol = 1e-2; finer tolerances start finer.  Chosen on the paper's level cable; only cost depends on it.
FIRST = {"elements": 6, "terms": 10, "level": 0, "steps": 150}
MOST = {"elements": 640, "terms": 240, "level": 5, "steps": 64_000}
ATTEMPTS = 6
AIM = 0.8  # of the tolerance, so that a prediction that is a little short does not cost another run

Progress = Callable[[float], None]


class TooCoarse(RuntimeError):
    """No resolution within reach meets the tolerance; `best` is the finest run made, with its error bar."""

    def __init__(self, message: str, best: Response) -> None:
        super().__init__(message)
        self.best = best


@dataclass(slots=True)
class _Rung:
    """A run and what space and time contribute to its error bar."""

    response: Response
    space: float
    time: float

    @property
    def bar(self) -> float:
        return self.space + self.time


def resolve(
    scene: Scene, method: str | Method, tol: float, *, progress: Progress | None = None, **kind: Any
) -> Response:
    """Return a run whose path error bar is at most `tol`, at nearly the least cost; `kind` as in `run`.

    A coarse run with its two companions (half the resolution, half the steps) gives the parts s and t of its error.
    Refining space by a and time by b leaves s/a^p + t/b^2; a and b are chosen for the least cost, and the finer run's
    distance from the coarse one checks the prediction: its bar is the larger of the predicted error and Richardson's
    estimate from that distance.

    Raises TooCoarse, with the finest run, if the tolerance is out of reach.
    """
    method = find(method) if isinstance(method, str) else method
    if method.wrong:
        raise ValueError(f"{method.name} converges to a wrong answer: no resolution meets a tolerance")
    report = progress or (lambda fraction: None)
    settings = _first(method, tol)
    rung = _split(scene, method, kind | settings)
    report(0.2)
    for attempt in range(ATTEMPTS):
        if rung.bar <= tol:
            report(1.0)
            return rung.response
        finer = _next(method, rung, settings, tol)
        if finer == settings:
            break
        response = run(scene, method, **kind | finer)
        rung = _checked(method, rung, settings, response, finer)
        settings = finer
        report(min(0.95, 0.5 + 0.15 * attempt))
    raise TooCoarse(
        f"{method.name} reaches an error bar of {rung.bar:.2g} with {_told(settings)}, not the {tol:g} asked for; "
        "loosen the tolerance or take another method (cablefem advise)",
        rung.response,
    )


def resolved(
    scene: Scene, method: str | Method, tol: float, *, progress: Progress | None = None, **kind: Any
) -> Estimated:
    """Return the run of `resolve` with companions of its own, or the finest within reach: its bars tell."""
    method = find(method) if isinstance(method, str) else method
    for aim in (tol, 0.5 * tol):
        try:
            finest = resolve(scene, method, aim, progress=progress, **kind)
        except TooCoarse as error:
            return _companions(scene, method, error.best, kind)
        estimate = _companions(scene, method, finest, kind)
        if estimate.run.path_error is not None and estimate.run.path_error <= tol:
            return estimate
    return estimate


def _companions(scene: Scene, method: Method, finest: Response, kind: dict[str, Any]) -> Estimated:
    how = {k: kind[k] for k in ("model", "load", "law") if k in kind}
    return estimated(scene, method, finest=finest, **how, **finest.settings)


def _first(method: Method, tol: float) -> dict[str, Any]:
    finer = max(1.0, 1e-2 / tol)
    space = FIRST[method.resolution]
    if method.resolution != "level":
        space = round(space * finer**0.25)
    return {method.resolution: space, "steps": round(FIRST["steps"] * finer**0.4)}


def _split(scene: Scene, method: Method, settings: dict[str, Any]) -> _Rung:
    """Run a method with both companions; a run that ends before the window is refined until it does not."""
    for _ in range(4):
        e = estimated(scene, method, **settings)
        parts = e.run.error_parts
        if parts is not None:
            return _Rung(e.response, parts["path_space"], parts["path_time"])
        settings |= {"steps": 2 * settings["steps"]}
    return _Rung(e.run, math.inf, math.inf)


def _growth(method: Method) -> float:
    """Cost of a step ~ (resolution)^growth: banded elements 1, dense bases between 2 and 3."""
    return 1.0 if method.wing == "elements" else 2.0


def _next(method: Method, rung: _Rung, settings: dict[str, Any], tol: float) -> dict[str, Any]:
    """Return the settings that meet AIM * tol at the least cost (resolution^g * steps), at most 4 times finer each.

    With parts s/a^p and t/b^r the least a^g b is where p s/a^p / g = r t/b^r.
    """
    if not math.isfinite(rung.bar):
        factor_space, factor_time = 2.0, 4.0
    else:
        p, r, g = space_order(method), TIME_ORDER.get(rung.response.settings["scheme"], 2.0), _growth(method)
        share = (r * g) / (r * g + p)
        factor_space = _factor(rung.space, share * AIM * tol, p)
        factor_time = _factor(rung.time, (1.0 - share) * AIM * tol, r)
    finer = dict(settings)
    if method.resolution == "level":
        finer["level"] = settings["level"] + math.ceil(math.log2(factor_space) - 0.2)
    else:
        finer[method.resolution] = math.ceil(settings[method.resolution] * factor_space)
    finer["steps"] = math.ceil(settings["steps"] * factor_time)
    return {k: min(v, MOST[k]) for k, v in finer.items()}


def _factor(part: float, share: float, order: float) -> float:
    return 1.0 if part <= share else min(4.0, (part / share) ** (1.0 / order))


def _checked(method: Method, coarse: _Rung, before: dict[str, Any], response: Response, after: dict[str, Any]) -> _Rung:
    """Return the finer run with its bar: predicted from the coarse parts, corrected by the distance to the coarse run."""
    p, r = space_order(method), TIME_ORDER.get(response.settings["scheme"], 2.0)
    steps = after["steps"] / before["steps"]
    space = after[method.resolution] / max(1, before[method.resolution])
    if method.resolution == "level":
        space = 2.0 ** (after["level"] - before["level"])
    try:
        window = measures.window_of(response, coarse.response)
        gap = measures.path_gap(coarse.response, response, window)[0]
        tension = measures.tension_gap(coarse.response, response, window)
    except measures.NotComparable:
        return _Rung(response, math.inf, math.inf)
    if math.isfinite(coarse.bar):
        parts = coarse.space / space**p, coarse.time / steps**r
        fall = coarse.bar / sum(parts)
    else:
        parts, fall = (0.5, 0.5), min(space**p, steps**r)
    richardson = SAFETY * gap / (fall - 1.0) if fall > 1.0 else math.inf
    scale = max(1.0, richardson / sum(parts))
    rung = _Rung(response, scale * parts[0], scale * parts[1])
    if math.isfinite(rung.bar):
        rung.response = replace(
            response, path_error=rung.bar, tension_error=SAFETY * tension / (fall - 1.0),
            error_parts={"path_space": rung.space, "path_time": rung.time},
        )  # fmt: skip
    return rung


def _told(settings: dict[str, Any]) -> str:
    return ", ".join(f"{k} = {v}" for k, v in settings.items())
