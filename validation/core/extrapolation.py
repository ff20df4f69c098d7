"""Answers extrapolated in time: three nested runs, and only where they show the order of their scheme.

With f_1, f_2, f_4 the runs with all, half and a quarter of the steps and the order p of the scheme, the extrapolants
are f_1 + (f_1 - f_2)/(2^p - 1) and f_2 + (f_2 - f_4)/(2^p - 1).  The first is the answer, their distance its bar: both
have lost the same order, so what is left in the better one is a part of what they differ by.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from cablefem import newmark
from cablefem.response import Response
from cablefem.scene import Scene
from validation.core import measures
from validation.core.estimate import KIND, Estimated
from validation.core.flags import flagged
from validation.core.methods import Method, find, refined
from validation.core.running import run

# The gaps' ratio must be that of the order to so much, in the largest and in the root mean square: the second order of
# the trapezoidal rule is then seen between 1.7 and 2.3.
SEEN = 0.3
UNSEEN = "not extrapolated"  # kind of the flag


@dataclass(frozen=True, slots=True)
class Extrapolated:
    """The extrapolant where the order was seen, else the finest run with a flag."""

    response: Response
    runs: tuple[Response, Response, Response]  # with all, half and a quarter of the steps
    order: float  # of the scheme
    observed: tuple[float, float]  # from the largest and the root mean square gap of the path
    path_bar: float  # relative to the largest deflection, of time alone; infinite where the order was not seen
    tension_bar: float  # relative to H

    def with_bars(self, e: Estimated) -> Response:
        """Return the answer with what space contributes by an estimate of the same run, time by the extrapolants."""
        if not self.seen:
            return replace(e.run, flags=[*e.run.flags, *(f for f in self.response.flags if f.kind == UNSEEN)])
        if e.run.error_parts is None:
            return replace(self.response, flags=e.run.flags)
        parts = e.run.error_parts | {"path_time": self.path_bar, "tension_time": self.tension_bar}
        return replace(
            self.response, flags=e.run.flags, error_parts=parts, error_window=e.run.error_window,
            path_error=parts["path_space"] + parts["path_time"],
            tension_error=parts["tension_space"] + parts["tension_time"],
        )  # fmt: skip

    @property
    def seen(self) -> bool:
        return math.isfinite(self.path_bar)


def extrapolated(
    scene: Scene, method: str | Method, *, progress: Callable[[float], None] | None = None, **kind: Any
) -> Extrapolated:
    """Run a method with all, half and a quarter of its steps and extrapolate; `kind` as in `estimate.estimated`.

    Error bars of time only: what space contributes is not in them.  Raises ValueError for fewer than 8 steps.
    """
    method = find(method) if isinstance(method, str) else method
    how = {k: kind[k] for k in KIND if k in kind}
    settings = method.settings_on(scene.groups, {k: v for k, v in kind.items() if k not in KIND})
    if settings["steps"] < 8:
        raise ValueError(f"steps must be at least 8 to be halved twice, got {settings['steps']}")
    report = progress or (lambda done: None)

    def part(share: float, begin: float, end: float) -> Response:
        fewer = refined(method, settings, time=share)
        return run(scene, method, **how, **fewer, progress=lambda x: report(begin + (end - begin) * x))

    runs = part(1.0, 0.0, 0.57), part(0.5, 0.57, 0.86), part(0.25, 0.86, 1.0)
    scheme = newmark.scheme(settings["scheme"], newmark_gamma=settings["newmark_gamma"], rho_inf=settings["rho_inf"])
    return of_runs(runs, scheme.order)


def of_runs(runs: tuple[Response, Response, Response], order: float) -> Extrapolated:
    """Extrapolate three runs with all, half and a quarter of the steps."""
    fine, half, quarter = runs

    def unseen(observed: tuple[float, float], why: str) -> Extrapolated:
        kept = flagged(fine, UNSEEN, why=why)
        return Extrapolated(kept, runs, order, observed, math.inf, math.inf)

    try:
        window = measures.window_of(*runs)
        first, second = (measures.path_gap(a, b, window) for a, b in ((half, fine), (quarter, half)))
    except measures.NotComparable as error:
        return unseen((math.nan, math.nan), str(error))
    if min(first) == 0.0 or not all(map(math.isfinite, first + second)):
        return unseen((math.nan, math.nan), "the runs do not differ")
    observed = math.log2(second[0] / first[0]), math.log2(second[1] / first[1])
    if max(abs(p - order) for p in observed) > SEEN:
        told = (
            f"of order {order:g} in time, and the path shows {observed[0]:.2f} (largest gap), {observed[1]:.2f} (rms)"
        )
        return unseen(observed, told)
    better, worse = measures.extrapolated(fine, half, order), measures.extrapolated(half, quarter, order)
    path, tension = measures.path_gap(worse, better, window)[0], measures.tension_gap(worse, better, window)
    return Extrapolated(better, runs, order, observed, path, tension)
