"""Fields with their admissible values; every fault is one line."""

import math
import numbers
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Self, get_args

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PlainValidator, ValidationError

from cablefem.scene.errors import NOT_MODELLED, SceneError, nearest, shown

# within these no product of fields overflows or vanishes
SMALL, LARGE = 1e-12, 1e15


@dataclass(frozen=True, slots=True)
class Check:
    """A validator; `convert` returns None for what it does not admit."""

    admissible: str
    convert: Callable[[Any], object | None]
    schema: dict[str, Any] = field(default_factory=dict, hash=False)  # for editors

    def __call__(self, value: object) -> object:
        converted = self.convert(value)
        if converted is None:
            raise ValueError(f"must be {self.admissible}")
        return converted


def _number(admits: Callable[[float], bool]) -> Callable[[object], float | None]:
    """Convert real numbers that `admits` accepts; no bool, text, NaN or infinity."""

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
    """A list of two or more; else None."""
    values = value.tolist() if isinstance(value, np.ndarray) else value
    return tuple(values) if isinstance(values, list | tuple) and len(values) > 1 else None


def _matching(pattern: str) -> Callable[[object], str | None]:
    return lambda value: value if isinstance(value, str) and re.fullmatch(pattern, value) else None


_RANGE = f"{SMALL:g} to {LARGE:g}"
POSITIVE = Check(
    f"a number > 0, from {_RANGE}", _number(lambda x: SMALL <= x <= LARGE), {"type": "number", "exclusiveMinimum": 0}
)
NON_NEGATIVE = Check(
    f"a number >= 0: 0, or from {_RANGE}", _number(lambda x: x == 0.0 or SMALL <= x <= LARGE),
    {"type": "number", "minimum": 0},
)  # fmt: skip
REAL = Check(f"a number from {-LARGE:g} to {LARGE:g}", _number(lambda x: abs(x) <= LARGE), {"type": "number"})
_SEVERAL = Check(
    "a list of at least two numbers", several, {"type": "array", "items": {"type": "number"}, "minItems": 2}
)
_SWITCH = Check("true or false", lambda x: x if isinstance(x, bool) else None, {"type": "boolean"})
_LINE = Check("text on one line", _matching(r"[^\x00-\x1f\x7f]*"), {"type": "string"})
_NAME = Check("letters, digits, '_', '-' and '.', the first no '-' or '.'", _matching(r"\w[\w.-]*"), {"type": "string"})
_WORD = Check("letters, digits, spaces, '_' and '-'", _matching(r"\w[\w -]*"), {"type": "string"})

Positive = Annotated[float, BeforeValidator(POSITIVE)]
NonNegative = Annotated[float, BeforeValidator(NON_NEGATIVE)]
Real = Annotated[float, BeforeValidator(REAL)]
Switch = Annotated[bool, BeforeValidator(_SWITCH)]
Numbers = Annotated[tuple[NonNegative, ...], BeforeValidator(_SEVERAL)]
Reals = Annotated[tuple[Real, ...], BeforeValidator(_SEVERAL)]
Line = Annotated[str, BeforeValidator(_LINE)]
Name = Annotated[str, BeforeValidator(_NAME)]
Word = Annotated[str, BeforeValidator(_WORD)]  # part of a dotted key


def said(text: str, default: Any = ..., **more: Any) -> Any:
    """A field whose description begins with its unit: "[kg] mass of the car"."""
    return Field(default, description=text, **more)


def real(value: object) -> float | None:
    return REAL.convert(value)  # type: ignore[return-value]


def between(low: float, high: float) -> BeforeValidator:
    schema = {"type": "number", "minimum": low, "maximum": high}
    return BeforeValidator(Check(f"a number from {low:g} to {high:g}", _number(lambda x: low <= x <= high), schema))


def whole(low: int, high: int) -> BeforeValidator:
    def convert(value: object) -> int | None:
        return value if isinstance(value, int) and not isinstance(value, bool) and low <= value <= high else None

    schema = {"type": "integer", "minimum": low, "maximum": high}
    return BeforeValidator(Check(f"a whole number from {low} to {high}", convert, schema))


def tables(like: str) -> BeforeValidator:
    check = Check(
        f"a list of tables {like}", lambda x: tuple(x) if isinstance(x, list | tuple) else None, {"type": "array"}
    )
    return BeforeValidator(check)


def choice(known: Sequence[str]) -> BeforeValidator:
    def convert(value: object) -> object:
        if value not in known:
            raise ValueError(f"unknown.{nearest(str(value), known)}")
        return value

    return BeforeValidator(Check(f"one of {', '.join(known)}", convert, {"enum": list(known)}))


class Part(BaseModel):
    """A frozen piece of a scene; SceneError with all its faults."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, serialize_by_alias=True)

    def __init__(self, **data: Any) -> None:
        faults: list[str] = []
        try:
            super().__init__(**data)
        except ValidationError as error:
            faults = [line for item in error.errors(include_url=False) for line in self._lines(item)]
        faults += self.faults_between(data)
        if faults:
            raise SceneError(faults)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy with some fields replaced, checked as a new one is."""
        given = {name: getattr(self, name) for name in type(self).model_fields}
        return type(self)(**{_written(type(self), name): x for name, x in {**given, **(update or {})}.items()})

    @classmethod
    def faults_between(cls, data: dict[str, Any]) -> list[str]:
        """Faults between fields; `data` as given, sound or not."""
        return []

    @classmethod
    def field_names(cls) -> list[str]:
        """Names as written, inherited ones last."""
        own = sorted(cls.model_fields, key=lambda name: name not in cls.__annotations__)
        return [_written(cls, name) for name in own]

    @classmethod
    def _lines(cls, item: Any) -> list[str]:
        """Lines 'field = value: what is admissible' from one error of pydantic."""
        name, *inner = item["loc"]
        cause = item.get("ctx", {}).get("error")
        where = f"{name}[{inner[0]}]" if inner and isinstance(inner[0], int) else str(name)
        if isinstance(cause, SceneError):  # of a part inside this one
            return [f"{where}.{fault}" for fault in cause.faults]
        if item["type"] == "missing":
            return [f"{where}: missing; must be {cls._admissible(name)}"]
        if item["type"] == "extra_forbidden":
            unknown = f"{where} = {shown(item['input'])}: unknown key.{nearest(where, cls.field_names())}"
            return [f"{where}: not modelled: {NOT_MODELLED[where]}" if where in NOT_MODELLED else unknown]
        if item["type"].startswith("union_tag"):
            kind = item["input"].get("kind") if isinstance(item["input"], dict) else None
            return [cls._kind_fault(where, kind, _kinds(cls.model_fields[name].annotation))]
        if where == "mass" and isinstance(item["input"], list | tuple):
            cause = f"not modelled: {NOT_MODELLED['masses']}"
        # pydantic's own error without a cause: the field must be a part
        return [f"{where} = {shown(item['input'])}: {cause or f'must be a table [{where}]'}"]

    @classmethod
    def _admissible(cls, name: str) -> str:
        missing = next(x for key, x in cls.model_fields.items() if name in (key, x.alias))
        return next((m.func.admissible for m in missing.metadata if hasattr(m, "func")), f"a table [{name}]")

    @staticmethod
    def _kind_fault(where: str, kind: object, known: list[str]) -> str:
        if kind is None:
            return f"{where}.kind: missing; must be one of {', '.join(known)}"
        return f"{where}.kind = {shown(kind)}: unknown.{nearest(str(kind), known)}"


@dataclass(frozen=True, slots=True)
class NumberOr:
    number: Check
    table: type[Part]

    @property
    def admissible(self) -> str:
        return f"{self.number.admissible}, or a table {{{', '.join(self.table.field_names())}}}"

    def __call__(self, value: object) -> object:
        if value is None or isinstance(value, self.table):
            return value
        if isinstance(value, dict):
            return self.table(**value)
        number = self.number.convert(value)
        if number is None:
            raise ValueError(f"must be {self.admissible}")
        return number


def number_or(number: Check, table: type[Part]) -> Any:
    return Annotated[Any, PlainValidator(NumberOr(number, table))]


def _written(part: type[Part], name: str) -> str:
    known = part.model_fields.get(name)
    return name if known is None else known.alias or name


def _kinds(annotation: Any) -> list[str]:
    """Values of `kind` in a union of parts."""
    kinds: list[str] = []
    for member in get_args(annotation):
        is_part = isinstance(member, type) and issubclass(member, Part)
        kinds += [member.model_fields["kind"].default] if is_part else _kinds(member)
    return kinds
