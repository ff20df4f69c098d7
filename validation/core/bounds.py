"""The allowed gap with its parts and its reason."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Part:
    """One contribution to an allowed gap."""

    name: str  # its run, party or law
    value: float
    basis: str = ""  # how it came about

    def __str__(self) -> str:
        return f"{self.name} {self.value:.2g}" + (f" ({self.basis})" if self.basis else "")


@dataclass(frozen=True, slots=True)
class Bound:
    """An allowed gap: the sum of its parts."""

    kind: str  # its parts in words: "error bars" of both, "law", "own bar", ...; "nothing": there is no bound
    parts: tuple[Part, ...] = ()
    why: str = ""
    notes: tuple[str, ...] = ()

    @property
    def value(self) -> float:
        """nan where there is none."""
        return math.nan if self.kind == "nothing" else sum(part.value for part in self.parts)

    def __str__(self) -> str:
        parts = f"{self.kind}: {' + '.join(map(str, self.parts))}" if self.parts else ""
        return "; ".join(filter(None, (parts, self.why, *self.notes)))


def nothing(why: object) -> Bound:
    return Bound("nothing", why=str(why))
