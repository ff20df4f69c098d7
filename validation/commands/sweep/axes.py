"""What varies from scene to scene."""

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Annotated, Any, ClassVar

from pydantic import Field

from cablefem.scene.errors import SceneError, short_text
from cablefem.scene.fields import Admits, Part, Real, Switch, integer_between

MAX_POINTS = 10_000_000


class Choices(Part):
    """Listed values."""

    choices: Annotated[tuple[Any, ...], Admits("a list of at least one value", min_length=1, strict=False)]
    log: ClassVar[bool] = False

    @property
    def values(self) -> tuple[Any, ...]:
        return self.choices

    @property
    def numeric(self) -> bool:
        return all(isinstance(x, int | float) and not isinstance(x, bool) for x in self.values)

    def value_at_share(self, share: float) -> Any:
        """The value at a share in [0, 1] of the axis."""
        return self.values[min(int(share * len(self.values)), len(self.values) - 1)]


class Range(Part):
    """Any value between two ends."""

    low: Real = Field(alias="from")
    high: Real = Field(alias="to")
    log: Switch = False  # equal steps are equal ratios
    numeric: ClassVar[bool] = True
    values: ClassVar[tuple[Any, ...]] = ()

    def cross_field_faults(self, written_values: Mapping[str, Any]) -> list[str]:
        """A range rises, and a logarithmic one is positive."""
        if None in (self.low, self.high):
            return []
        if self.log and self.low <= 0.0:
            return [f"from = {self.low:g}: must be > 0 with log"]
        if self.low >= self.high:
            return [f"to = {self.high:g}: must be > {self.low:g}, where the range begins"]
        return []

    def value_at_share(self, share: float) -> float:
        if self.log:
            return float(self.low * (self.high / self.low) ** share)
        return float(self.low + share * (self.high - self.low))


class Steps(Range):
    """So many values over a range, its ends included."""

    count: Annotated[int, integer_between(2, MAX_POINTS)]

    @property
    def values(self) -> tuple[float, ...]:  # type: ignore[override]
        return tuple(self.value_at_share(i / (self.count - 1)) for i in range(self.count))


Axis = Choices | Range


def _parse_axes(range_type: type[Range], data: Any) -> dict[str, Axis]:
    """Axes of a table; each is a list, a table with choices, or a `range_type`; SceneError with all faults."""
    if not (isinstance(data, dict) and data):
        raise ValueError("must be a table of at least one axis")
    axes: dict[str, Axis] = {}
    faults = []
    for name, axis in _with_dotted_names(data):
        try:
            axes[name] = _parse_axis(range_type, axis)
        except SceneError as error:
            faults += [f"{name}.{fault}" for fault in error.faults]
        except TypeError:
            a_list = "[low, high]" if range_type is Range else "a list of values"
            faults.append(
                f"{name} = {short_text(axis)}: must be {a_list}, or a table with choices, or with from and to"
            )
    if faults:
        raise SceneError(faults)
    return axes


def _with_dotted_names(data: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Names and axes, from tables within tables too: mass.mass = [...] in TOML without quotes is one."""
    entries = {name for axis in (Choices, Steps) for name in axis.written_field_names()}
    for name, axis in data.items():
        if isinstance(axis, dict) and axis and not entries & axis.keys():
            yield from ((f"{name}.{inner}", content) for inner, content in _with_dotted_names(axis))
        else:
            yield name, axis


def _parse_axis(range_type: type[Range], data: Any) -> Axis:
    """One axis; TypeError for what is none."""
    match data:
        case Choices() | Range():
            return data
        case [low, high] if range_type is Range:
            return range_type(**{"from": low, "to": high})
        case [_, *_] if range_type is Steps:
            return Choices(choices=data)
    return Choices(**data) if "choices" in data else range_type(**data)


parse_grid_axes = partial(_parse_axes, Steps)  # of [vary]
parse_sample_axes = partial(_parse_axes, Range)  # of [sample.range]
