"""What a check would notice: for each key of the scene the smallest fault in one solver that turns a row."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from cablefem.scene import Scene, SceneError
from validation.core.agreement import APART
from validation.core.grid import varied
from validation.core.measures import NotComparable
from validation.core.methods import find
from validation.core.rows import TABLE
from validation.core.running import run
from validation.core.view import View

if TYPE_CHECKING:
    from validation.commands.check.study import Check

STEP = 0.1  # [percent] by which a key is changed: rows change in proportion
LARGEST = 1.0  # a fault of the key's own size is no fault of a digit: beyond, nothing is told


def keys(data: Any, way: str = "") -> Iterator[str]:
    """Give the dotted keys of all numbers in the tables of a scene."""
    entries = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for name, value in entries:
        key = f"{way}.{name}" if way else str(name)
        if isinstance(value, float | int) and not isinstance(value, bool) and isinstance(data, dict) and value:
            yield key
        elif isinstance(value, dict | list):
            yield from keys(value, key)


def sensitivity(result: Check) -> dict[str, float]:
    """Return for each key that matters the smallest relative fault that would be told as a disagreement.

    One run a key, at half the resolution of the first answer: the change of a row needs fewer digits than the row.
    """
    import tomllib

    base = (*result.a.space.runs, result.a.run)[0]
    view = View.of(result.scene).cut(result.a.run, result.b.run)
    bars = {(row.quantity, row.law): row.allowed for row in result.rows if row.asked}
    out = {}
    for key in keys(tomllib.loads(result.scene.to_toml())):
        other = _changed(result.scene, key)
        if other is None:
            continue
        changed = run(other, find(base.method), until=view.stop, **base.settings)
        changed = replace(changed, scene_toml=base.scene_toml)
        found = [_least(changed, base, q, bars, view) for q in TABLE if q.asks and q.concerns(view)]
        if found and min(found) < LARGEST:
            out[key] = min(found)
    return dict(sorted(out.items(), key=lambda item: item[1]))


def _changed(scene: Scene, key: str) -> Scene | None:
    for sign in "+-":
        try:
            other = varied(scene, {key: f"{sign}{STEP}%"})
            return other if isinstance(other, Scene) else None
        except (SceneError, ValueError):
            continue
    return None


def _least(changed: Any, base: Any, quantity: Any, bars: dict[tuple[str, str], float], view: View) -> float:
    """Return the least fault that a row notices: three times its bars over its change per fault."""
    allowed = bars.get((quantity.name, quantity.law), math.inf)
    try:
        gap = quantity.gap(changed, base, view)
    except NotComparable:
        return math.inf
    return APART * allowed * 0.01 * STEP / gap if gap > 0.0 else math.inf


def told(found: dict[str, float]) -> str:
    """Return one line: which faults in one solver this check would notice."""
    parts = ", ".join(f"{key} {100.0 * fault:.2g} %" for key, fault in found.items())
    return f"would notice: {parts}" if parts else "would notice no fault of a key of the scene"
