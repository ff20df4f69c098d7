"""Content of the page of an answer: assets/answer.html says how it stands there."""

import platform
from importlib import metadata
from typing import Any

import numpy as np
from markupsafe import Markup

from cablefem.response import Array
from validation.core.answers import outcome
from validation.core.methods import METHODS
from validation.core.quantities import matter
from validation.page.answer import figures as draw
from validation.page.answer.stored import Stored
from validation.page.side_view import side_view


def content(x: Stored) -> dict[str, Any]:
    """What assets/answer.html shows of a run or of a check of two."""
    moving = [r for r in x.runs if r.fields.t.size > 1]
    return {
        "x": x, "verdict": x.verdict, "outcome": outcome(x.scene, x.runs[0]).sentence, "matter": matter(x.design),
        "view": side_view(x.scene, moving, range_T=draw.tension_range(x), party=x.party) if moving else "",
        "ride": _ride(x), "tension": _tension(x), "methods": METHODS, "versions": _versions(),
        "work": [
            {"method": r.method, "n_dof": r.n_dof, "seconds": r.seconds, "reached": r.s_o[-1], **r.work}
            for r in x.runs
        ],
    }  # fmt: skip


def _ride(x: Stored) -> list[Markup]:
    r = x.runs[0]
    rows: list[tuple[str, str, draw.Of]] = [
        ("depth below the left support", "m", lambda r: r.y), ("speed", "km/h", lambda r: 3.6 * r.speed),
        ("press of the car on the rope", "N", lambda r: r.F_contact),
    ]  # fmt: skip
    if np.isfinite(r.F_haul).any():
        rows.append(("haul rope or thrust", "N", lambda r: r.F_haul))
    lines = "Green lines: events." if x.events else ""
    lines += " Dotted line: the rope goes slack somewhere." if x.onset is not None else ""
    drawn = [draw.series(x, rows, f"The ride over metres along the rope. {lines}", time=False)]
    if np.isfinite(r.kinetic).any() and r.drive != "grip":
        drawn.append(draw.energy_split(x, "Where the energy goes. Below zero: what outside forces gave."))
    rows.insert(2, ("place along the rope", "m", lambda r: r.s_o))
    drawn.append(draw.series(x, rows, f"The ride over time. {lines}", time=True))
    return drawn


def _tension(x: Stored) -> list[Markup]:
    rows: list[tuple[str, str, draw.Of]] = [
        ("behind the car", "N", lambda r: r.T_behind), ("ahead of the car", "N", lambda r: r.T_ahead),
        ("least along the rope", "N", lambda r: r.tension_min),
    ]  # fmt: skip
    supports: list[tuple[str, str, draw.Of]] = [
        ("left support", "N", lambda r: _size(r.reaction_left)),
        ("right support", "N", lambda r: _size(r.reaction_right)),
    ]  # fmt: skip
    drawn, r = [], x.runs[0]
    if r.fields.t.size > 1:
        drawn.append(draw.tension_field(x, r, f"Tension over time and place, by {r.method}. White line: the car."))
    if np.isfinite(r.reaction_left).any():
        drawn.append(draw.series(x, supports, "What the supports carry.", time=False))
    drawn.append(draw.series(x, rows, "Tension at the car, and the least anywhere.", time=False))
    return drawn


def _size(force: Array) -> Array:
    return np.hypot(*force.T)


def _versions() -> str:
    packages = ("cablefem", "numpy", "scipy", "scikit-fem", "numba")
    return ", ".join([f"Python {platform.python_version()}", *(f"{p} {metadata.version(p)}" for p in packages)])
