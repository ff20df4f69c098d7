"""Fields with their admissible values; every fault is one line."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, Self, get_args, get_origin

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError, field_validator
from pydantic import ValidationInfo as Info
from pydantic_core import core_schema

from cablefem.scene.errors import NOT_MODELLED, SceneError, did_you_mean, short_text

# within these no product of fields overflows or vanishes
SMALL = 1e-12
LARGE = 1e15


class Admits:
    """What a field admits, in words; limits (ge, le, min_length, pattern) are pydantic's."""

    def __init__(self, words: str, **limits: Any) -> None:
        self.words = words
        self.limits = limits

    def __call__(self, value: Any, handler: Any) -> Any:
        try:
            return handler(value.tolist() if isinstance(value, np.ndarray | np.generic) else value)
        except ValidationError as error:
            if any(_is_inner_error(item) for item in error.errors(include_url=False)):
                raise
            raise ValueError(f"must be {self.words}") from None

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        return core_schema.no_info_wrap_validator_function(self, handler(source) | self.limits)

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> dict[str, Any]:
        return handler(core) | {"$comment": self.words}


def _is_inner_error(item: Any) -> bool:
    """Whether it is an error of an item in a list, or of a part."""
    return any(isinstance(x, int) for x in item["loc"]) or isinstance(item.get("ctx", {}).get("error"), SceneError)


def _reject_tiny(x: float) -> float:
    """The number; ValueError if it is positive but vanishes in products."""
    if 0.0 < x < SMALL:
        raise ValueError("vanishes in products")
    return x


_RANGE = f"{SMALL:g} to {LARGE:g}"
POSITIVE = Admits(f"a number > 0, from {_RANGE}", ge=SMALL, le=LARGE)
REAL = Admits(f"a number from {-LARGE:g} to {LARGE:g}", ge=-LARGE, le=LARGE)
_SEVERAL = Admits("a list of at least two numbers", min_length=2, strict=False)

Positive = Annotated[float, POSITIVE]
NonNegative = Annotated[
    float, Field(ge=0.0, le=LARGE), AfterValidator(_reject_tiny), Admits(f"a number >= 0: 0, or from {_RANGE}")
]
Real = Annotated[float, REAL]
Switch = Annotated[bool, Admits("true or false")]
Numbers = Annotated[tuple[NonNegative, ...], _SEVERAL]
Reals = Annotated[tuple[Real, ...], _SEVERAL]
Pair = Annotated[tuple[Real, Real], Admits("two numbers in brackets", strict=False)]
OneLine = Annotated[str, Admits("text on one line", pattern=r"^[^\x00-\x1f\x7f]*$")]
Name = Annotated[str, Admits("letters, digits, '_', '-' and '.', the first no '-' or '.'", pattern=r"^\w[\w.-]*$")]
Word = Annotated[str, Admits("letters, digits, spaces, '_' and '-'", pattern=r"^\w[\w -]*$")]  # part of a dotted key


def described_field(text: str, default: Any = ..., **more: Any) -> Any:
    """A field whose description begins with its unit: "[kg] mass of the car"."""
    return Field(default, description=text, **more)


def number_between(low: float, high: float) -> Admits:
    return Admits(f"a number from {low:g} to {high:g}", ge=low, le=high)


def integer_between(low: int, high: int) -> Admits:
    return Admits(f"a whole number from {low} to {high}", ge=low, le=high)


def list_of_tables_like(example: str) -> Admits:
    return Admits(f"a list of tables {example}", strict=False)


def unequal_length_faults(times: Sequence[float] | None, name: str, column: Sequence[float] | None) -> list[str]:
    """Fault of a column that is not as long as the times; None: faulty by itself."""
    if times is None or column is None or len(column) == len(times):
        return []
    return [f"{name}: {len(column)} values; must be {len(times)}, as times"]


def exactly_one_faults(names: Sequence[str], written_values: Mapping[str, Any]) -> list[str]:
    """Faults unless exactly one of these fields is given."""
    present = [f"{name} = {short_text(written_values[name])}" for name in names if written_values.get(name) is not None]
    must = f"exactly one of {', '.join(names)} must be given"
    if not present:
        return [f"{names[0]}: missing; {must}"]
    return [f"{extra}: too much beside {present[0]}; {must}" for extra in present[1:]]


def not_rising_faults(name: str, column: Sequence[float] | None, sign: str = ">") -> list[str]:
    """Fault at the first row where a column falls, or with '>' where it does not rise."""
    for i, (before, after) in enumerate(pairwise(column or ()), start=1):
        if after < before or (sign == ">" and after == before):
            return [f"{name}[{i}] = {after!r}: must be {sign} {before!r}, the one before it"]
    return []


class Part(BaseModel):
    """A frozen piece of a scene; SceneError with all its faults."""

    not_modelled: ClassVar[dict[str, str]] = NOT_MODELLED  # keys that people try
    takes_keys_of: ClassVar[Sequence[type["Part"]]] = ()  # beside its own
    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, serialize_by_alias=True, validate_default=True, allow_inf_nan=False,
    )  # fmt: skip

    def __init__(self, **data: Any) -> None:
        faults: list[str] = []
        sound: dict[str, Any] = {}
        try:
            self.__pydantic_validator__.validate_python(data, self_instance=self, context=sound)
        except ValidationError as error:
            faults = [line for item in error.errors(include_url=False) for line in self._faults_of_error(item)]
        admissible = {name: sound.get(name) for name in type(self).model_fields}
        faults += self.model_construct(**admissible).cross_field_faults(data)
        if faults:
            raise SceneError(faults)

    @field_validator("*")
    @classmethod
    def _record_valid_value(cls, value: Any, info: Info) -> Any:
        info.context[info.field_name] = value  # type: ignore[index]
        return value

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy with some fields replaced, checked as a new one is."""
        part = type(self)
        values = {name: getattr(self, name) for name in part.model_fields} | dict(update or {})
        return part(**{_written_name(part, name): value for name, value in values.items()})

    def cross_field_faults(self, written_values: Mapping[str, Any]) -> list[str]:
        """Faults between fields, of which faulty ones and missing ones are None; written_values : as in a file."""
        return []

    @classmethod
    def written_field_names(cls) -> list[str]:
        """Names as written, inherited ones last."""
        own = sorted(cls.model_fields, key=lambda name: name not in cls.__annotations__)
        return [_written_name(cls, name) for name in own]

    @classmethod
    def _faults_of_error(cls, error: Any) -> list[str]:
        """Lines 'field = value: what is admissible' from one error of pydantic."""
        name, *inner = error["loc"]
        cause = error.get("ctx", {}).get("error")
        written = str(name) if str(name).isprintable() else repr(name)  # a fault is one line
        where = written + "".join(f"[{i}]" for i in inner if isinstance(i, int))
        if isinstance(cause, SceneError):  # of a part inside this one
            return [f"{where}.{fault}" for fault in cause.faults]
        if error["type"] == "too_short":  # beside the faults of its items
            return []
        if error["type"] == "missing":
            return [f"{where}: missing; must be {cls._admissible_text(name)}"]
        return [cls._value_fault(where, str(name), error, cause)]

    @classmethod
    def _value_fault(cls, where: str, name: str, error: Any, cause: Any) -> str:
        """Fault of a value that is there."""
        raw = error["input"]
        value = f"{where} = {short_text(raw)}"
        match error["type"]:
            case "extra_forbidden" if where in cls.not_modelled:
                return f"{where}: not modelled: {cls.not_modelled[where]}"
            case "extra_forbidden":
                return f"{value}: unknown key.{did_you_mean(where, cls.written_field_names())}"
            case "literal_error":
                return (
                    f"{value}: unknown.{did_you_mean(str(raw), _literals_or_kinds(cls.model_fields[name].annotation))}"
                )
            case "union_tag_invalid" | "union_tag_not_found":
                return _missing_or_unknown_kind_fault(where, raw, _literals_or_kinds(cls.model_fields[name].annotation))
        if where == "mass" and isinstance(raw, list | tuple):
            cause = f"not modelled: {NOT_MODELLED['masses']}"
        # pydantic's own error without a cause: the field must be a part
        return f"{value}: {cause or f'must be a table [{where}]'}"

    @classmethod
    def _admissible_text(cls, name: str) -> str:
        """What a field that is missing admits."""
        missing = next(x for key, x in cls.model_fields.items() if name in (key, x.alias))
        if words := _literals_or_kinds(missing.annotation):
            return f"one of {', '.join(words)}"
        return next((m.words for m in missing.metadata if isinstance(m, Admits)), f"a table [{name}]")


def number_or_table_type(number: Admits, table: type[Part]) -> Any:
    """The type of a number, or of a table in its place."""
    kind = Discriminator(lambda x: "table" if isinstance(x, dict | table) else "number")
    either = Annotated[Annotated[float, number], Tag("number")] | Annotated[table, Tag("table")]  # type: ignore[valid-type]
    return Annotated[either, kind, Admits(f"{number.words}, or a table {{{', '.join(table.written_field_names())}}}")]


def _written_name(part: type[Part], name: str) -> str:
    """The name of a field in a file: its alias, if it has one."""
    field = part.model_fields.get(name)
    return name if field is None else field.alias or name


def _missing_or_unknown_kind_fault(where: str, table: object, kinds: list[str]) -> str:
    kind = table.get("kind") if isinstance(table, dict) else None
    if kind is None:
        return f"{where}.kind: missing; must be one of {', '.join(kinds)}"
    return f"{where}.kind = {short_text(kind)}: unknown.{did_you_mean(str(kind), kinds)}"


def _literals_or_kinds(annotation: Any) -> list[str]:
    """Words of a Literal, or values of `kind` in a union of parts whose kinds tell them apart."""
    if get_origin(annotation) is Literal:
        return list(get_args(annotation))
    kinds: list[str] = []
    for member in get_args(annotation):
        kind = member.model_fields.get("kind") if isinstance(member, type) and issubclass(member, Part) else None
        kinds += [kind.default] if kind and not kind.is_required() else _literals_or_kinds(member)
    return kinds
