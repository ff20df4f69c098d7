"""A verdict is computed from a range, a value and its error bar.

claims.toml holds the paper's statements, the ranges in which they are true, and sentences with places for numbers.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import jinja2

from validation.core import store
from validation.page.page import raised

HOLDS, PAPER_ONLY = "holds", "holds at the paper's resolution only"
FAILS, OPEN = "does not hold", "cannot be decided"
VERDICTS = (HOLDS, PAPER_ONLY, FAILS, OPEN)
FRACTIONS = (0.0, 1 / 4, 1 / 3, 1 / 2, 2 / 3, 3 / 4, 1.0)  # places named in words


class Value(NamedTuple):
    """A computed number: the true one is expected within value +- bar."""

    value: float
    bar: float = 0.0
    paper: float | None = None  # at the paper's resolution


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number that decides a claim: true when it lies in [low, high]."""

    name: str
    claimed: str  # the range in words, with its reason
    low: float
    high: float
    found: Value

    def true(self) -> bool | None:
        """Return whether the value lies in the range; None where its bar reaches across an end."""
        value, bar, _ = self.found
        if not (math.isfinite(value) and math.isfinite(bar)):
            return None
        if self.low <= value - bar and value + bar <= self.high:
            return True
        if value + bar < self.low or value - bar > self.high:
            return False
        return None

    def true_in_paper(self) -> bool:
        return self.found.paper is not None and self.low <= self.found.paper <= self.high

    def row(self) -> dict[str, Any]:
        value, bar, paper = self.found
        return {
            "name": self.name, "claimed": self.claimed, "low": _finite(self.low), "high": _finite(self.high),
            "paper": _finite(paper), "converged": _finite(value), "uncertainty": _finite(bar),
        }  # fmt: skip


@dataclass(frozen=True, slots=True)
class Claim:
    """One statement of the paper, what decides it, and one sentence why."""

    id: str
    where: str  # figure, section or equation
    says: str  # in the paper's words
    quantities: tuple[Quantity, ...]
    why: str
    readings: bool = False  # the quantities are readings of an ambiguous text: one that is true is enough
    erratum: bool = False  # about a formula, not a figure

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
            "erratum": self.erratum, "quantities": [q.row() for q in self.quantities], "verdict": self.verdict,
            "why": self.why,
        }  # fmt: skip


def all_of(truths: Iterable[bool | None]) -> bool | None:
    """Return the three-valued and."""
    truths = list(truths)
    return False if False in truths else None if None in truths else True


def any_of(truths: Iterable[bool | None]) -> bool | None:
    """Return the three-valued or."""
    truths = list(truths)
    return True if True in truths else None if None in truths else False


# --- from the file --------------------------------------------------------------------------------------------------


def claims(numbers: Mapping[str, Any]) -> list[Claim]:
    """Return all claims of claims.toml, judged by the computed numbers."""
    content = store.shipped(__package__, "claims.toml")
    return [
        Claim(
            claim["id"], claim["where"], claim["says"],
            tuple(q for entry in claim.get("quantity", ()) for q in _quantities(entry, content["meaning"], numbers)),
            sentence(claim["why"], numbers), claim.get("readings", False), claim.get("erratum", False),
        )
        for claim in content["claim"]
    ]  # fmt: skip


def _quantities(entry: dict[str, Any], meaning: dict[str, Any], numbers: Mapping[str, Any]) -> Iterable[Quantity]:
    found = numbers[entry["value"]]
    for key, value in found.items() if isinstance(found, dict) else ((None, found),):
        name = sentence(entry["name"], {**numbers, "key": key})
        claimed, low, high = _range(entry, meaning, numbers, key)
        yield Quantity(name, claimed, low, high, value)


def _range(
    entry: dict[str, Any], meaning: dict[str, Any], numbers: Mapping[str, Any], key: Any
) -> tuple[str, float, float]:
    """Return the range in words, its low and its high end."""

    def known(word: Any) -> tuple[float, str]:
        if word in meaning:
            size, reason = meaning[word]
            return size, entry.get("reason", reason)
        number = numbers[word][key] if isinstance(word, str) else word
        return number, entry.get("reason", "")

    if "around" in entry:
        (centre, _), (width, reason) = known(entry["around"]), known(entry["within"])
        return f"{decimal(centre)} ± {decimal(width)} ({reason})", centre - width, centre + width
    if "at_most" in entry:
        high, reason = known(entry["at_most"])
        return f"at most {decimal(high)} ({reason})", -math.inf, high
    if "at_least" in entry:
        low, reason = known(entry["at_least"])
        return f"at least {decimal(low)} ({reason})", low, math.inf
    if "between" in entry:
        low, high = entry["between"]
        return f"{low:g} to {high:g} ({entry['reason']})", low, high
    i = FRACTIONS.index(entry["fraction"][0] / entry["fraction"][1])
    low, high = (0.5 * (FRACTIONS[i] + FRACTIONS[k]) for k in (i - 1, i + 1))
    return f"{low:.3f} to {high:.3f} (nearer to it than to the next simple fraction)", low, high


def sentence(template: str, numbers: Mapping[str, Any]) -> str:
    """Return a template filled with numbers; a name it does not know is an error."""
    return _TEMPLATES.from_string(template).render(numbers)


def decimal(x: float) -> str:
    """Return a number without an exponent: 0.000005."""
    return f"{x:.9f}".rstrip("0").rstrip(".")


def fixed(x: Value | float, decimals: int = 0) -> str:
    """Return a number with so many decimals."""
    return f"{_plain(x):.{decimals}f}"


def percent(x: Value | float, decimals: int = 0) -> str:
    """Return a ratio in percent, without the sign."""
    return fixed(100.0 * _plain(x), decimals)


def power(x: Value | float) -> str:
    """Return a number to one digit as 2·10⁻⁵."""
    mantissa, exponent = f"{_plain(x):.0e}".split("e")
    return f"{mantissa}·10{raised(int(exponent))}"


def _plain(x: Value | float) -> float:
    return float(x.value if isinstance(x, Value) else x)


def _finite(x: float | None) -> float | None:
    return None if x is None or not math.isfinite(x) else float(x)


_TEMPLATES = jinja2.Environment(undefined=jinja2.StrictUndefined, autoescape=False)
_TEMPLATES.filters |= {"d": fixed, "pct": percent, "power": power}
