"""Error bars from a run's own coarser companions: one with half the resolution in space, one with half the steps.

What the bar means: the true mass path is expected to lie within `path_error` times the largest deflection of the
computed one, over the window, and the tension field within `tension_error` times H (rms off the jump).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from cablefem.response import Response
from cablefem.scene import Scene
from validation import measures
from validation.methods import Method, find, refined
from validation.run import run

# A gap g between resolutions h and h/2 of order p leaves g/(2^p - 1).  Wave fronts pass the mass as spikes whose
# order is lower than the path's nominal one, so space is never credited with more than 3/2.
CREDITED_SPACE_ORDER = 1.5
TIME_ORDER = {"newmark": 1.0}  # all other schemes: 2
SAFETY = 1.25  # Roache's factor for three grids


@dataclass(frozen=True, slots=True)
class Estimated:
    """A run with its error bars and the companions they come from."""

    response: Response  # what is compared: the run, or its extrapolation where the ladder is regular
    run: Response  # the finest run itself
    in_space: Response  # half the resolution
    in_time: Response  # half the steps
    weights: tuple[float, float]  # what is left of the gaps to the companions in the finest run
    basis: str  # one sentence: where the bar comes from

    def bar(self, gap: Callable[[Response, Response], float]) -> float:
        """Return the error bar of a quantity from its gaps to the companions."""
        return self.weights[0] * gap(self.run, self.in_space) + self.weights[1] * gap(self.run, self.in_time)

    @property
    def runs(self) -> tuple[Response, ...]:
        return self.run, self.in_space, self.in_time


def space_order(method: Method) -> float:
    return min(method.space_order, CREDITED_SPACE_ORDER) if method.space_order > 1.0 else 1.0


def estimated(
    scene: Scene, method: str | Method, *, progress: Callable[[float], None] | None = None,
    finest: Response | None = None, in_time: Response | None = None, **kind: Any,
) -> Estimated:  # fmt: skip
    """Run a method with its two companions; `kind` holds model, load, law and settings as in `run`."""
    method = find(method) if isinstance(method, str) else method
    names = ("model", "load", "law")
    how = {k: kind[k] for k in names if k in kind}
    settings = method.settings({k: v for k, v in kind.items() if k not in names})
    half_space, half_time = refined(method, settings, space=0.5), refined(method, settings, time=0.5)

    def part(low: float, high: float) -> Callable[[float], None] | None:
        return None if progress is None else lambda x: progress(low + (high - low) * x)

    fine = finest or run(scene, method, **how, **settings, progress=part(0.0, 0.6))
    c_space = run(scene, method, **how, **half_space, progress=part(0.6, 0.8))
    c_time = in_time or run(scene, method, **how, **half_time, progress=part(0.8, 1.0))
    p_time = TIME_ORDER.get(settings["scheme"], 2.0)
    p = space_order(method)
    if method.extrapolate:
        # first order, regular: the extrapolation removes it; its own error is bounded by the part of the gap
        # that a next order p + 1/2 would leave
        response = measures.extrapolated(fine, c_space, 1.0)
        w_space = SAFETY / (2.0**1.5 - 1.0) * 0.5
        basis = f"extrapolated 2 f({settings[method.resolution]}) - f({half_space[method.resolution]})"
    else:
        response, w_space = fine, SAFETY / (2.0**p - 1.0)
        basis = (
            f"gap to half the {method.resolution} over 2^{p:g} - 1, gap to half the steps over 2^{p_time:g} - 1, "
            f"times {SAFETY}"
        )
    estimate = Estimated(response, fine, c_space, c_time, (w_space, SAFETY / (2.0**p_time - 1.0)), basis)
    return _with_bars(estimate)


def _with_bars(e: Estimated) -> Estimated:
    try:
        window = measures.window_of(*e.runs)
        gaps = [measures.path_gap(c, e.run, window)[0] for c in (e.in_space, e.in_time)]
        tension = [measures.tension_gap(c, e.run, window) for c in (e.in_space, e.in_time)]
    except measures.NotComparable:
        return e
    parts = {
        "path_space": e.weights[0] * gaps[0], "path_time": e.weights[1] * gaps[1],
        "tension_space": e.weights[0] * tension[0], "tension_time": e.weights[1] * tension[1],
    }  # fmt: skip
    bars = {
        "path_error": parts["path_space"] + parts["path_time"],
        "tension_error": parts["tension_space"] + parts["tension_time"],
        "error_parts": parts,
    }
    return replace(e, response=replace(e.response, **bars), run=replace(e.run, **bars))  # type: ignore[arg-type]
