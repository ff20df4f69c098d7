"""Fields with their admissible values, and the model base that turns every fault into one line."""

import math
import numbers
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, get_args

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError

from cablefem.scene.errors import SceneError, nearest, shown

# No cable is built outside these; inside them no product of fields overflows or vanishes.
SMALL, LARGE = 1e-12, 1e15


@dataclass(frozen=True, slots=True)
class Check:
    """A validator that says what it admits; `convert` returns None for anything else."""

    admissible: str
    convert: Callable[[Any], object | None]

    def __call__(self, value: object) -> object:
        converted = self.convert(value)
        if converted is None:
            raise ValueError(f"must be {self.admissible}")
        return converted


def _number(admits: Callable[[float], bool]) -> Callable[[object], float | None]:
    """Convert real numbers, numpy's too, that `admits` accepts; no bool, no text, neither NaN nor infinity."""

    def convert(value: object) -> float | None:
        if isinstance(value, bool) or not isinstance(value, numbers.Real):
            return None
        try:
            number = float(value)
        except OverflowError:  # an integer of more than 308 digits
            return None
        return number if math.isfinite(number) and admits(number) else None

    return convert


def several(value: object) -> tuple | None:
    """The values of a list of at least two, whatever they are; None for anything else."""
    values = value.tolist() if isinstance(value, np.ndarray) else value
    return tuple(values) if isinstance(values, list | tuple) and len(values) > 1 else None


def _matching(pattern: str) -> Callable[[object], str | None]:
    return lambda value: value if isinstance(value, str) and re.fullmatch(pattern, value) else None


_RANGE = f"{SMALL:g} to {LARGE:g}"
POSITIVE = Check(f"a number > 0, from {_RANGE}", _number(lambda x: SMALL <= x <= LARGE))
_NON_NEGATIVE = Check(f"a number >= 0: 0, or from {_RANGE}", _number(lambda x: x == 0.0 or SMALL <= x <= LARGE))
_FRACTION = Check("a number from 0 to 1", _number(lambda x: 0.0 <= x <= 1.0))
REAL = Check(f"a number from {-LARGE:g} to {LARGE:g}", _number(lambda x: abs(x) <= LARGE))

Positive = Annotated[float, BeforeValidator(POSITIVE)]
NonNegative = Annotated[float, BeforeValidator(_NON_NEGATIVE)]
Real = Annotated[float, BeforeValidator(REAL)]
Fraction = Annotated[float, BeforeValidator(_FRACTION)]
_SEVERAL = Check("a list of at least two numbers", several)
Switch = Annotated[bool, BeforeValidator(Check("true or false", lambda x: x if isinstance(x, bool) else None))]
Numbers = Annotated[tuple[NonNegative, ...], BeforeValidator(_SEVERAL)]
Reals = Annotated[tuple[Real, ...], BeforeValidator(_SEVERAL)]
Line = Annotated[str, BeforeValidator(Check("text on one line", _matching(r"[^\x00-\x1f\x7f]*")))]
Name = Annotated[
    str, BeforeValidator(Check("letters, digits, '_', '-' and '.', the first no '-' or '.'", _matching(r"\w[\w.-]*")))
]


def real(value: object) -> float | None:
    """The value as a number, None for anything else."""
    return REAL.convert(value)  # type: ignore[return-value]


def between(low: float, high: float) -> BeforeValidator:
    """A number from low to high."""
    return BeforeValidator(Check(f"a number from {low:g} to {high:g}", _number(lambda x: low <= x <= high)))


def whole(low: int, high: int) -> BeforeValidator:
    """A whole number from low to high."""

    def convert(value: object) -> int | None:
        return value if isinstance(value, int) and not isinstance(value, bool) and low <= value <= high else None

    return BeforeValidator(Check(f"a whole number from {low} to {high}", convert))


def choice(known: Sequence[str]) -> BeforeValidator:
    """One of the known words."""

    def convert(value: object) -> object:
        if value not in known:
            raise ValueError(f"unknown.{nearest(str(value), known)}")
        return value

    return BeforeValidator(convert)


class Part(BaseModel):
    """A frozen piece of a scene; building it with faults raises SceneError with all of them."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    def __init__(self, **data: Any) -> None:
        faults: list[str] = []
        try:
            super().__init__(**data)
        except ValidationError as error:
            faults = [line for item in error.errors(include_url=False) for line in self._lines(item)]
        faults += self.faults_between(data)
        if faults:
            raise SceneError(faults)

    @classmethod
    def faults_between(cls, data: dict[str, Any]) -> list[str]:
        """Faults that no field has alone; `data` as given, with or without faults of its own."""
        return []

    @classmethod
    def field_names(cls) -> list[str]:
        """Names of the fields as they are written, in the order of their definition."""
        return [field.alias or name for name, field in cls.model_fields.items()]

    @classmethod
    def _lines(cls, item: Any) -> list[str]:
        """Turn one error item of pydantic into lines 'field = value: what is admissible'."""
        name, *inner = item["loc"]
        kind, context = item["type"], item.get("ctx", {})
        cause = context.get("error")
        where = f"{name}[{inner[0]}]" if inner and isinstance(inner[0], int) else str(name)
        if isinstance(cause, SceneError):  # of a part inside this one
            return [f"{where}.{fault}" for fault in cause.faults]
        given = f"{where} = {shown(item['input'])}"
        if kind == "missing":
            field = next(field for key, field in cls.model_fields.items() if name in (key, field.alias))
            checks = [m.func for m in field.metadata if isinstance(m, BeforeValidator)]
            admissible = checks[0].admissible if checks else f"a table [{name}]"  # type: ignore[union-attr]
            return [f"{where}: missing; must be {admissible}"]
        if kind == "extra_forbidden":
            return [f"{given}: unknown key.{nearest(where, cls.field_names())}"]
        if kind == "union_tag_invalid":
            tag, known = item["input"]["kind"], _kinds(cls.model_fields[name].annotation)
            return [f"{where}.kind = {shown(tag)}: unknown.{nearest(str(tag), known)}"]
        if kind == "union_tag_not_found":
            return [f"{where}.kind: missing; must be one of {', '.join(_kinds(cls.model_fields[name].annotation))}"]
        if cause is None:  # pydantic's own: the only other type a field can have is a part
            return [f"{given}: must be a table [{where}]"]
        return [f"{given}: {cause}"]


def _kinds(annotation: Any) -> list[str]:
    """The values of `kind` that tell the members of a union of parts from one another."""
    kinds: list[str] = []
    for member in get_args(annotation):
        is_part = isinstance(member, type) and issubclass(member, Part)
        kinds += [member.model_fields["kind"].default] if is_part else _kinds(member)
    return kinds
