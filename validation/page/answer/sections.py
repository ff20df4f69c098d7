"""Sections of the page of an answer, in the order of a reader's questions: what, where, how hard, from what."""

import platform
from importlib import metadata
from typing import Any

import numpy as np
from markupsafe import Markup

from cablefem.response import Array, Response
from validation.core.answers import outcome
from validation.core.methods import METHODS
from validation.core.quantities import matter, scale_of, told, with_bar
from validation.page.answer import figures as draw
from validation.page.answer.stored import Stored
from validation.page.page import Section, callout, columns, details, gallery, number, percent, table
from validation.page.side_view import SCRIPT, side_view

PLANAR = (
    "The run is planar. It shows no sway across the line, no gusts from the side, no tilt of the car. Towers, "
    "counterweights, bending, creep of the rope and a yielding ground are not modelled."
)


def answer(x: Stored) -> list[Section]:
    """Sections common to a run and a check of two."""
    return [_answer(x), _side(x), _ride(x), _tension(x), _scene(x)]


def typeset(text: str) -> str:
    """A number with bar and unit, with a minus sign and without line breaks."""
    return text.replace(" ± ", "\u202f±\u202f").replace("-", "−")


def _answer(x: Stored) -> Section:
    heads = {"what": "quantity", "value": "value", "t": "when", "mass": "car at", "at": "where"}
    first = matter(x.design)

    def numbers(rows: list[dict[str, Any]], caption: str = "") -> Markup:
        cells = [(row := told(d)) | {"value": typeset(row["value"])} for d in rows]
        return table(cells, heads, caption=caption, stack=True)

    html = [callout(str(flag), "not comparable") for flag in x.runs[0].flags]
    if x.events:
        named = {"event": "event", "t": "after [s]", "s_o": "at [m]", "kmh": "speed [km/h]"}
        html.append(table(_events(x), named, caption="What happens", stack=True))
    if first:
        html.append(numbers(first, "The numbers that matter"))
        html.append(details(f"All {len(x.design)} design numbers", numbers(x.design)))
        html.append(Markup(
            "<p><small>Forces are means over an axial round trip, what a load cell feels. Places are metres along the "
            "rope from the left support. The bar after ± is the solver’s own or the distance to the other solver, "
            "whichever is larger.</small></p>"
        ))  # fmt: skip
    sentence = outcome(x.scene, x.runs[0]).sentence
    return Section("answer", "Answer", Markup("\n").join(html), x.verdict, f"{sentence[0].upper()}{sentence[1:]}.")


def _events(x: Stored) -> list[dict[str, str]]:
    rows = []
    for e in x.events:
        t, s_o, speed = (e.get(f"bar_{key}") for key in ("t", "s_o", "speed"))
        rows.append({
            "event": e["event"].replace("_", " "), "t": typeset(with_bar(e["t"], t)),
            "s_o": typeset(with_bar(e["s_o"], s_o)),
            "kmh": typeset(with_bar(3.6 * e["speed"], speed and 3.6 * speed)),
        })  # fmt: skip
    return rows


def _side(x: Stored) -> Section:
    moving = [r for r in x.runs if r.fields.t.size > 1]
    view = side_view(x.scene, moving, range_T=draw.tension_range(x), party=x.party) if moving else Markup("")
    return Section("side-view", "Side view", view, scripts=(SCRIPT,))


def _ride(x: Stored) -> Section:
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
    return Section("ride", "The ride", columns(*drawn))


def _tension(x: Stored) -> Section:
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
    return Section("tension", "Tension", columns(*drawn))


def _size(force: Array) -> Array:
    return np.hypot(*force.T)


def _quantity(value: float, unit: str) -> str:
    factor, name = scale_of(np.array([value]), unit)
    return f"{number(factor * value, 4)}\u202f{name}"


def _scene(x: Stored) -> Section:
    scene, drop = x.scene, x.scene.supports.drop
    assert scene.mass is not None
    where = "level with" if not drop else f"{abs(drop):.6g} m {'below' if drop > 0 else 'above'}"
    facts = {
        "span": f"{scene.supports.span:.6g} m", "right support": f"{where} the left one",
        "rope between the supports": f"{scene.length:.6g} m",
        "sag at rest": f"{scene.sag:.4g} m, {percent(scene.sag_ratio)} of the span",
        "horizontal tension at rest": _quantity(scene.horizontal_tension, "N"),
        "axial stiffness EA": _quantity(scene.cable.EA, "N"),
        "car": f"{scene.mass.mass:.6g} kg",
        "drive": x.runs[0].drive,
    }  # fmt: skip
    if scene.damping:
        facts["damping of the rope"] = f"{percent(scene.damping_ratio)} of critical in the first mode"
    if scene.travel is not None and scene.top_speed is not None:
        facts["travel"] = f"{scene.travel.kind.replace('_', ' ')}, up to {scene.top_speed:.4g} m/s"
    if scene.speed_ratio is not None:
        facts["top speed over that of waves across the rope"] = percent(scene.speed_ratio)
    groups = f"μ = M/(ρl) = {scene.mu:.4g}, α = EA/H = {scene.alpha:.4g}, σ = ρgl/H = {scene.sigma:.4g}"
    rows = [{"what": what, "value": value} for what, value in facts.items()]
    file = details("Scene file (TOML) and groups", Markup("<p>{}</p><pre>{}</pre>").format(groups, scene.to_toml()))
    facts_of = table(rows, {"what": "scene", "value": "value"})
    html = gallery(facts_of, Markup("<div><p>{}</p>{}</div>").format(PLANAR, file))
    return Section("scene", "The scene as it was read", html)


def behind(x: Stored) -> Markup:
    """Settings and work of the runs, folded."""
    work = [
        {"run": r.method, "unknowns": r.n_dof, **r.work, "seconds": r.seconds, "reached": f"{r.s_o[-1]:.1f} m"}
        for r in x.runs
    ]
    heads = {
        "run": "run", "unknowns": "unknowns", "steps": "steps", "newton_iterations": "Newton iterations",
        "seconds": "time loop [s]", "reached": "computed up to",
    }  # fmt: skip
    parts = [details("Work of the solvers", table(work, heads)), *(_settings(r) for r in x.runs)]
    return Markup("\n").join([*parts, Markup("<p><small>Page drawn with {}.</small></p>").format(_versions())])


def _settings(r: Response) -> Markup:
    method = METHODS.get(r.method)
    known = {} if method is None else {name: knob.meaning for name, knob in method.knobs.items()}
    used: dict[str, Any] = {**r.settings, "model": r.model, "load": r.load, "law": r.law}
    rows = [{"name": name, "value": _shown(value), "meaning": known.get(name, "")} for name, value in used.items()]
    return details(f"Settings of {r.method}", table(rows, {"name": "setting", "value": "value", "meaning": "meaning"}))


def _shown(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _versions() -> str:
    packages = ("cablefem", "numpy", "scipy", "scikit-fem", "numba")
    return ", ".join([f"Python {platform.python_version()}", *(f"{p} {metadata.version(p)}" for p in packages)])
