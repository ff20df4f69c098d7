"""The allowed gap with its parts and its reason; `WORDS` has the text of each kind."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

WORDS = {
    "error bars": "both error bars: {parts}",
    "law": "the law holds exactly, so its defect may be the run's own error: {parts}",
    "own bar": "its own error bar: {parts}",
    "foreign": "{parts}, of {components}",
    "covers less": "{party} covers {axis} {low:.4g} to {high:.4g} of {start:.4g} to {stop:.4g}; there {sum} would be "
    "allowed",
    "asked": "asked for by {parts}, {relative}",
    "nothing": "{why}",
}


@dataclass(frozen=True, slots=True)
class Part:
    """One contribution to an allowed gap."""

    name: str  # its run, party or law
    value: float
    basis: str = ""  # how it came about


@dataclass(frozen=True, slots=True)
class Bound:
    """An allowed gap: the sum of its parts."""

    kind: str
    parts: tuple[Part, ...] = ()
    numbers: dict[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def value(self) -> float:
        """nan where there is none."""
        return math.nan if self.kind in ("covers less", "nothing") else self.sum

    @property
    def sum(self) -> float:
        return sum(part.value for part in self.parts)

    def __str__(self) -> str:
        parts = [f"{p.name} {p.value:.2g}" + (f" ({p.basis})" if p.basis else "") for p in self.parts]
        said = WORDS[self.kind].format(parts=" + ".join(parts), sum=f"{self.sum:.2g}", **self.numbers)
        return "; ".join([said, *self.notes])


def nothing(why: object) -> Bound:
    return Bound("nothing", numbers={"why": str(why)})
