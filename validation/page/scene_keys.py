"""All that a scene file gives, as a table."""

import re
import tomllib
from collections.abc import Container, Iterator
from functools import cache
from typing import Any

from markupsafe import Markup

from cablefem.scene import Scene
from cablefem.scene.line import Line
from validation.page.page import details, html_table, versions_footer


def scene_keys_table(toml: str, scene_type: type[Scene | Line] = Scene, without: Container[str] = ()) -> Markup:
    """The table of all keys of a scene or a line, but for some."""
    rows = []
    for key, value in dotted_keys_and_values(tomllib.loads(toml)):
        if key in without or key in ("name", "title"):
            continue
        general = re.sub(r"\.\d+", ".0", key)  # as `list_keys` names it
        unit, meaning = _units_and_meanings_of_keys(scene_type).get(general, ("", ""))
        rows.append({"key": key, "value": f"{_value_text(value)} {unit}".rstrip(), "meaning": meaning})
    return html_table(rows, ["key", "value", "meaning"], caption="All that the scene gives", stack=True)


def dotted_keys_and_values(data: Any, before: str = "", *, by_name: bool = False) -> Iterator[tuple[str, Any]]:
    """Dotted keys and values of a scene file; by_name : tables of a list by name where they have one, else by number.

    Other lists are values.
    """
    if isinstance(data, list) and data and isinstance(data[0], dict):
        data = {x.get("name", i) if by_name else i: x for i, x in enumerate(data)}
    if not isinstance(data, dict):
        yield before, data
        return
    for name, value in data.items():
        yield from dotted_keys_and_values(value, f"{before}.{name}" if before else str(name), by_name=by_name)


@cache
def _units_and_meanings_of_keys(scene_type: type[Scene | Line]) -> dict[str, tuple[str, str]]:
    """Units and meanings of all keys."""
    from cablefem.scene.keys import list_keys  # slow to import

    units = {"-": "", "C": "°C", "m2": "m²", "m/s2": "m/s²", "m/s3": "m/s³", "kg/m3": "kg/m³"}
    return {key.name: (units.get(key.unit, key.unit), key.meaning) for key in list_keys(scene_type)}


def _value_text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.10g}"
    if not isinstance(value, list):
        return str(value)
    if len(value) <= 3 and not isinstance(value[0], list):
        return f"({', '.join(map(_value_text, value))})"
    return f"{len(value)} from {_value_text(value[0])} to {_value_text(value[-1])}"


def line_inputs_html(toml: str) -> Markup:
    """The table of a line's keys, its TOML, and the last line of a page."""
    text = details("Scene file (TOML)", Markup("<pre>{}</pre>").format(toml))
    return scene_keys_table(toml, Line) + text + versions_footer()
