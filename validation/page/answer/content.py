"""Content of the page of an answer."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from cablefem.response import Response
from validation.core import limits
from validation.core.answers import averaging_time_sentence, crosswind_scope_text, outcome_of_run
from validation.core.measures import time_means_between
from validation.core.methods import METHODS
from validation.core.quantities import key_numbers, limit_row_texts
from validation.core.scene_data import SceneData
from validation.page.answer import figures as draw
from validation.page.answer.stored import StoredAnswer
from validation.page.page import limits_of, versions_footer
from validation.page.scene_keys import scene_keys_table
from validation.page.side_view import side_view_of_runs


def answer_page_content(answer: StoredAnswer) -> dict[str, Any]:
    """What assets/answer.html shows of a run or of a check of two."""
    moving = [r for r in answer.runs if r.fields.t.size > 1]
    rows_of_limits = [limit_row_texts(row) for row in limits.limit_rows(answer.scene, answer.design, answer.all_events)]
    view = (
        side_view_of_runs(
            answer.scene, moving, range_T=draw.compared_tension_range(answer), third_party=answer.third_party
        )
        if moving
        else ""
    )
    return {
        "x": answer,
        "verdict": answer.verdict,
        "outcome": outcome_of_run(answer.scene, replace(answer.runs[0], design=answer.design)).sentence,
        "crosswind": crosswind_scope_text(answer.scene, answer.runs[0].model),
        "means": averaging_time_sentence(answer.runs[0]),
        "matter": key_numbers(answer.design),
        "view": view,
        "has_values": lambda name: np.isfinite(getattr(answer.runs[0], name)).any(),
        "series": partial(draw.plot_series, answer),
        "energy_split": partial(draw.plot_energy_split, answer),
        "tension_field": partial(draw.plot_tension_field, answer),
        "methods": METHODS,
        "drawn_with": versions_footer(),
        "limits": limits_of(rows_of_limits, limits.limit_scope_sentences(answer.scene)),
        "inputs": scene_keys_table(answer.scene.to_toml()),
        "loads": list(largest_support_loads(answer)),
        "work": [_cost_row(r) for r in answer.runs],
    }


def _cost_row(r: Response) -> dict[str, Any]:
    counts = {name: int(count) for name, count in r.work.items()}
    return {"method": r.method, "n_dof": r.n_dof, "seconds": r.seconds, "reached": r.s_o[-1], **counts}


def largest_support_loads(answer: StoredAnswer) -> Iterator[dict[str, Any]]:
    """What each support carries when that is largest: components of one instant, means over an axial round trip."""
    r = answer.runs[0]
    half = 0.5 * SceneData(r.scene_toml, r.length).round_trip
    for side in ("left", "right"):
        row = next((d for d in answer.design if d["quantity"] == f"reaction_{side}_max"), None)
        if row is None or row["t"] is None:
            continue
        force = -getattr(r, f"reaction_{side}")  # of the rope on the support (n, 2)
        finite = np.isfinite(force).all(axis=1)
        force = force[finite]
        mean = force[0]
        if r.t.size > 2:
            t = r.t[finite]
            bounds = np.clip([row["t"] - half, row["t"] + half], t[0], t[-1])
            mean = time_means_between(t, force, bounds[:1], bounds[1:])[0]
        yield {"support": side, "t": row["t"], "right": float(mean[0]), "down": float(mean[1])}
