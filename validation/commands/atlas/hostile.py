"""Random scenes, half of them hostile, against one promise: no traceback, no NaN, no hang, no silent wrong answer.

A silent wrong answer: status complete, not flagged as gaining energy, and over the stated range (`error_window`) the
true path error above three times the stated one.  A range cut short by a coarse companion is itself flagged.
"""

from __future__ import annotations

import math
import time
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from cablefem.response import Response
from cablefem.scene import Scene
from validation.core import measures
from validation.core.estimate import estimated
from validation.core.running import run
from validation.core.scenes import logarithmic, random_groups

TRAVELS = ("constant_speed", "constant_acceleration", "accelerate_cruise_brake")
SLOW = 30.0  # [s] of wall time: more than this for a few hundred steps counts as a hang
TIMES_STATED = 3.0  # the true error may be that much above the stated one
METHODS: dict[str, dict[str, Any]] = {
    "following-p2": {"elements": 8, "steps": 300}, "fourier-kink": {"terms": 12, "steps": 300},
}  # fmt: skip
FINE: dict[str, Any] = {"elements": 32, "steps": 2400}


@dataclass(frozen=True, slots=True)
class Draw:
    """One random scene by its groups, so that it can be made again; `scene` may refuse them."""

    number: int
    hostile: bool
    method: str
    groups: dict[str, Any]

    def scene(self) -> Scene:
        return Scene.from_groups(**self.groups)


def draws(n: int, seed: int) -> list[Draw]:
    """Return n random scenes; every second one hostile: beyond the usual ranges, or no scene at all."""
    rng = np.random.default_rng(seed)

    between = partial(logarithmic, rng)
    out = []
    for number in range(n):
        hostile = number % 2 == 1
        groups = random_groups(rng) | {"travel": TRAVELS[int(rng.integers(3))]}
        groups["slope"] *= float(rng.choice([-1.0, 1.0]))
        if hostile:
            worse: dict[str, Callable[[], Any]] = {
                "sag_ratio": lambda: between(1e-4, 2.0), "alpha": lambda: between(0.5, 1e8),
                "slope": lambda: float(rng.uniform(-80.0, 80.0)), "mu": lambda: between(1e-4, 1e3),
                "speed_ratio": lambda: between(0.005, 3.0),
            }  # fmt: skip
            senseless = (0.0, -1.0, math.nan, math.inf, 1e300, 1e-300)
            for name in rng.choice(list(worse), size=int(rng.integers(1, 4)), replace=False).tolist():
                groups[name] = worse[name]()
            if rng.random() < 0.15:
                name = str(rng.choice(list(worse)))
                groups[name] = float(senseless[int(rng.integers(len(senseless)))])
        out.append(Draw(number, hostile, list(METHODS)[int(rng.integers(2))], groups))
    return out


def faults_of(r: Response) -> list[str]:
    """Return what breaks the promise in a response itself: numbers that are none, an end without a reason."""
    out = []
    for name in ("t", "s_o", "x", "y", "u", "v", "velocity", "acceleration", "energy", "power", "tension_min"):
        if not np.isfinite(getattr(r, name)).all():
            out.append(f"{name} is not finite")
    for name in ("T", "u", "v", "du", "dv"):
        if not np.isfinite(getattr(r.fields, name)).all():
            out.append(f"fields.{name} is not finite")
    inner = (r.s_o > 0.0) & (r.s_o < r.length)
    if not (np.isfinite(r.T_behind[inner]).all() and np.isfinite(r.T_ahead[inner]).all()):
        out.append("a tension at the mass is not finite")
    if r.status == "incomplete" and not (r.reason and r.cause):
        out.append("incomplete without a reason")
    return out


def examine(draw: Draw, *, estimate: bool = True, truth: bool = False) -> dict[str, Any]:
    """Run one draw and return its outcome as data.

    outcome : "refused" (the scene's faults are said), "complete", "incomplete", or a broken promise: "traceback",
        "not finite", "hang", "silent".
    truth : also against a much finer run; only then can "silent" be seen.
    """
    begin = time.perf_counter()
    return _examine(draw, estimate, truth) | {"seconds": time.perf_counter() - begin}


def _examine(draw: Draw, estimate: bool, truth: bool) -> dict[str, Any]:
    out: dict[str, Any] = {"number": draw.number, "hostile": draw.hostile, "method": draw.method, "groups": draw.groups}
    begin = time.perf_counter()
    try:
        try:
            scene = draw.scene()
        except ValueError as error:
            return out | {"outcome": "refused", "reason": str(error)}
        if estimate:
            r = estimated(scene, draw.method, **METHODS[draw.method]).run
        else:
            r = run(scene, draw.method, **METHODS[draw.method])
        out |= {
            "outcome": r.status, "cause": r.cause, "reason": r.reason, "reached": r.reached, "flags": r.flag_kinds,
            "slack_onset": r.slack_onset, "stated": r.path_error,
        }  # fmt: skip
        faults = faults_of(r)
        if faults:
            return out | {"outcome": "not finite", "reason": "; ".join(faults)}
        if time.perf_counter() - begin > SLOW:
            return out | {"outcome": "hang", "reason": f"{time.perf_counter() - begin:.0f} s"}
        if truth and r.status == "complete" and r.path_error is not None and "energy" not in r.flag_kinds:
            out |= _truth(scene, r)
    except Exception:  # the one place that must see every exception: it counts them
        return out | {"outcome": "traceback", "reason": traceback.format_exc(limit=-4)}
    return out


def _truth(scene: Scene, r: Response) -> dict[str, Any]:
    """Compare with a much finer run over the range that the response states for its error."""
    fine = run(scene, "following-p2", **FINE)
    half = run(scene, "following-p2", **{k: v // 2 for k, v in FINE.items()})
    try:
        assert r.error_window is not None
        window = measures.window_of(r, fine, half, window=(r.error_window[0], r.error_window[1]))
        true, unsure = (measures.path_gap(x, fine, window)[0] for x in (r, half))
    except measures.NotComparable:
        return {"true": None}
    assert r.path_error is not None
    if true - unsure > TIMES_STATED * r.path_error:
        return {"true": true, "unsure": unsure, "outcome": "silent"}
    return {"true": true, "unsure": unsure}


BROKEN = ("traceback", "not finite", "hang", "silent")


def hostile_survey(
    n: int = 2000, seed: int = 2003, *, truth_every: int = 10, progress: Callable[[str, float], None] | None = None,
    keep: Callable[[dict[str, Any]], None] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Examine n random scenes and count the outcomes; every `truth_every`-th is held against a much finer run.

    keep : called with every outcome as it comes, to store it.
    """
    counts: Counter[str] = Counter()
    broken, judged = [], 0
    for draw in draws(n, seed):
        outcome = examine(draw, truth=draw.number // 2 % truth_every == 0)
        counts[outcome["outcome"]] += 1
        judged += outcome.get("true") is not None
        if outcome["outcome"] in BROKEN:
            broken.append(outcome)
        if keep is not None:
            keep(outcome)
        if progress is not None:
            progress("random scenes", (draw.number + 1) / n)
    return {"n": n, "seed": seed, "counts": dict(counts), "judged": judged, "broken": broken}
