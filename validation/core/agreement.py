"""Verdicts: do two answers agree within what both say of their own errors?"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cablefem.response import Array, Response
from cablefem.scene import Scene
from validation.core import measures
from validation.core.bounds import Bound, Part, nothing
from validation.core.estimate import Estimated
from validation.core.measures import NotComparable, Window
from validation.core.richardson import SAFETY


class Verdict(enum.Enum):
    AGREE, DISAGREE, NOT_COMPARABLE = "agree", "disagree", "not comparable"


@dataclass(frozen=True, slots=True)
class Agreement:
    """One row of a verdict: a gap, and the bound that says how much is allowed and why."""

    quantity: str
    gap: float
    bound: Bound
    where: float | None = None  # s_o/l of the largest gap
    party: str = ""  # the third party that is held against our better solver

    @property
    def allowed(self) -> float:
        return self.bound.value

    @property
    def allowed_because(self) -> str:
        return str(self.bound)

    @property
    def verdict(self) -> Verdict:
        if self.bound.tol is not None or not (math.isfinite(self.gap) and math.isfinite(self.allowed)):
            return Verdict.NOT_COMPARABLE
        return Verdict.AGREE if self.gap <= self.allowed else Verdict.DISAGREE

    def row(self) -> dict[str, Any]:
        """Return the row for agreement.json; a number that does not exist is null."""
        return {
            "quantity": self.quantity, "gap": self.gap if math.isfinite(self.gap) else None,
            "allowed": self.allowed if math.isfinite(self.allowed) else None,
            "allowed_because": self.allowed_because, "bound": self.bound.row(), "verdict": self.verdict.value,
            "where": self.where, **({"with": self.party} if self.party else {}),
        }  # fmt: skip


def overall(rows: list[Agreement]) -> Verdict:
    """Return disagree if any row disagrees, else not comparable if any row is, else agree."""
    verdicts = [row.verdict for row in rows]
    for verdict in (Verdict.DISAGREE, Verdict.NOT_COMPARABLE):
        if verdict in verdicts or not rows:
            return verdict if rows else Verdict.NOT_COMPARABLE
    return Verdict.AGREE


def agree(
    scene: Scene, a: Estimated, b: Estimated, *, tol: float | None = None, window: Window | None = None
) -> list[Agreement]:
    """Compare two estimated runs; every allowed gap is the sum of the two solvers' own error bars.

    tol : asked of the mass path: where the bars of `path_max` or `path_rms` exceed it, the row is "not comparable".
    window : s_o/l; default 0.02 to 0.80 or the slack onset of any of the runs, whichever comes first.
    """
    try:
        window = measures.window_of(*a.runs, *b.runs, window=window or measures.WINDOW)
    except NotComparable as error:
        return [Agreement("path_max", math.nan, nothing(error))]
    rows = []
    max_gap, rms_gap = measures.path_gap(a.response, b.response, window)
    where = measures.place_of_gap(a.response, b.response, window)
    for i, (name, gap) in enumerate((("path_max", max_gap), ("path_rms", rms_gap))):

        def of_path(x: Response, y: Response, i: int = i) -> float:
            return measures.path_gap(x, y, window)[i]

        row = _row(name, gap, a, b, of_path, where if i == 0 else None)
        if tol is not None and row.allowed > tol:
            row = replace(row, bound=replace(row.bound, tol=tol))
        rows.append(row)
    rows.append(_row(
        "tension", measures.tension_gap(a.response, b.response, window), a, b,
        lambda x, y: measures.tension_gap(x, y, window),
    ))  # fmt: skip
    for name, series in (("jump", _jump_series(scene)), ("energy", _energy_series(scene))):
        rows.append(_law(name, series, a, b, window))
    rows.append(_first_order("overshoot", measures.oscillation_gap(a.response, b.response, window), a, b, window))
    return rows


def _row(
    name: str,
    gap: float,
    a: Estimated,
    b: Estimated,
    of: Callable[[Response, Response], float],
    where: float | None = None,
) -> Agreement:
    bars = tuple(Part(e.run.method, e.bar(of), e.basis) for e in (a, b))
    return Agreement(name, gap, Bound("error bars", bars), where)


# One-sided slopes at the mass and what oscillates around it converge with first order: the gap to half the resolution
# and half the steps is what is left.
FIRST_ORDER = f"the change from half the resolution and half the steps, times {SAFETY}"


def _first_order(name: str, gap: float, a: Estimated, b: Estimated, window: Window) -> Agreement:
    bars = [SAFETY * sum(measures.oscillation_gap(e.run, c, window) for c in (e.in_space, e.in_time)) for e in (a, b)]
    parts = tuple(Part(e.run.method, bar, FIRST_ORDER) for e, bar in zip((a, b), bars, strict=True))
    return Agreement(name, gap, Bound("error bars", parts))


Series = Callable[[Response], Array]


def _jump_series(scene: Scene) -> Series:
    assert scene.mass is not None
    mass, rho, g = scene.mass.mass, scene.cable.mass_per_length, scene.gravity
    return lambda r: measures.jump_defect(r, mass, rho, g) / (mass * g)


def _energy_series(scene: Scene) -> Series:
    assert scene.mass is not None
    weight = scene.mass.mass * scene.gravity
    return lambda r: measures.energy_defect(r)[:, None] / (weight * r.max_deflection)


def _law(name: str, series: Series, a: Estimated, b: Estimated, window: Window) -> Agreement:
    """Hold a law of mechanics, whose exact defect is zero, against each run: its defect must be its error bar."""
    worst: Agreement | None = None
    for e in (a, b):
        defect = series(e.run)
        inside = measures.inside(e.run, window)
        gap = _rms(defect[inside])

        def distance(x: Response, y: Response) -> float:
            coarse, fine = (x, y) if x.t.size <= y.t.size else (y, x)
            inside = measures.inside(coarse, window)
            return _rms((series(coarse) - measures.at_steps_of(coarse, fine, np.nan_to_num(series(fine))))[inside])

        bar = SAFETY * (distance(e.run, e.in_space) + distance(e.run, e.in_time))
        row = Agreement(name, gap, Bound("law", (Part(e.run.method, bar, FIRST_ORDER),)))
        if worst is None or row.gap * worst.allowed > worst.gap * row.allowed:
            worst = row
    assert worst is not None
    return worst


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(np.square(x), axis=-1))))
