"""The one change of times, places, heights or scale that would make another program's path agree."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from cablefem.response import Response
from validation.core.measures import NotComparable

SHARE = 0.1  # of duration, deflection or 1: the largest change


def remedy(path: Any, ours: Response, gaps: Callable[[Any], Any], allowed: Sequence[float]) -> str | None:
    """The change that explains the gap best, in words, or None if none does.

    path : a third party's path;  gaps : its gap, largest and rms;  allowed : of both.
    """
    lasts, deep, far = float(ours.t[-1]), float(np.abs(ours.v).max()), ours.length / 20.0
    changes: dict[str, tuple[Callable[[float], Any], float]] = {
        "its times are shifted by {:.3g} s": (lambda x: replace(path, t=path.t + x), SHARE * lasts),
        "its places are shifted by {:.3g} m": (partial(_moved, path, ours), SHARE * far),
        "its v is multiplied by {:.4g}": (lambda x: _higher(path, x * path.v), SHARE),
        "its heights are shifted by {:.3g} m downwards": (partial(_higher, path), SHARE * deep),
    }
    found = []
    for words, (changed, most) in changes.items():

        def off(x: float, changed: Callable[[float], Any] = changed, i: int = 1) -> float:
            try:
                return gaps(changed(x))[i]
            except (NotComparable, ValueError):
                return np.inf

        x = float(minimize_scalar(off, bounds=(-most, most), method="bounded", options={"xatol": 1e-6 * most}).x)
        worst = off(x, i=0)
        if worst <= allowed[0] and off(x) <= allowed[1]:
            found.append((worst, words.format(1.0 + x if "multiplied" in words else x)))
    return f"agrees if {min(found)[1]}" if found else None


def _moved(path: Any, ours: Response, by: float) -> Any:
    """The path with its places moved; on a given travel this moves its times, too."""
    if path.drive == "free":
        return path if path.x is None else replace(path, x=path.x + by)
    s_o = path.s_o + by
    return replace(path, s_o=s_o, t=np.interp(s_o, ours.s_o, ours.t))


def _higher(path: Any, by: Any) -> Any:
    return replace(path, v=path.v + by, y=None if path.y is None else path.y + by)
