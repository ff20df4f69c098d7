"""Pages about a check: the verdict first, then both answers side by side, then where they come from.

Read from the folder that `study.Check.write` wrote; what is missing there is named, the rest shown.
"""

import platform
import re
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup, escape

from cablefem.response import Array, Response
from validation.commands.check import figures as draw
from validation.commands.check.shared import SHARED
from validation.commands.check.stored import Solver, Stored, read
from validation.core import measures
from validation.core.bounds import Bound
from validation.core.measures import NotComparable
from validation.core.methods import METHODS
from validation.core.quantities import named, scale_of, told, with_bar
from validation.core.trust import Reach, reach
from validation.page.page import (
    VERDICTS,
    Section,
    callout,
    details,
    gallery,
    number,
    percent,
    plain,
    table,
    words,
)  # fmt: skip
from validation.page.player import SCRIPT, player

_SAY = words(__package__)

# quantity of a row -> what it is, and what its gap is a ratio of
QUANTITIES = {
    "path_max": ("Mass path, largest distance", "path"),
    "path_rms": ("Mass path, rms distance", "path"),
    "place": ("Place on the cable, largest distance", "length"),
    "speed": ("Speed, largest distance", "speed"),
    "path_slack": ("Mass path past the slack onset, largest distance", "path"),
    "tension": ("Tension along the cable, rms off the mass", "tension"),
    "tension_behind": ("Tension behind the mass, rms", "tension"),
    "tension_ahead": ("Tension ahead of the mass, rms", "tension"),
    "reactions": ("Support reactions, rms", "tension"),
    "displacement": ("Displacement of the cable, rms of its own", ""),
    "velocity": ("Velocity of the cable, rms of its own", ""),
    "deep": ("Third party", ""),
    "slack_onset": ("Slack onset, in sₒ/l", ""),
    "impulse": ("Momentum of the mass, rms defect", "weight"),
    "laws_si": ("Mechanics in SI", ""),
    "energy": ("Energy balance, rms defect", "work"),
}
LAWS = ("impulse", "laws_si", "energy")  # rows about one answer and mechanics


def sections(folder: Path) -> list[Section]:
    """Return the pages about the check stored in a folder; a folder without any answer gives one that says so."""
    faults: list[str] = []
    x = read(folder, faults)
    gone = Markup(_SAY.gone(faults))
    if x is None:
        text = "No verdict: the folder holds no finished answer of any solver."
        return [Section("check-verdict", "Verdict", gone, "not comparable", text)]
    ride = [_ride(x)] if x.solvers[0].run.drive != "grip" else []
    return [_verdict(x, gone), *ride, _path(x), *_motion(x), _tension(x), _laws(x), _refinement(x), _provenance(x)]


# --- the verdict ----------------------------------------------------------------------------------------------------


def _references(x: Stored) -> dict[str, tuple[float, str, str]]:
    """Return what gaps are ratios of: value, unit, words."""
    return {
        "path": (x.scale.path_scale, "m", x.scale.path_scale_named.removeprefix("the ")),
        "tension": (x.scene.horizontal_tension, "N", "horizontal tension H at rest"),
        "weight": (x.weight, "N", "weight M g of the mass"),
        "work": (x.weight * x.scale.max_deflection, "J", "weight times the largest deflection"),
        "length": (x.scene.length, "m", "length of the cable"),
        "speed": (float(x.solvers[0].run.speed.max()), "m/s", "top speed"),
    }


def _quantity(value: float, unit: str, digits: int = 3) -> str:
    factor, name = scale_of(np.array([value]), unit)
    return f"{number(factor * value, digits)}\u202f{name}"


def _verdict(x: Stored, gone: Markup) -> Section:
    of = _references(x)
    doubts = (callout(f"{d['method']}: {d['words']}.", "not comparable") for d in x.doubts)
    html = [gone, *doubts, Markup(_SAY.happened(_events(x))), _design(x)]
    if x.rows:
        shown = [row for row in x.rows if row.get("quantity") not in LAWS or row.get("verdict") != "agree"]
        used = dict.fromkeys(kind for row in shown if (kind := _words(row)[1]))
        excused = x.verdict == "agree" and any(row.get("verdict") == "too coarse" for row in shown)
        scales = [(_quantity(*of[kind][:2]), of[kind][2]) for kind in used]
        html += [_rows(x, shown), Markup(_SAY.references(scales, excused))]
    r = x.solvers[0].run
    reach = _SAY.reach(x, *x.times(r), _parting(x))
    heads = {
        "solver": "solver", "deflection": "largest deflection of the mass", "slack": "cable slack",
        "law": "law of the cable", "end": "computed up to",
    }  # fmt: skip
    facts = table([_facts(s, x) for s in x.solvers], heads, stack=True)
    html += [Markup("<h3>How far the answer goes</h3>"), callout(Markup(reach)), facts]
    return Section("check-verdict", "Verdict", Markup("\n").join(html), x.verdict, _headline(x))


def _design(x: Stored) -> Markup:
    """Return the numbers a design asks for, each with its bar, where and when."""
    rows = [(row := told(d, x.scene.length)) | {"value": _set(row["value"])} for d in x.design]
    heads = {"what": "quantity", "value": "value", "t": "when", "mass": "mass at sₒ/l", "at": "at s/l"}
    return table(rows, heads, caption="Design numbers", stack=True) if rows else Markup("")


def _set(text: str) -> str:
    """Return a number with its bar and unit as it is set: a minus sign, no line break within."""
    return text.replace(" ± ", "\u202f±\u202f").replace("-", "−")


def _rows(x: Stored, rows: list[dict[str, Any]]) -> Markup:
    heads = {
        "quantity": "quantity", "verdict": "verdict", "gap": "gap", "allowed": "allowed", "used": "gap / allowed",
        "where": "largest at sₒ/l", "why": "allowed because of",
    }  # fmt: skip
    of = _references(x)
    return table([_row(row, of) for row in rows], heads, sort=True, stack=True)


def _row(row: dict[str, Any], of: dict[str, tuple[float, str, str]]) -> dict[str, Any]:
    name, kind = _words(row)
    gap, allowed = row.get("gap"), row.get("allowed")
    about = [part for part in (row.get("law"), row.get("with")) if part]
    return {
        "quantity": ": ".join([name, *about]),
        "gap": _both(gap, kind, of),
        "allowed": _both(allowed, kind, of),
        "used": number(gap / allowed, 2) if gap is not None and allowed else None,
        "where": None if row.get("where") is None else f"{row['where']:.3f}",
        "verdict": row.get("verdict"),
        "why": _because(row) if "bound" in row else row.get("allowed_because"),
    }


def _words(row: dict[str, Any]) -> tuple[str, str]:
    name = str(row.get("quantity", "?"))
    return QUANTITIES.get(name, (name.replace("_", " ").capitalize(), ""))


def _both(ratio: float | None, kind: str, of: dict[str, tuple[float, str, str]]) -> Markup | str | None:
    """Return a ratio in percent and in its unit."""
    if ratio is None or kind not in of:
        return None if ratio is None else percent(ratio, 3)
    return Markup("{} <small>{}</small>").format(percent(ratio, 3), _quantity(ratio * of[kind][0], of[kind][1]))


def _because(row: dict[str, Any]) -> Markup | str:
    """Return the reason in a line, the whole of it folded beneath."""
    bound = Bound.of(row["bound"])
    # a law's defect is zero for the exact answer: what counts is how much of it each error may explain
    parts = [part for part in bound.parts if part.value > 0.01 * bound.sum]
    law = bound.kind == "law" and parts and bound.tol is None
    short = " + ".join(f"{part.name} {percent(part.value)}" for part in parts) if law else bound.line(percent)
    return details(short, Markup("<p>{}</p>").format(_formula(str(bound)))) if bound.parts else short


def _formula(text: str) -> Markup:
    """Return text with 2^1.5 - 1 set as a formula."""
    return Markup(re.sub(r"(\d)\^([\d.]+)", r"\1<sup>\2</sup>", str(escape(text))).replace(" - ", " − "))


def _headline(x: Stored) -> str:
    """Return the verdict in a few sentences of plain text that need no table."""
    if not x.rows:
        return "No verdict: the check did not finish."
    bad = [row for row in x.rows if row.get("verdict") == "disagree" and not row.get("with")]
    apart = [_disagreement(x, row) for row in bad if row.get("quantity") not in (*LAWS, "path_max")]
    broken = [_disagreement(x, row) for row in bad if row.get("quantity") in LAWS]
    row, size = x.row("path_max"), x.scale.path_scale
    gap, allowed = row.get("gap"), row.get("allowed")
    path = {"gap": gap, "why": row.get("allowed_because", "no reason was stored"), "verdict": row.get("verdict")}
    if gap is None or allowed is None:
        path["gap"] = None
    else:
        digits = 2 if percent(gap) != percent(allowed) else 4
        of = f"{_quantity(gap * size, 'm')} of {_quantity(size, 'm')}"
        far = f"{percent(gap, digits)} of {x.scale.path_scale_named} ({of})"
        path |= {"far": far, "allowed": percent(allowed, digits), "tol": percent(x.tol)}
    return plain(_SAY.headline(apart, broken, path, [_third(x, name) for name in x.parties]))


def _disagreement(x: Stored, row: dict[str, Any]) -> str:
    name, kind = _words(row)
    name = ": ".join(part for part in (name, row.get("law")) if part)
    of = f" of the {_references(x)[kind][2]}" if kind else ""
    return f"{name[0].lower() + name[1:]} {percent(row.get('gap'), 3)}{of}, allowed {percent(row.get('allowed'), 3)}"


def _third(x: Stored, party: str) -> dict[str, Any]:
    rows = [row for row in x.rows if row.get("with") == party]
    row = min(rows, key=lambda row: list(VERDICTS).index(row["verdict"]) if row.get("verdict") in VERDICTS else 1)
    name = _words(row)[0]
    gap = None if row.get("gap") is None else percent(row["gap"])
    return {
        "name": party, "verdict": row["verdict"], "words": name[0].lower() + name[1:], "gap": gap,
        "allowed": percent(row.get("allowed")),
    }  # fmt: skip


def _facts(s: Solver, x: Stored) -> dict[str, str]:
    r = s.run
    i = int(np.argmax(r.v))
    at = float(r.s_o[i] / r.length)
    bar = r.path_error and r.path_error * r.path_scale if x.window[0] <= at <= x.window[1] else None
    if x.free:  # most of the path's bar is along the cable
        bar = next((row["bar"] for row in r.design if row["quantity"] == "mass_deflection_max"), None)
    deflection = _set(with_bar(r.max_deflection, bar))
    slack = "never"
    if r.slack_onset is not None:
        first = "" if r.slack_at is None else f", first at s/l = {r.slack_at:.3f}"
        slack = f"from sₒ/l = {r.slack_onset:.3f} on (t = {x.time(r, r.slack_onset):.4g} s){first}"
    law = {"elastic": "elastic, in compression too", "tension-only": "tension only"}.get(r.law, "elastic")
    if r.switched is not None:
        law += f"; tension only from sₒ/l = {r.switched:.3f} on"
    end = f"sₒ/l = {r.reached:.3f} (t = {r.t[-1]:.4g} s)"
    end += ", complete" if r.status == "complete" else f", where it stopped: {r.reason}"
    return {
        "solver": s.name, "deflection": f"{deflection} m, at sₒ/l = {at:.3f} (t = {r.t[i]:.4g} s)", "slack": slack,
        "law": law, "end": end,
    }  # fmt: skip


def _parting(x: Stored) -> Reach | None:
    """Return where past the compared range both paths part, or by how much they differ up to the end."""
    if len(x.solvers) < 2 or x.free or not x.window[1] > x.window[0]:
        return None
    a, b = (s.compared for s in x.solvers)
    return reach(a, b, x.window[1], x.row("path_max").get("allowed"))


# --- both answers ---------------------------------------------------------------------------------------------------


def _path(x: Stored) -> Section:
    rows = [("down v", "m", lambda r: r.v), ("to the right u", "m", lambda r: r.u)]
    figures = gallery(
        draw.paths(x, _SAY.paths(x)),
        draw.series(x, rows, _SAY.deflections(x), height=152.0),
    )
    alone = "" if len(x.solvers) > 1 else f"Only {x.names} has an answer here: there is nothing to compare it with."
    return Section("check-path", "Mass path", figures, None, alone)


def _ride(x: Stored) -> Section:
    r = x.solvers[0].run
    rows = [
        ("place on the cable", "m", lambda r: r.s_o), ("speed [km/h]", "km/h", lambda r: 3.6 * r.speed),
        ("depth down", "m", lambda r: r.y),
    ]  # fmt: skip
    forces = [("contact, across the cable", "N", lambda r: r.F_contact)]
    if np.isfinite(r.F_haul).any():
        forces.insert(0, ("from outside, along the cable", "N", lambda r: r.F_haul))
    heads = {"event": "event", "t": "time [s]", "s_o": "place sₒ [m]", "speed": "speed [m/s]", "kmh": "speed [km/h]"}
    html = [
        table(_events(x), heads, caption="What happens", stack=True) if x.events else Markup(""), _gripped(x),
        gallery(
            draw.series(x, rows, _SAY.motion(x), height=104.0),
            draw.series(x, forces, _SAY.forces(x), height=128.0),
            *([draw.gripped(x, _SAY.gripped(x))] if x.grip is not None else []),
            *([draw.energy_split(x, _SAY.split(r.method))] if np.isfinite(r.kinetic).any() else []),
        ),
    ]  # fmt: skip
    return Section("check-ride", "Ride", Markup("\n").join(html))


def _events(x: Stored) -> list[dict[str, str]]:
    """Return what happens on a ride, as text with bars."""
    events = []
    for e in x.events:
        t, s_o, speed = (e.get(f"bar_{key}") for key in ("t", "s_o", "speed"))
        events.append({
            "event": e["event"].replace("_", " "), "t": _set(with_bar(e["t"], t)),
            "s_o": _set(with_bar(e["s_o"], s_o)), "speed": _set(with_bar(e["speed"], speed)),
            "kmh": _set(with_bar(3.6 * e["speed"], speed and 3.6 * speed)),
        })  # fmt: skip
    return events


def _gripped(x: Stored) -> Markup:
    """Return the design numbers of a rolling car beside those of one that grips."""
    if x.grip is None:
        return Markup("")
    other = {d["quantity"]: d["value"] for d in x.grip.design}
    rows = []
    for d in x.design:
        if d["quantity"] in other and d["value"]:
            factor, unit = scale_of(np.array([d["value"]]), d["unit"])
            rows.append({
                "what": named(d["quantity"]), "rolls": _set(told(d, x.scene.length)["value"]),
                "grips": f"{number(factor * other[d['quantity']], 4)} {unit}",
                "off": percent(other[d["quantity"]] / d["value"] - 1.0),
            })  # fmt: skip
    heads = {"what": "quantity", "rolls": "rolling", "grips": "gripping", "off": "off by"}
    return table(rows, heads, caption="What a car that grips the cable would say")


def _motion(x: Stored) -> list[Section]:
    moving = [s for s in x.solvers if s.compared.fields.t.size > 1]
    if not moving:
        return []
    reached = max(s.compared.fields.s_o.max() / s.compared.length for s in moving)
    places = [p for p in (0.1, 0.3, 0.5, 0.7, 0.9) if p <= reached + 1e-6] or [0.0]
    shown = player(x.scene, [s.compared for s in moving], window=x.window, range_T=draw.tension_range(moving, x.window))
    still = gallery(draw.snapshots(x.scene, moving, places, _SAY.snapshots()))
    return [Section("check-motion", "The cable in motion", shown + still, scripts=(SCRIPT,))]


def _tension(x: Stored) -> Section:
    fields = [s for s in x.solvers if s.compared.fields.t.size > 1]
    lost, figures = Markup(""), []
    if fields:
        try:
            figures.append(draw.tension_fields(x, fields, _SAY.fields(x, measures.JUMP_WIDTH)))
        except NotComparable as reason:
            lost = callout(f"The difference of the tension fields: {reason}.", "not comparable")
    rows = [
        ("behind the mass", "N", lambda r: r.T_behind), ("ahead of the mass", "N", lambda r: r.T_ahead),
        ("least in the cable", "N", lambda r: r.tension_min),
    ]  # fmt: skip
    figures.append(draw.series(x, rows, _SAY.at_mass(x), height=120.0, bands=True))
    return Section("check-tension", "Tension", lost + gallery(*figures))


def _laws(x: Stored) -> Section:
    held = [row for row in x.rows if row.get("quantity") in LAWS]
    figures = [draw.energy(x, _SAY.energy(x))]
    r = x.solvers[0].run
    if np.isfinite(r.contact).any():
        rows = [("contact force of the mass", "N", lambda r: r.F_contact)]
        for side in ("left", "right"):
            if np.isfinite(getattr(r, f"reaction_{side}")).any():
                rows.append((f"{side} support", "N", partial(_size, f"reaction_{side}")))
        figures.append(draw.series(x, rows, _SAY.contact(x), height=104.0))
    return Section(
        "check-laws", "Laws of mechanics",
        Markup("\n").join([Markup(_SAY.laws()), _rows(x, held) if held else Markup(""), gallery(*figures)]),
    )  # fmt: skip


def _size(name: str, r: Response) -> Array:
    return np.hypot(*getattr(r, name).T)


# --- where it comes from --------------------------------------------------------------------------------------------


def _refinement(x: Stored) -> Section:
    rows: list[dict[str, Any]] = []
    refused = []
    for s in x.solvers:
        for k, (companion, key) in enumerate(((s.in_space, _resolution(s.run)), (s.in_time, "steps"))):
            if companion is None or s.weights is None:
                continue
            name = f"{s.name}, {key} {companion.settings.get(key)} for {s.run.settings.get(key)}"
            try:
                rows.append({"run": name, **_bars(s.run, companion, s.weights[k])})
            except NotComparable as reason:
                refused.append(callout(f"{name}: {reason}.", "not comparable"))
        if s.run.path_error is not None:
            rows.append({
                "run": Markup("<strong>{}, error bar</strong>").format(s.name), "path": "", "weight": "", "tension": "",
                "path_bar": Markup("<strong>{}</strong>").format(percent(s.run.path_error)),
                "tension_bar": Markup("<strong>{}</strong>").format(percent(s.run.tension_error)),
            })  # fmt: skip
    heads = {
        "run": "run", "path": "path, largest gap", "weight": "weight", "path_bar": "bar of the path",
        "tension": "tension, rms gap", "tension_bar": "bar of the tension",
    }  # fmt: skip
    compared = any(s.in_space is not None or s.in_time is not None for s in x.solvers)
    html = [
        table(rows, heads) if rows else Markup(""), *refused,
        Markup(_SAY.bars([(s.name, _formula(s.basis)) for s in x.solvers if s.basis], x.scale.path_scale_named)),
        gallery(draw.refinement(x, _SAY.refinement(x))) if compared else Markup(""),
    ]  # fmt: skip
    return Section("check-refinement", "Error bars", Markup("\n").join(html))


def _bars(run: Response, companion: Response, weight: float) -> dict[str, str]:
    window = measures.window_of(run, companion)
    path = measures.path_gap(companion, run, window)[0]
    tension = measures.tension_gap(companion, run, window)
    return {
        "path": percent(path), "weight": number(weight, 2), "path_bar": percent(weight * path),
        "tension": percent(tension), "tension_bar": percent(weight * tension),
    }  # fmt: skip


def _resolution(r: Response) -> str:
    return METHODS[r.method].resolution.setting if r.method in METHODS else "resolution"


def _provenance(x: Stored) -> Section:
    work = [
        {
            "run": f"{s.name}, {run}", "resolution": _shown(r.settings.get(_resolution(r), "–")),
            "asked": r.settings.get("steps"), "n_dof": r.n_dof, **r.work, "seconds": r.seconds,
        }
        for s in x.solvers
        for run, r in (("finest", s.run), ("half resolution", s.in_space), ("half steps", s.in_time))
        if r is not None
    ]  # fmt: skip
    heads = {
        "run": "run", "resolution": "elements or terms", "n_dof": "unknowns", "asked": "steps asked",
        "steps": "steps taken", "rejected": "steps rejected", "newton_iterations": "Newton iterations",
        "factorisations": "factori\u00adsations", "residuals": "residuals", "seconds": "time [s]",
    }  # fmt: skip
    html = [
        _scene(x), details("Scene file (TOML)", Markup("<pre>{}</pre>").format(x.scene.to_toml())),
        Markup("<h3>Runs and their work</h3>"),
        table(work, {key: head for key, head in heads.items() if any(key in row for row in work)}),
        *(_settings(s.run) for s in x.solvers), Markup(_SAY.shared()),
        table([{"what": what, "how": how} for what, how in SHARED], {"what": "shared", "how": "checked on its own by"}),
        Markup("<p><small>Page drawn with {}.</small></p>").format(_versions()),
    ]  # fmt: skip
    return Section("check-runs", "Scene, settings and work", Markup("\n").join(html))


def _scene(x: Stored) -> Markup:
    scene = x.scene
    assert scene.mass is not None
    drop = scene.supports.drop
    facts = {
        "span": f"{scene.supports.span:.6g} m",
        "right support": "level with the left one" if not drop
        else f"{abs(drop):.6g} m {'below' if drop > 0 else 'above'} the left one",
        "length of the cable l": f"{scene.length:.6g} m",
        "sag at rest": f"{scene.sag:.4g} m, {percent(scene.sag_ratio)} of the span",
        "horizontal tension at rest H": _quantity(scene.horizontal_tension, "N", 4),
        "mass of the cable per length ρ": f"{scene.cable.mass_per_length:.4g} kg/m",
        "axial stiffness EA": _quantity(scene.cable.EA, "N", 4),
        "moving mass M": f"{scene.mass.mass:.6g} kg",
        "drive": x.solvers[0].run.drive,
        **({} if scene.travel is None else {
            "travel": f"{scene.travel.kind.replace('_', ' ')}, up to {scene.top_speed:.4g} m/s "
            f"({3.6 * (scene.top_speed or 0.0):.3g} km/h), {percent(scene.speed_ratio)} of that of transverse waves",
        }),
        "moving mass over cable μ = M/(ρl)": f"{scene.mu:.4g}",
        "stiffness α = EA/H": f"{scene.alpha:.4g}",
        "weight of the cable σ = ρgl/H": f"{scene.sigma:.4g}",
        "Irvine’s parameter L²": f"{scene.irvine:.4g}",
    }  # fmt: skip
    return table([{"what": what, "value": value} for what, value in facts.items()], {"what": "scene", "value": "value"})


_KINDS = {
    "model": "of the cable; full: u and v everywhere",
    "load": "mass: with its inertia, force: its weight alone",
    "law": "of the cable; auto: elastic until it goes slack, tension only from there on",
}


def _settings(r: Response) -> Markup:
    method = METHODS.get(r.method)
    known = _KINDS | ({} if method is None else {name: knob.meaning for name, knob in method.knobs.items()})
    used = {**r.settings, "model": r.model, "load": r.load, "law": r.law}
    rows = [{"name": name, "value": _shown(value), "meaning": known.get(name, "")} for name, value in used.items()]
    title = f"Settings of {r.method}" + ("" if method is None else f": {method.title}")
    return details(title, table(rows, {"name": "setting", "value": "value", "meaning": "meaning"}))


def _shown(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _versions() -> str:
    found = [f"Python {platform.python_version()}"]
    for package in ("cablefem", "numpy", "scipy", "scikit-fem", "numba", "matplotlib"):
        try:
            found.append(f"{package} {metadata.version(package)}")
        except metadata.PackageNotFoundError:
            continue
    return ", ".join(found)
