"""Numbers with their admissible ranges, and the model base that turns every fault into one line."""

from __future__ import annotations

import math
import numbers
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError

from cablefem.scene.errors import SceneError, nearest, shown

# No cable is built outside these; inside them no product of two fields overflows or vanishes.
SMALL, LARGE = 1e-12, 1e15


def _number(admits: Callable[[float], bool], admissible: str) -> BeforeValidator:
    """A validator that takes real numbers (no bool, no text) and says what it admits."""

    def check(value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, numbers.Real):
            raise ValueError(f"must be a number, {admissible}")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not (math.isfinite(number) and admits(number)):
            raise ValueError(f"must be {admissible}")
        return number

    return BeforeValidator(check)


def _positive(x: float) -> bool:
    return SMALL <= x <= LARGE


def _non_negative(x: float) -> bool:
    return x == 0.0 or _positive(x)


def _real(x: float) -> bool:
    return abs(x) <= LARGE


Positive = Annotated[float, _number(_positive, f"> 0 (from {SMALL:g} to {LARGE:g})")]
NonNegative = Annotated[float, _number(_non_negative, f">= 0 (0, or from {SMALL:g} to {LARGE:g})")]
Real = Annotated[float, _number(_real, f"finite (from {-LARGE:g} to {LARGE:g})")]


def _sequence(value: object) -> object:
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if not isinstance(value, list | tuple) or len(value) < 2:
        raise ValueError("must be a list of at least two numbers")
    return tuple(value)


Numbers = Annotated[tuple[NonNegative, ...], BeforeValidator(_sequence)]


class Part(BaseModel):
    """A frozen piece of a scene; building it with a fault raises SceneError with every fault in it."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    def __init__(self, **data: Any) -> None:
        faults = self.raw_faults(data)
        try:
            super().__init__(**data)
        except ValidationError as error:
            faults = [line for item in error.errors(include_url=False) for line in self._lines(item)] + faults
        if faults:
            raise SceneError(faults) from None

    @classmethod
    def raw_faults(cls, data: dict) -> list[str]:
        """Faults between fields, found before any field is converted."""
        return []

    @classmethod
    def _lines(cls, item: Any) -> list[str]:
        """One pydantic error item as lines 'field = value: what is admissible'."""
        where, value, kind = item["loc"], item["input"], item["type"]
        cause = item.get("ctx", {}).get("error")
        name = str(where[0])
        if isinstance(cause, SceneError):  # of a part of this part
            return [f"{name}.{fault}" for fault in cause.faults]
        if len(where) > 1 and isinstance(where[1], int):
            name += f"[{where[1]}]"
        if kind == "extra_forbidden":
            return [f"{name} = {shown(value)}: unknown key.{nearest(name, cls.keys())}"]
        if kind == "missing":
            return [f"{name}: missing."]
        if kind == "union_tag_not_found":
            return [f"{name}.kind: missing; must be one of {item['ctx']['discriminator']}"]
        if kind == "union_tag_invalid":
            known = [tag.strip(" '") for tag in item["ctx"]["expected_tags"].split(",")]
            return [f"{name}.kind = {shown(item['ctx']['tag'])}: unknown.{nearest(item['ctx']['tag'], known)}"]
        message = str(cause) if cause is not None else item["msg"]
        return [f"{name} = {shown(value)}: {message}"]

    @classmethod
    def keys(cls) -> list[str]:
        """Names of the fields, in the order of their definition."""
        return list(cls.model_fields)
