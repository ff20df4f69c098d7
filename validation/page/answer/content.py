"""Content of the page of an answer."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from markupsafe import Markup

from cablefem.response import Response
from validation.core.answers import averaging_time_sentence, crosswind_scope_text, outcome_of_run
from validation.core.design import axial_round_trip_time
from validation.core.limits import limit_rows, limit_scope_sentences
from validation.core.measures import time_means_between
from validation.core.methods import METHODS
from validation.core.quantities import key_numbers, limit_row_texts
from validation.page.answer import figures as draw
from validation.page.answer.stored import StoredAnswer
from validation.page.page import Content, Row, limits_of, versions_footer
from validation.page.scene_keys import scene_keys_table
from validation.page.side_view import side_view_of_runs


def answer_page_content(answer: StoredAnswer) -> Content:
    """What assets/answer.html shows of a run or of a check of two."""
    scene = answer.scene
    design = answer.design
    r = answer.runs[0]
    outcome = outcome_of_run(scene, replace(r, design=design))
    limit_texts = [limit_row_texts(row) for row in limit_rows(scene, design, answer.all_events)]

    content: Content = {"x": answer, "verdict": answer.verdict, "methods": METHODS}
    content["outcome"] = outcome.sentence
    content["crosswind"] = crosswind_scope_text(scene, r.model)
    content["means"] = averaging_time_sentence(r)
    content["matter"] = key_numbers(design)
    content["view"] = _side_view(answer)
    content["has_values"] = lambda name: np.isfinite(getattr(r, name)).any()
    content["series"] = partial(draw.plot_series, answer)
    content["energy_split"] = partial(draw.plot_energy_since_start, answer)
    content["tension_field"] = partial(draw.plot_tension_field, answer)
    content["drawn_with"] = versions_footer()
    content["limits"] = limits_of(limit_texts, limit_scope_sentences(scene))
    content["inputs"] = scene_keys_table(scene.to_toml())
    content["loads"] = mean_forces_at_peak_loads(r, design)
    content["work"] = [_cost_row(run) for run in answer.runs]
    return content


def _side_view(answer: StoredAnswer) -> Markup | str:
    """The side view of the runs that came beyond their start; "" without any."""
    moving = [r for r in answer.runs if r.fields.t.size > 1]
    if not moving:
        return ""
    range_T = draw.compared_tension_range(answer)
    return side_view_of_runs(answer.scene, moving, range_T=range_T, third_party=answer.third_party)


def _cost_row(r: Response) -> Row:
    counts = {name: int(count) for name, count in r.work.items()}
    return {"method": r.method, "n_dof": r.n_dof, "seconds": r.seconds, "reached": r.s_o[-1]} | counts


def mean_forces_at_peak_loads(r: Response, design: Sequence[Row]) -> list[Row]:
    """What each support carries when that is largest: components of one instant, means over an axial round trip."""
    half = 0.5 * axial_round_trip_time(r.scene_toml, r.length)
    peaks = {d["quantity"]: d["t"] for d in design}
    loads = []
    for side in ("left", "right"):
        t_peak = peaks.get(f"reaction_{side}_max")
        if t_peak is None:
            continue
        force = -getattr(r, f"reaction_{side}")  # of the rope on the support (n, 2)
        finite = np.isfinite(force).all(axis=1)
        force = force[finite]
        mean = force[0]
        if r.t.size > 2:
            t = r.t[finite]
            bounds = np.clip([t_peak - half, t_peak + half], t[0], t[-1])
            mean = time_means_between(t, force, bounds[:1], bounds[1:])[0]
        right, down = mean.tolist()
        loads.append({"support": side, "t": t_peak, "right": right, "down": down})
    return loads
