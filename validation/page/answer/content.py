"""Content of the page of an answer."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from validation.core.answers import outcome
from validation.core.methods import METHODS
from validation.core.quantities import matter
from validation.page.answer import figures as draw
from validation.page.answer.stored import Stored
from validation.page.page import settings, versions
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
        "methods": METHODS, "versions": settings(versions()),
        "work": [
            {"method": r.method, "n_dof": r.n_dof, "seconds": r.seconds, "reached": r.s_o[-1], **r.work}
            for r in x.runs
        ],
    }  # fmt: skip
