"""What varies from scene to scene: given values, a range, or so many values over a range."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field

from cablefem.scene.errors import SceneError, shown
from cablefem.scene.fields import Part, Real, Switch, real, whole

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
        """Return the value at a share in [0, 1] of the axis."""
        if self.values:
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        if self.log:
            return float(self.low * (self.high / self.low) ** share)
        return float(self.low + share * (self.high - self.low))

    def table(self) -> dict[str, Any]:
        """Return the axis as written in [sample.range]."""
        return {"choices": list(self.values)} if self.values else {"from": self.low, "to": self.high, "log": self.log}

    @property
    def numeric(self) -> bool:
        return all(isinstance(x, int | float) and not isinstance(x, bool) for x in self.values)


class Range(Part):
    """A range as written in a study."""

    low: Real = Field(alias="from")
    high: Real = Field(alias="to")
    log: Switch = False  # equal steps are equal ratios

    @classmethod
    def faults_between(cls, data: dict[str, Any]) -> list[str]:
        """A range rises, and a logarithmic one is positive."""
        low, high = real(data.get("from")), real(data.get("to"))
        if low is None or high is None:
            return []
        if data.get("log") is True and low <= 0.0:
            return [f"from = {low:g}: must be > 0 with log"]
        return [] if low < high else [f"to = {high:g}: must be > {low:g}, where the range begins"]


class Steps(Range):
    """So many values over a range, its ends included."""

    count: Annotated[int, whole(2, MOST)]


def grid(given: Any) -> tuple[Axis, ...]:
    """Return the axes of a table [vary]: lists of values, or tables with choices, or with from, to and count."""
    return _axes(given, _stepped)


def ranges(given: Any) -> tuple[Axis, ...]:
    """Return the axes of a table [sample.range]: [low, high], or tables with from and to, or with choices."""
    return _axes(given, _ranged)


def _axes(given: Any, read: Callable[[str, Any], Axis]) -> tuple[Axis, ...]:
    if isinstance(given, tuple) and all(isinstance(axis, Axis) for axis in given):
        return given  # of a study that is copied
    if not (isinstance(given, dict) and given):
        raise ValueError("must be a table of at least one axis")
    axes, faults = [], []
    for name, one in given.items():
        try:
            axes.append(read(name, one))
        except SceneError as error:
            faults += [f"{name}.{fault}" for fault in error.faults]
        except ValueError as error:
            faults.append(f"{name} = {shown(one)}: {error}")
    if faults:
        raise SceneError(faults)
    return tuple(axes)


def _chosen(given: Any) -> tuple[Any, ...]:
    """Return the values of {choices = [...]}, none of anything else."""
    named = isinstance(given, dict) and list(given) == ["choices"] and isinstance(given["choices"], list)
    return tuple(given["choices"]) if named else ()


def _stepped(name: str, given: Any) -> Axis:
    if values := tuple(given) if isinstance(given, list) else _chosen(given):
        return Axis(name, values)
    if isinstance(given, dict):
        steps = Steps(**given)
        axis = Axis(name, (), steps.low, steps.high, steps.log)
        return Axis(name, tuple(axis.at(i / (steps.count - 1)) for i in range(steps.count)))
    raise ValueError("must be a list, or a table with choices, or with from, to and count")


def _ranged(name: str, given: Any) -> Axis:
    if isinstance(given, list) and len(given) == 2 and all(real(x) is not None for x in given):
        given = {"from": given[0], "to": given[1]}
    if not isinstance(given, dict):
        raise ValueError("must be [low, high], or a table with from and to, or with choices")
    if values := _chosen(given):
        return Axis(name, values)
    between = Range(**given)
    return Axis(name, (), between.low, between.high, between.log)
