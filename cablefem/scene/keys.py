"""All keys of a scene file, read off the models, and their JSON schema."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, get_args

from cablefem.scene.fields import REAL, Check, NumberOr, Part


@dataclass(frozen=True, slots=True)
class Key:
    name: str  # dotted; [] after a list of tables, (kind) after a table of several
    unit: str
    meaning: str
    default: str
    admits: str

    @property
    def brief(self) -> str:
        """Admissible values, but for the widest range."""
        if self.admits == REAL.admissible:
            return "any number"
        text = re.sub(r":? ?(0, or )?,? ?from 1e-12 to 1e\+15|^a number (?=[>f])", "", self.admits)
        return text.replace("a number >= 0:", ">= 0")


def keys(part: type[Part], before: str = "") -> Iterator[Key]:
    """All keys of a part and its parts."""
    for name in part.field_names():
        field = _field(part, name)
        checks, parts, many = _types(field)
        unit, meaning = re.fullmatch(r"\[(.*?)\] ?(.*)", field.description or "[-] ").groups()  # type: ignore[union-attr]
        numbered = [check for check in checks if not (parts and check.admissible.startswith("a list of tables"))]
        if numbered or not parts:
            default = "-" if field.default in (None, (), "") else f"{field.default}"
            admits = " or ".join(check.admissible for check in numbered)
            yield Key(before + name, unit, meaning, "required" if field.is_required() else default, admits)
        if len(parts) > 1:
            yield from _kinds(parts, before + name)
        else:
            yield from keys(parts[0], f"{before}{name}{'[]' if many else ''}.") if parts else ()


def _kinds(parts: list[type[Part]], name: str) -> Iterator[Key]:
    """Keys of a table of several kinds: the kind, its own keys, shared ones."""
    kinds = [part.model_fields["kind"].default for part in parts]
    yield Key(f"{name}.kind", "-", "which law", "required", f"one of {', '.join(kinds)}")
    for part, kind in zip(parts, kinds, strict=True):
        own = [key for key in keys(part, f"{name} ({kind}).") if key.name.split(".")[1] in _own(part) - {"kind"}]
        yield from own
    shared = _own(parts[0].__base__)  # type: ignore[arg-type]
    yield from (key for key in keys(parts[0], f"{name}.") if key.name.split(".")[1] in shared)


def _own(part: type[Part]) -> set[str]:
    """Names of fields that are not inherited."""
    return {part.model_fields[name].alias or name for name in part.__annotations__ if name in part.model_fields}


def schema(*parts: type[Part]) -> dict[str, Any]:
    """The JSON schema of a scene file for these parts."""
    content = _table(parts[0]) if len(parts) == 1 else {"anyOf": [_table(part) for part in parts]}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "scene of cablefem", **content}


def _table(part: type[Part]) -> dict[str, Any]:
    fields = {name: _field(part, name) for name in part.field_names()}
    return {
        "type": "object", "additionalProperties": False,
        "properties": {name: _property(field) for name, field in fields.items()},
        "required": [name for name, field in fields.items() if field.is_required()],
    }  # fmt: skip


def _property(field: Any) -> dict[str, Any]:
    checks, parts, many = _types(field)
    told: dict[str, Any] = {"description": field.description}
    if isinstance(field.default, int | float | str) and field.default != "":
        told["default"] = field.default
    if many:
        return told | {"type": "array", "items": _table(parts[0])}
    options = [check.schema for check in checks] + [_table(part) for part in parts]
    if not options:  # a kind
        return told | {"const": field.default}
    return told | (options[0] if len(options) == 1 else {"anyOf": options})


def _field(part: type[Part], written: str) -> Any:
    return next(field for name, field in part.model_fields.items() if written in (name, field.alias))


def _types(field: Any) -> tuple[list[Check], list[type[Part]], bool]:
    """Checks and tables of a field, and whether it is a list."""
    checks: list[Check] = []
    parts: list[type[Part]] = []

    def look(annotation: Any, metadata: Any) -> None:
        for validator in (getattr(x, "func", None) for x in metadata):
            if isinstance(validator, NumberOr):
                checks.append(validator.number)
                parts.append(validator.table)
            elif isinstance(validator, Check):
                checks.append(validator)
        if isinstance(annotation, type) and issubclass(annotation, Part):
            parts.append(annotation)
        elif not checks or _is_tuple(annotation):
            for inner in get_args(annotation):
                marks = getattr(inner, "__metadata__", None)
                look(inner if marks is None else inner.__origin__, marks or ())

    look(field.annotation, field.metadata)
    many = bool(parts) and any(check.schema.get("type") == "array" for check in checks)
    if not parts and len(checks) > 1:  # the check of the list comes first
        checks = checks[:1]
    return checks, parts, many


def _is_tuple(annotation: Any) -> bool:
    return getattr(annotation, "__origin__", None) is tuple
