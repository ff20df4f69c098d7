"""A verdict is computed from a range, a value and its error bar; nobody types it in."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

HOLDS, PAPER_ONLY = "holds", "holds at the paper's resolution only"
FAILS, OPEN = "does not hold", "cannot be decided"
VERDICTS = (HOLDS, PAPER_ONLY, FAILS, OPEN)

# What a printed statement is allowed to mean; printed with each of them.
READ_OFF = 0.01  # a place read off a figure: a hundredth of the axis
ABOUT = 0.02  # "about", "around" a printed figure of one digit
HIGH = 0.10  # "about 2.6 times", read off a figure that goes to 3
ALMOST = 0.10  # "almost the same", "around a constant value"
STRAIGHT = 0.02  # "straight line", "constant at this scale": the width of a printed line
SMALL = 0.05  # "small", "not apparent", of the plotted quantity
MANY = 1.5  # "many more"
FRACTIONS = (0.0, 1 / 4, 1 / 3, 1 / 2, 2 / 3, 3 / 4, 1.0)  # places named in words


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number that decides a claim: true when it lies in [low, high]."""

    name: str
    claimed: str  # the range in words, with its reason
    low: float
    high: float
    value: float  # converged; what no refinement can change: exact
    bar: float = 0.0  # the true value is expected within value +- bar
    paper: float | None = None  # at the paper's resolution

    def true(self) -> bool | None:
        """Return whether the converged value lies in the range, None where its bar reaches across an end."""
        if not (math.isfinite(self.value) and math.isfinite(self.bar)):
            return None
        if self.low <= self.value - self.bar and self.value + self.bar <= self.high:
            return True
        if self.value + self.bar < self.low or self.value - self.bar > self.high:
            return False
        return None

    def true_in_paper(self) -> bool:
        """Return whether the value at the paper's resolution lies in the range; False where there is none."""
        return self.paper is not None and self.low <= self.paper <= self.high

    def row(self) -> dict[str, Any]:
        return {
            "name": self.name, "claimed": self.claimed, "low": _finite(self.low), "high": _finite(self.high),
            "paper": _finite(self.paper), "converged": _finite(self.value), "uncertainty": _finite(self.bar),
        }  # fmt: skip


def around(
    name: str, centre: float, width: float, reason: str, value: float, bar: float = 0.0, paper: float | None = None
) -> Quantity:  # fmt: skip
    """Return a quantity claimed to be `centre`, give or take `width`."""
    return Quantity(
        name, f"{decimal(centre)} ± {decimal(width)} ({reason})", centre - width, centre + width, value, bar, paper
    )


def at_most(name: str, high: float, reason: str, value: float, bar: float = 0.0, paper=None) -> Quantity:
    return Quantity(name, f"at most {decimal(high)} ({reason})", -math.inf, high, value, bar, paper)


def at_least(name: str, low: float, reason: str, value: float, bar: float = 0.0, paper=None) -> Quantity:
    return Quantity(name, f"at least {decimal(low)} ({reason})", low, math.inf, value, bar, paper)


def in_words(name: str, fraction: float, value: float, bar: float = 0.0, paper=None) -> Quantity:
    """Return a place claimed in words (a third, the middle): nearer to it than to the next of FRACTIONS."""
    i = FRACTIONS.index(fraction)
    low, high = (0.5 * (fraction + FRACTIONS[k]) for k in (i - 1, i + 1))
    words = f"{low:.3f} to {high:.3f} (nearer to it than to the next simple fraction)"
    return Quantity(name, words, low, high, value, bar, paper)


@dataclass(frozen=True, slots=True)
class Claim:
    """One statement of the paper, what decides it, and one sentence why."""

    id: str
    where: str  # figure, section or equation
    says: str  # in the paper's words
    quantities: tuple[Quantity, ...]
    why: str
    readings: bool = False  # the quantities are readings of an ambiguous text: one that is true is enough

    @property
    def verdict(self) -> str:
        join = any_of if self.readings else all_of
        true = join(q.true() for q in self.quantities) if self.quantities else None
        if true is None:
            return OPEN
        if true:
            return HOLDS
        return PAPER_ONLY if join(q.true_in_paper() for q in self.quantities) else FAILS

    def row(self) -> dict[str, Any]:
        return {
            "id": self.id, "where": self.where, "claim": self.says, "readings": self.readings,
            "quantities": [q.row() for q in self.quantities], "verdict": self.verdict, "why": self.why,
        }  # fmt: skip


def all_of(truths: Iterable[bool | None]) -> bool | None:
    """Return the three-valued and."""
    truths = list(truths)
    return False if False in truths else None if None in truths else True


def any_of(truths: Iterable[bool | None]) -> bool | None:
    """Return the three-valued or."""
    truths = list(truths)
    return True if True in truths else None if None in truths else False


def decimal(x: float) -> str:
    """Return a number without an exponent: 0.000005."""
    return f"{x:.9f}".rstrip("0").rstrip(".")


def power(x: float) -> str:
    """Return a number to one digit as 2·10⁻⁵."""
    mantissa, exponent = f"{x:.0e}".split("e")
    return f"{mantissa}·10{str(int(exponent)).translate(str.maketrans('0123456789-', '⁰¹²³⁴⁵⁶⁷⁸⁹⁻'))}"


def _finite(x: float | None) -> float | None:
    return None if x is None or not math.isfinite(x) else float(x)
