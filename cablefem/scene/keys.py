"""All keys of a scene file, and its JSON schema."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Union

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema

from cablefem.scene.fields import REAL, Part


@dataclass(frozen=True, slots=True)
class Key:
    name: str  # as `--set` takes it: dotted, 0 for the first of a list of tables
    unit: str
    meaning: str
    default: str
    admits: str
    kind: str = ""  # of its table, if only that kind has it

    @property
    def short_admits(self) -> str:
        """Admissible values, but for the widest range."""
        if self.admits == REAL.words:
            return "any number"
        text = re.sub(r":? ?(0, or )?,? ?from 1e-12 to 1e\+15|^a number (?=[>f])", "", self.admits)
        return text.replace("a number >= 0:", ">= 0")


class _Schema(GenerateJsonSchema):
    """Pydantic's schema without null, and with defaults that are numbers or words."""

    def nullable_schema(self, schema: Any) -> Any:
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: Any) -> Any:
        """Pydantic's schema of a default, without it where it is no number or word."""
        out = super().default_schema(schema)
        if not isinstance(out.get("default"), int | float | str) or out["default"] == "":
            out.pop("default", None)
        return out

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


def json_schema(*parts: type[Part]) -> dict[str, Any]:
    """The JSON schema of a scene file for these parts."""
    either: Any = Union[parts]  # noqa: UP007
    content = TypeAdapter(either).json_schema(schema_generator=_Schema)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | content | {"title": "scene of cablefem"}


def list_keys(part: type[Part]) -> Iterator[Key]:
    """All keys of a part and its parts, and of those whose keys it takes, too."""
    for own in (part, *part.takes_keys_of):
        content = json_schema(own)
        yield from _table_keys(content, content["$defs"], "")


def unit_of_key(part: type[Part], key: str) -> str:
    """Unit of a key as `--set` takes it, of lists of tables that of the first; "" of a number without one."""
    table, *rest = key.split(".")
    of_first_table = ".".join([table, "0", *rest[1:]])
    of_first_in_table = ".".join([table, *rest[:1], "0", *rest[2:]])
    for known in list_keys(part):
        if known.name in (key, of_first_table, of_first_in_table):
            return "" if known.unit == "-" else known.unit
    return ""


def _table_keys(table: dict[str, Any], definitions: dict[str, Any], prefix: str) -> Iterator[Key]:
    for name, rule in table["properties"].items():
        options = _alternative_rules(rule, definitions)
        tables = [x for x in options if "properties" in x]
        numbers = [x for x in options if "properties" not in x]
        if numbers:
            unit, meaning = re.fullmatch(r"\[(.*?)\] ?(.*)", rule["description"]).groups()  # type: ignore[union-attr]
            default = "required" if name in table.get("required", ()) else str(rule.get("default", "-"))
            words = numbers[0].get("$comment") or f"one of {', '.join(numbers[0].get('enum', ()))}"
            yield Key(prefix + name, unit, meaning, default, words)
        if len(tables) > 1:
            yield from _keys_of_kinds(tables, definitions, prefix + name)
        elif tables:
            index = ".0" if "items" in rule else ""
            yield from _table_keys(tables[0], definitions, f"{prefix}{name}{index}.")


def _alternative_rules(rule: dict[str, Any], definitions: dict[str, Any]) -> list[dict[str, Any]]:
    """The rules of which a value must follow one, of a list of tables those of its tables."""
    options = rule.get("anyOf") or rule.get("oneOf") or [rule]
    if "$ref" in rule.get("items", {}):
        options = [rule["items"]]
    return [definitions[x["$ref"].split("/")[-1]] if "$ref" in x else x for x in options]


def _keys_of_kinds(tables: list[dict[str, Any]], definitions: dict[str, Any], name: str) -> Iterator[Key]:
    """Keys of a table of several kinds: kind, own ones, shared ones."""
    kinds = [table["properties"]["kind"]["const"] for table in tables]
    yield Key(f"{name}.kind", "-", "which law; on a line trapezoid or table", "required", f"one of {', '.join(kinds)}")

    def first_name_in_table(key: Key) -> str:
        return key.name.removeprefix(f"{name}.").partition(".")[0]

    shared = set.intersection(*(set(table["properties"]) for table in tables))
    for table, kind in zip(tables, kinds, strict=True):
        for key in _table_keys(table, definitions, f"{name}."):
            if first_name_in_table(key) not in shared:
                yield replace(key, kind=kind)
    for key in _table_keys(tables[0], definitions, f"{name}."):
        if first_name_in_table(key) in shared - {"kind"}:
            yield key


def keys_containing_name_text(name: str, part: type[Part]) -> str:
    """The keys of a part whose last name, or whose table, is `name`, as a sentence; "" if there are none."""
    keys = list(dict.fromkeys(x.name for x in list_keys(part)))
    inside = [key for key in keys if key.startswith(f"{name}.")]
    containing = [key for key in keys if key.endswith(f".{name}")] or inside
    return f"the scene has {', '.join(containing[:4])}" if containing else ""
