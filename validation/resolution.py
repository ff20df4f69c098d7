"""From a tolerance to a resolution: refine space and time, whichever dominates, until the error bar is small enough."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from cablefem.scene import Scene
from validation.estimate import TIME_ORDER, Estimated, estimated, space_order
from validation.methods import Method, find, refined

FIRST = {"elements": 6, "terms": 16, "level": 0, "steps": 150}
MOST = {"elements": 640, "terms": 240, "level": 5, "steps": 64_000}


def resolve(
    scene: Scene, method: str | Method, tol: float, *, progress: Callable[[float], None] | None = None, **kind: Any
) -> Estimated:
    """Return an estimated run whose path error bar is at most `tol`, or the finest one within reach (its bar says so).

    The gaps to the companions with half the resolution and half the steps tell what each contributes; the orders
    predict the next settings, with a little in hand, and the prediction is checked by running it.
    """
    method = find(method) if isinstance(method, str) else method
    settings = {**kind, method.resolution: FIRST[method.resolution], "steps": FIRST["steps"]}
    best: Estimated | None = None
    for attempt in range(8):
        trial = estimated(scene, method, **settings)
        if progress is not None:
            progress(min(0.95, (attempt + 1) / 4))
        bar = trial.run.path_error
        if bar is None:  # the run broke before the window: finer steps may get it through
            factors = (1.5, 2.0)
        else:
            best = trial
            if bar <= tol:
                break
            parts = trial.run.error_parts
            assert parts is not None
            p_time = TIME_ORDER.get(trial.run.settings["scheme"], 2.0)
            factors = (
                _factor(parts["path_space"], 0.5 * tol, space_order(method)),
                _factor(parts["path_time"], 0.4 * tol, p_time),
            )
        chosen = method.settings({k: v for k, v in settings.items() if k not in ("model", "load", "law")})
        finer = refined(method, chosen, space=factors[0], time=factors[1])
        finer[method.resolution] = min(finer[method.resolution], MOST[method.resolution])
        finer["steps"] = min(finer["steps"], MOST["steps"])
        if all(finer[k] == settings.get(k, finer[k]) for k in (method.resolution, "steps")):
            best = trial if best is None else best
            break
        settings |= {k: finer[k] for k in (method.resolution, "steps")}
        last = trial
    if progress is not None:
        progress(1.0)
    return best if best is not None else last


def _factor(part: float, share: float, order: float) -> float:
    """Return the refinement that brings a part of the error down to its share, at most 4 at once."""
    return 1.0 if part <= share else min(4.0, max(1.2, (part / share) ** (1.0 / order)))
