"""The allowed gap with its parts and its reason; `WORDS` has the text of each kind."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

Show = Callable[[float], str]

WORDS = {
    "error bars": "both error bars: {parts}",
    "law": "the law holds exactly, so its defect may be the run's own error: {parts}",
    "own bar": "its own error bar: {parts}",
    "foreign": "{parts}, of {components}",
    "covers less": "{party} covers s_o/l = {low:.3g} to {high:.3g} of {start:.3g} to {stop:.3g}; there {sum} would "
    "be allowed",
    "covers less time": "{party} covers {low:.4g} to {high:.4g} s of 0 to {stop:.4g} s; there {sum} would be allowed",
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
    tol: float | None = None  # tolerance that the bars exceed

    @property
    def value(self) -> float:
        """nan where there is none."""
        return math.nan if self.kind in ("covers less", "covers less time", "nothing") else self.sum

    @property
    def sum(self) -> float:
        return sum(part.value for part in self.parts)

    def line(self, show: Show = "{:.2g}".format) -> str:
        """Return the reason in one line, without bases; `show` writes a value."""
        return self._said(show, [f"{part.name} {show(part.value)}" for part in self.parts])

    def __str__(self) -> str:
        show = "{:.2g}".format
        bases = (f" ({part.basis})" if part.basis else "" for part in self.parts)
        return self._said(
            show, [f"{p.name} {show(p.value)}{basis}" for p, basis in zip(self.parts, bases, strict=True)]
        )

    def _said(self, show: Show, parts: list[str]) -> str:
        said = WORDS[self.kind].format(parts=" + ".join(parts), sum=show(self.sum), **self.numbers)
        if self.tol is not None:
            said = f"too coarse: the bars {show(self.sum)} exceed the tolerance {show(self.tol)}; {said}"
        return "; ".join([said, *self.notes])

    def row(self) -> dict[str, Any]:
        """Return the bound for JSON; `Bound.of` reads it back."""
        row = asdict(self)
        for part in row["parts"]:
            part["value"] = part["value"] if math.isfinite(part["value"]) else None
        return row

    @classmethod
    def of(cls, row: dict[str, Any]) -> Bound:
        parts = [Part(x["name"], math.nan if x["value"] is None else x["value"], x["basis"]) for x in row["parts"]]
        return cls(row["kind"], tuple(parts), row["numbers"], tuple(row["notes"]), row["tol"])


def nothing(why: object) -> Bound:
    return Bound("nothing", numbers={"why": str(why)})
