"""Content of the page of an answer."""

import re
import tomllib
from collections.abc import Container, Iterator
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np
from markupsafe import Markup

from cablefem.response import Response
from cablefem.scene import Scene
from validation.core import limits
from validation.core.answers import outcome_of_run
from validation.core.measures import means_between
from validation.core.methods import METHODS
from validation.core.quantities import key_numbers, limit_text
from validation.core.scene_data import SceneData
from validation.page.answer import figures as draw
from validation.page.answer.stored import StoredAnswer
from validation.page.page import date_and_versions, html_table, limits_of
from validation.page.side_view import side_view


def answer_content(x: StoredAnswer) -> dict[str, Any]:
    """What assets/answer.html shows of a run or of a check of two."""
    moving = [r for r in x.runs if r.fields.t.size > 1]
    rows_of_limits = [limit_text(row) for row in limits.limit_rows(x.scene, x.design, x.all_events)]
    view = side_view(x.scene, moving, range_T=draw.tension_range(x), party=x.party) if moving else ""
    return {
        "x": x,
        "verdict": x.verdict,
        "outcome": outcome_of_run(x.scene, replace(x.runs[0], design=x.design)).sentence,
        "matter": key_numbers(x.design),
        "view": view,
        "has_values": lambda name: np.isfinite(getattr(x.runs[0], name)).any(),
        "series": partial(draw.plot_series, x),
        "energy_split": partial(draw.plot_energy_split, x),
        "tension_field": partial(draw.plot_tension_field, x),
        "methods": METHODS,
        "drawn_with": date_and_versions(),
        "limits": limits_of(rows_of_limits, limits.scope_sentences(x.scene)),
        "inputs": table_of_keys(x.scene.to_toml()),
        "loads": list(support_loads(x)),
        "work": [_cost_row(r) for r in x.runs],
    }


def _cost_row(r: Response) -> dict[str, Any]:
    counts = {name: int(count) for name, count in r.work.items()}
    return {"method": r.method, "n_dof": r.n_dof, "seconds": r.seconds, "reached": r.s_o[-1], **counts}


def support_loads(x: StoredAnswer) -> Iterator[dict[str, Any]]:
    """What each support carries when that is largest: components of one instant, means over an axial round trip."""
    r = x.runs[0]
    half = 0.5 * SceneData(r.scene_toml, r.length).round_trip
    for side in ("left", "right"):
        row = next((d for d in x.design if d["quantity"] == f"reaction_{side}_max"), None)
        if row is None or row["t"] is None:
            continue
        force = -getattr(r, f"reaction_{side}")  # of the rope on the support (n, 2)
        finite = np.isfinite(force).all(axis=1)
        force = force[finite]
        mean = force[0]
        if r.t.size > 2:
            t = r.t[finite]
            bounds = np.clip([row["t"] - half, row["t"] + half], t[0], t[-1])
            mean = means_between(t, force, bounds[:1], bounds[1:])[0]
        yield {"support": side, "t": row["t"], "right": float(mean[0]), "down": float(mean[1])}


def table_of_keys(toml: str, without: Container[str] = ()) -> Markup:
    """The table of all keys of a scene, but for some."""
    rows = []
    for key, value in _keys_and_values(tomllib.loads(toml)):
        if key in without or key in ("name", "title"):
            continue
        general = re.sub(r"\.\d+", ".0", key)  # as `list_keys` names it
        unit, meaning = _descriptions().get(general, ("", ""))
        rows.append({"key": key, "value": f"{_value_text(value)} {unit}".rstrip(), "meaning": meaning})
    return html_table(rows, ["key", "value", "meaning"], caption="All that the scene gives", stack=True)


def _keys_and_values(data: Any, before: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys and values; lists of tables are counted through, other lists are values."""
    if isinstance(data, list) and data and isinstance(data[0], dict):
        data = dict(enumerate(data))
    if not isinstance(data, dict):
        yield before, data
        return
    for name, value in data.items():
        yield from _keys_and_values(value, f"{before}.{name}" if before else str(name))


@cache
def _descriptions() -> dict[str, tuple[str, str]]:
    """Units and meanings of all keys of a scene."""
    from cablefem.scene.keys import list_keys  # slow to import

    units = {"-": "", "C": "°C", "m2": "m²", "m/s2": "m/s²", "m/s3": "m/s³", "kg/m3": "kg/m³"}
    return {key.name: (units.get(key.unit, key.unit), key.meaning) for key in list_keys(Scene)}


def _value_text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.10g}"
    if not isinstance(value, list):
        return str(value)
    ends = [
        f"({', '.join(map(_value_text, x))})" if isinstance(x, list) else _value_text(x) for x in (value[0], value[-1])
    ]
    return f"{len(value)} from {' to '.join(ends)}"
