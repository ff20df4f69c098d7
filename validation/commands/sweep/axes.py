"""What varies from scene to scene: given values, a range, or so many values over a range."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

from pydantic import Field

from cablefem.scene.errors import SceneError, shown
from cablefem.scene.fields import Part, Real, Switch, whole

MOST = 10_000_000  # points


@dataclass(frozen=True, slots=True)
class Axis:
    """One thing that varies: given values, or a range [low, high], by its logarithm if `log`."""

    name: str
    values: tuple[Any, ...] = ()
    low: float = 0.0
    high: float = 0.0
    log: bool = False

    def at(self, share: float) -> Any:
        """The value at a share in [0, 1] of the axis."""
        if self.values:
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        if self.log:
            return float(self.low * (self.high / self.low) ** share)
        return float(self.low + share * (self.high - self.low))

    def table(self) -> dict[str, Any]:
        """The axis as written in [sample.range]."""
        return {"choices": list(self.values)} if self.values else {"from": self.low, "to": self.high, "log": self.log}

    @property
    def numeric(self) -> bool:
        return all(isinstance(x, int | float) and not isinstance(x, bool) for x in self.values)


class Range(Part):
    """A range as written in a study."""

    low: Real = Field(alias="from")
    high: Real = Field(alias="to")
    log: Switch = False  # equal steps are equal ratios

    def faults_between(self, given: Mapping[str, Any]) -> list[str]:
        """A range rises, and a logarithmic one is positive."""
        if None in (self.low, self.high):
            return []
        if self.log and self.low <= 0.0:
            return [f"from = {self.low:g}: must be > 0 with log"]
        return [] if self.low < self.high else [f"to = {self.high:g}: must be > {self.low:g}, where the range begins"]


class Steps(Range):
    """So many values over a range, its ends included."""

    count: Annotated[int, whole(2, MOST)]


def _axes(kind: type[Range], given: Any) -> tuple[Axis, ...]:
    """Axes of a table; each is a list, a table with choices, or a range of that kind."""
    if isinstance(given, tuple):
        return given  # of a study that is copied
    if not (isinstance(given, dict) and given):
        raise ValueError("must be a table of at least one axis")
    axes, faults = [], []
    for name, one in given.items():
        try:
            axes.append(_axis(kind, name, one))
        except SceneError as error:
            faults += [f"{name}.{fault}" for fault in error.faults]
        except ValueError as error:
            faults.append(f"{name} = {shown(one)}: {error}")
    if faults:
        raise SceneError(faults)
    return tuple(axes)


def _axis(kind: type[Range], name: str, given: Any) -> Axis:
    match given:
        case [low, high] if kind is Range:
            given = {"from": low, "to": high}
        case [_, *_] if kind is Steps:
            given = {"choices": given}
    match given:
        case {"choices": [_, *_] as values, **more} if not more:
            return Axis(name, tuple(values))
        case dict():
            x = kind(**given)
            axis = Axis(name, (), x.low, x.high, x.log)
            shares = [i / (x.count - 1) for i in range(x.count)] if isinstance(x, Steps) else []
            return Axis(name, tuple(map(axis.at, shares))) if shares else axis
    raise ValueError("must be a list, or a table with choices, or with from and to")


grid, ranges = partial(_axes, Steps), partial(_axes, Range)  # of [vary], of [sample.range]
