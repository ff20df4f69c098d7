"""Fields with their admissible values; every fault is one line."""

import math
import numbers
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Self, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import core_schema

from cablefem.scene.errors import NOT_MODELLED, SceneError, nearest, shown

# within these no product of fields overflows or vanishes
SMALL, LARGE = 1e-12, 1e15


@dataclass(frozen=True, slots=True)
class Check:
    """An annotation that validates; `convert` returns None for what it does not admit."""

    admissible: str
    convert: Callable[[Any], object | None]
    schema: dict[str, Any] = field(default_factory=dict, hash=False)  # added to the JSON schema

    def __call__(self, value: object) -> object:
        converted = self.convert(value)
        if converted is None:
            raise ValueError(f"must be {self.admissible}")
        return converted

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        return core_schema.no_info_before_validator_function(self, handler(source))

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> dict[str, Any]:
        return handler(core) | self.schema | {"$comment": self.admissible}


def number(admits: Callable[[float], bool]) -> Callable[[object], float | None]:
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
    f"a number > 0, from {_RANGE}", number(lambda x: SMALL <= x <= LARGE), {"type": "number", "exclusiveMinimum": 0}
)
REAL = Check(f"a number from {-LARGE:g} to {LARGE:g}", number(lambda x: abs(x) <= LARGE), {"type": "number"})
_SEVERAL = Check("a list of at least two numbers", several, {"minItems": 2})

Positive = Annotated[float, POSITIVE]
NonNegative = Annotated[
    float,
    Check(f"a number >= 0: 0, or from {_RANGE}", number(lambda x: x == 0.0 or SMALL <= x <= LARGE), {"minimum": 0}),
]
Real = Annotated[float, REAL]
Switch = Annotated[bool, Check("true or false", lambda x: x if isinstance(x, bool) else None)]
Numbers = Annotated[tuple[NonNegative, ...], _SEVERAL]
Reals = Annotated[tuple[Real, ...], _SEVERAL]
Line = Annotated[str, Check("text on one line", _matching(r"[^\x00-\x1f\x7f]*"))]
Name = Annotated[str, Check("letters, digits, '_', '-' and '.', the first no '-' or '.'", _matching(r"\w[\w.-]*"))]
Word = Annotated[str, Check("letters, digits, spaces, '_' and '-'", _matching(r"\w[\w -]*"))]  # part of a dotted key


def said(text: str, default: Any = ..., **more: Any) -> Any:
    """A field whose description begins with its unit: "[kg] mass of the car"."""
    return Field(default, description=text, **more)


def real(value: object) -> float | None:
    return REAL.convert(value)  # type: ignore[return-value]


def between(low: float, high: float) -> Check:
    schema = {"minimum": low, "maximum": high}
    return Check(f"a number from {low:g} to {high:g}", number(lambda x: low <= x <= high), schema)


def whole(low: int, high: int) -> Check:
    def convert(value: object) -> int | None:
        return value if isinstance(value, int) and not isinstance(value, bool) and low <= value <= high else None

    return Check(f"a whole number from {low} to {high}", convert, {"minimum": low, "maximum": high})


def tables(like: str) -> Check:
    return Check(f"a list of tables {like}", lambda x: tuple(x) if isinstance(x, list | tuple) else None)


def choice(known: Sequence[str]) -> Check:
    def convert(value: object) -> object:
        if value not in known:
            raise ValueError(f"unknown.{nearest(str(value), known)}")
        return value

    return Check(f"one of {', '.join(known)}", convert, {"enum": list(known)})


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
            return [cls._kind_fault(where, item["input"], _kinds(cls.model_fields[name].annotation))]
        if where == "mass" and isinstance(item["input"], list | tuple):
            cause = f"not modelled: {NOT_MODELLED['masses']}"
        # pydantic's own error without a cause: the field must be a part
        return [f"{where} = {shown(item['input'])}: {cause or f'must be a table [{where}]'}"]

    @classmethod
    def _admissible(cls, name: str) -> str:
        missing = next(x for key, x in cls.model_fields.items() if name in (key, x.alias))
        return next((m.admissible for m in missing.metadata if isinstance(m, Check)), f"a table [{name}]")

    @staticmethod
    def _kind_fault(where: str, given: object, known: list[str]) -> str:
        kind = given.get("kind") if isinstance(given, dict) else None
        if kind is None:
            return f"{where}.kind: missing; must be one of {', '.join(known)}"
        return f"{where}.kind = {shown(kind)}: unknown.{nearest(str(kind), known)}"


@dataclass(frozen=True, slots=True)
class NumberOr:
    """An annotation for a number, or a table in its place."""

    number: Check
    table: type[Part]

    @property
    def admissible(self) -> str:
        return f"{self.number.admissible}, or a table {{{', '.join(self.table.field_names())}}}"

    def __call__(self, value: object) -> object:
        if isinstance(value, self.table):
            return value
        if isinstance(value, dict):
            return self.table(**value)
        number = self.number.convert(value)
        if number is None:
            raise ValueError(f"must be {self.admissible}")
        return number

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        return core_schema.no_info_plain_validator_function(self)

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> dict[str, Any]:
        number = self.number.schema | {"$comment": self.number.admissible}
        return {"anyOf": [number, handler(self.table.__pydantic_core_schema__)]}


def number_or(number: Check, table: type[Part]) -> Any:
    return Annotated[Any, NumberOr(number, table)]


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
