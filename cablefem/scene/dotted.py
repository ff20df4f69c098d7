"""Values by dotted keys: mass.mass, drive.brake.0.force, obstacle.tree.top."""

from __future__ import annotations

import re
from typing import Any

RELATIVE = re.compile(r"[+-]?\d+(\.\d*)?([eE][+-]?\d+)?%")


def put(data: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key; list items by name or number, "+1%" is relative; ValueError for an unknown key."""
    *way, last = key.split(".")
    here: Any = data
    for name in way:
        here = here.setdefault(name, {}) if isinstance(here, dict) else _entry(here, name, key)
    if not isinstance(here, dict):
        raise ValueError(f"{key}: {'.'.join(way)} is no table")
    if isinstance(value, str) and RELATIVE.fullmatch(value):
        now = here.get(last)
        if not isinstance(now, int | float):
            raise ValueError(f"{key} = {value}: relative to a number, which the scene does not give")
        value = now * (1.0 + float(value[:-1]) / 100.0)
    here[last] = value


def _entry(tables: Any, name: str, key: str) -> Any:
    if isinstance(tables, list | tuple):
        for i, table in enumerate(tables):
            if isinstance(table, dict) and name in (table.get("name"), str(i)):
                return table
    raise ValueError(f"{key}: the scene has no such entry")
