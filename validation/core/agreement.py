"""The verdict on a row: gap, bars and tolerance."""

import enum
import math
from collections.abc import Iterable
from dataclasses import dataclass
from numbers import Real
from typing import Any, NamedTuple

from validation.core.store import nulls_for_nonfinite

DEFAULT_TOL = 1e-3
FORCES = 10.0  # tolerance of forces over that of the path: forces are first order, paths second
TOL_LOW = 1e-6  # what may be asked of the path
TOL_HIGH = 0.2
FACTOR_DISAGREE = 3.0  # times both bars: less may be discretisation error (`order.error_bar`)


class Verdict(enum.Enum):
    """In order of precedence."""

    DISAGREE = "disagree"
    NOT_COMPARABLE = "not comparable"
    TOO_COARSE = "too coarse"
    AGREE = "agree"


def verdict_of_gap(gap: float, sum_of_bars: float, tolerance: float) -> Verdict:
    """Disagree beyond FACTOR_DISAGREE times both bars; too coarse if gap or bars exceed the tolerance; else agree."""
    if gap > FACTOR_DISAGREE * sum_of_bars:
        return Verdict.DISAGREE
    return Verdict.AGREE if max(gap, sum_of_bars) <= tolerance else Verdict.TOO_COARSE


class BoundPart(NamedTuple):
    """One contribution to an allowed gap."""

    name: str  # of its run, third party or law
    value: float
    basis: str = ""  # how it came about

    def __str__(self) -> str:
        return f"{self.name} {self.value:.2g}" + (f" ({self.basis})" if self.basis else "")


@dataclass(frozen=True, slots=True)
class Bound:
    """An allowed gap: the sum of its parts."""

    kind: str  # its parts in words: "error bars" of both, "law", "own bar", ...; "nothing": there is no bound
    parts: tuple[BoundPart, ...] = ()
    why: str = ""
    notes: tuple[str, ...] = ()

    @property
    def sum_or_nan(self) -> float:
        """The allowed gap; nan where there is no bound."""
        return math.nan if self.kind == "nothing" else sum(part.value for part in self.parts)

    def __str__(self) -> str:
        parts = f"{self.kind}: {' + '.join(map(str, self.parts))}" if self.parts else ""
        return "; ".join(filter(None, (parts, self.why, *self.notes)))


def no_bound(reason: object) -> Bound:
    """The bound of a row that cannot be compared, and why."""
    return Bound("nothing", why=str(reason))


@dataclass(frozen=True, slots=True)
class Agreement:
    """One row of a verdict.

    required : tolerance of gap and bars; None: the bound alone decides (third parties).
    decides : whether the row counts.
    parts : of both bars in space and time.
    """

    quantity: str
    gap: float
    bound: Bound
    where: float | str | None = None  # s_o/l; of a line its station and position
    third_party: str = ""  # compared with our better solver
    law: str = ""  # tells rows of one quantity apart
    required: float | None = None
    decides: bool = True
    parts: tuple[tuple[float, float], ...] = ()
    unit: str = ""  # of gap and bars; "": relative

    @property
    def allowed(self) -> float:
        return self.bound.sum_or_nan

    @property
    def allowed_because(self) -> str:
        return str(self.bound)

    @property
    def verdict(self) -> Verdict:
        """By `verdict_of_gap`; without a tolerance a gap within its bound agrees."""
        if self.bound.kind == "nothing":
            return Verdict.NOT_COMPARABLE
        if self.required is not None:
            return verdict_of_gap(self.gap, self.allowed, self.required)
        if not (math.isfinite(self.gap) and math.isfinite(self.allowed)):
            return Verdict.NOT_COMPARABLE
        return Verdict.AGREE if self.gap <= self.allowed else Verdict.DISAGREE

    def to_json(self) -> dict[str, Any]:
        """The row as it is stored in agreement.json."""
        bars: list[float | None] = [None, None]
        if self.bound.kind in ("error bars", "law"):
            bars = [*(part.value for part in self.bound.parts), *bars]
        row = {
            "quantity": self.quantity, "gap": self.gap, "allowed": self.allowed, "bar_a": bars[0], "bar_b": bars[1],
            "asked_for": self.required, "asked": self.decides,
            "verdict": self.verdict.value if self.decides else None, "where": self.where,
            "allowed_because": self.allowed_because,
        }  # fmt: skip
        more = {"law": self.law, "with": self.third_party, "notes": self.bound.notes, "unit": self.unit}
        row |= {name: value for name, value in more.items() if value}
        return nulls_for_nonfinite(row)


def worst_deciding_verdict(rows: list[Agreement]) -> Verdict:
    """The first verdict, in order of precedence, of the rows that decide; NOT_COMPARABLE without such rows."""
    verdicts = {row.verdict for row in rows if row.decides} or {Verdict.NOT_COMPARABLE}
    return next(verdict for verdict in Verdict if verdict in verdicts)


def range_faults(name: str, value: object, low: float, high: float) -> list[str]:
    """What is wrong with a value that must be a number in [low, high]."""
    if isinstance(value, Real) and not isinstance(value, bool) and low <= float(value) <= high:
        return []
    return [f"{name} must lie in [{low:g}, {high:g}], got {value!r}"]


def refuse_out_of_range(name: str, value: object, low: float, high: float) -> None:
    """Raise ValueError for what is no number in [low, high]."""
    for fault in range_faults(name, value, low, high):
        raise ValueError(fault)


def excess_over_tolerance_sentence(rows: Iterable[Agreement]) -> str | None:
    """How far rows that are too coarse exceed what was asked; None if none is, or one has no bar."""
    coarse = (row for row in rows if row.decides and row.verdict is Verdict.TOO_COARSE)
    excess = max((max(row.gap, row.allowed) / row.required for row in coarse if row.required), default=math.inf)
    if not math.isfinite(excess):
        return None
    return f"gaps and bars are up to {excess:.3g} times what was asked"
