"""Signs of error: energy gain, hidden compression, waves slower than the mass."""

import math
from dataclasses import replace

import numpy as np

from cablefem.response import Flag, Response
from cablefem.scene import Scene
from validation.core import measures, store
from validation.core.measures import SLACK_END
from validation.core.methods import Method

MOST_GAIN = 0.2  # of the energy's range; right runs gain 0.12, wrong ones 0.6
MOST_GAIN_SLACK = 2.0  # the same after the onset; runs that agree 1.4, others from 9


WORDS = store.shipped(__package__, "flags.toml")


def flag(kind: str, **numbers: float | str) -> Flag:
    """A flag of a kind in flags.toml with its numbers."""
    made = Flag(kind, WORDS[kind], numbers)
    str(made)  # fails if a number is missing
    return made


def flagged(r: Response, kind: str, **numbers: float | str) -> Response:
    return replace(r, flags=[*r.flags, flag(kind, **numbers)])


def watched(r: Response, scene: Scene, method: Method) -> Response:
    """The response with its energy gain before slack, and its flags."""
    assert scene.mass is not None
    reached = math.inf if r.drive == "free" else r.reached  # a ride may roll back
    stop = min(measures.WINDOW[1], reached, math.inf if r.switched is None else r.switched)
    if r.t.size < 3 or not r.max_deflection > 0.0 or not measures.inside(r, (0.0, stop)).any():
        return r
    weight = scene.mass.mass * scene.gravity
    unit = max(1.0, float(np.ptp(r.energy[measures.inside(r, (0.0, stop))])) / (weight * r.max_deflection))
    gain = measures.energy_gain(r, weight, (0.0, stop))
    flags = _waves(r, scene, method)
    if scene.speed_ratio is not None and scene.speed_ratio >= 1.0:
        # V/c = 1.1: half the true error; 1.5: no convergence
        flags.insert(0, flag("fast", speed_ratio=scene.speed_ratio))
    if not gain <= MOST_GAIN * unit:
        flags.append(flag("energy", gain=gain / unit, allowed=MOST_GAIN))
        if r.cause is not None:
            r = replace(r, cause="unstable", reason=f"{flags[-1]}; it broke at s_o/l = {r.reached:.3f}")
    else:
        flags += _gain_once_slack(r, weight, unit)
    return replace(r, energy_gain=gain, flags=flags)


def _gain_once_slack(r: Response, weight: float, unit: float) -> list[Flag]:
    if r.switched is None or not measures.inside(r, (r.switched, SLACK_END)).any():
        return []
    gain = measures.energy_gain(r, weight, (r.switched, SLACK_END)) / unit
    return [] if gain <= MOST_GAIN_SLACK else [flag("slack energy", gain=gain, since=r.switched)]


# s_o/l from compression at a point to slack of an element; right runs 0.01
HIDDEN = 0.03


def _waves(r: Response, scene: Scene, method: Method) -> list[Flag]:
    """Flag waves, of speed sqrt(N/rho), slower than the mass, and compression in part of an element.

    Only methods that resolve the kink at the mass tell them from ripples.
    """
    if method.wing != "elements" or method.space_order < 2.0:
        return []
    end = min(measures.WINDOW[1], r.reached, r.slack_from - HIDDEN)
    within = measures.inside(r, (measures.WINDOW[0], end))
    N = r.tension_min
    short = {}
    if scene.speed_ratio is not None and scene.speed_ratio < 1.0:
        short["slow waves"] = N - scene.rho * np.gradient(r.s_o, r.t) ** 2
    flags = []
    for kind, under in (short | {"hidden slack": N}).items():
        low = np.flatnonzero(within & (under < 0.0))
        if low.size:
            least = float(N[low[under[low].argmin()]] / r.horizontal_tension)
            since = float(r.s_o[low[0]] / r.length)
            at = float(r.tension_min_at[low[0]] / r.length)
            flags.append(flag(kind, least=least, since=since, at=at))
    return flags
