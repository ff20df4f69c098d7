"""Content of the page of an answer."""

import re
import tomllib
from collections.abc import Container, Iterator
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np
from markupsafe import Markup

from cablefem.scene import Scene
from validation.core.answers import outcome
from validation.core.evidence import Given
from validation.core.measures import averaged
from validation.core.methods import METHODS
from validation.core.quantities import matter
from validation.page.answer import figures as draw
from validation.page.answer.stored import Stored
from validation.page.page import drawn_with, table
from validation.page.side_view import side_view


def content(x: Stored) -> dict[str, Any]:
    """What assets/answer.html shows of a run or of a check of two."""
    moving = [r for r in x.runs if r.fields.t.size > 1]
    found = outcome(x.scene, replace(x.runs[0], design=x.design))
    return {
        "x": x, "verdict": x.verdict, "outcome": found.sentence, "matter": matter(x.design),
        "view": side_view(x.scene, moving, range_T=draw.tension_range(x), party=x.party) if moving else "",
        "known": lambda name: np.isfinite(getattr(x.runs[0], name)).any(), "series": partial(draw.series, x),
        "energy_split": partial(draw.energy_split, x), "tension_field": partial(draw.tension_field, x),
        "methods": METHODS, "drawn_with": drawn_with(), "inputs": inputs(x.scene.to_toml()), "loads": list(loads(x)),
        "work": [
            {"method": r.method, "n_dof": r.n_dof, "seconds": r.seconds, "reached": r.s_o[-1]}
            | {name: int(count) for name, count in r.work.items()}
            for r in x.runs
        ],
    }  # fmt: skip


def loads(x: Stored) -> Iterator[dict[str, Any]]:
    """What each support carries when that is largest: components of one instant, means over an axial round trip."""
    r = x.runs[0]
    half = 0.5 * Given(r.scene_toml, r.length).round_trip
    for side in ("left", "right"):
        row = next((d for d in x.design if d["quantity"] == f"reaction_{side}_max"), None)
        if row is None or row["t"] is None:
            continue
        force = -getattr(r, f"reaction_{side}")  # of the rope on the support (n, 2)
        there = np.isfinite(force).all(axis=1)
        t = r.t[there]
        low, high = (np.clip([row["t"] + away], t[0], t[-1]) for away in (-half, half))
        right, down = averaged(t, force[there], low, high)[0] if t.size > 2 else force[there][0]
        yield {"support": side, "t": row["t"], "right": float(right), "down": float(down)}


def inputs(toml: str, without: Container[str] = ()) -> Markup:
    """The table of all keys of a scene, but for some."""
    rows = []
    for key, value in _leaves(tomllib.loads(toml)):
        if key in without or key in ("name", "title"):
            continue
        unit, meaning = _known().get(_general(key), ("", ""))
        rows.append({"key": key, "value": f"{_text(value)} {unit}".rstrip(), "meaning": meaning})
    return table(rows, ["key", "value", "meaning"], caption="All that the scene gives", stack=True)


def _leaves(data: Any, way: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys and values; lists of tables are counted through, other lists are values."""
    tables = isinstance(data, list) and bool(data) and isinstance(data[0], dict)
    if not isinstance(data, dict) and not tables:
        yield way, data
        return
    for name, value in data.items() if isinstance(data, dict) else enumerate(data):
        yield from _leaves(value, f"{way}.{name}" if way else str(name))


def _general(key: str) -> str:
    """The key as it is described: brake.0.from is brake[].from."""
    return re.sub(r"\.\d+", "[]", key)


@cache
def _known() -> dict[str, tuple[str, str]]:
    """Units and meanings of all keys of a scene."""
    from cablefem.scene.keys import keys  # slow to import

    units = {"-": "", "C": "°C", "m2": "m²", "m/s2": "m/s²", "m/s3": "m/s³", "kg/m3": "kg/m³"}
    known = {re.sub(r" \(.*?\)", "", key.name): (units.get(key.unit, key.unit), key.meaning) for key in keys(Scene)}
    return known


def _text(value: Any) -> str:
    if isinstance(value, list):
        first, last = (_text(value[i]) if not isinstance(value[i], list) else f"({', '.join(map(_text, value[i]))})"
                       for i in (0, -1))  # fmt: skip
        return f"{len(value)} from {first} to {last}"
    return f"{value:.10g}" if isinstance(value, float) else str(value)
