"""Pages about a check: the verdict first, then both answers side by side, then where they come from.

Read from the folder that `study.Check.write` wrote; what is missing there is named, the rest shown.
"""

from __future__ import annotations

import math
import platform
import re
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup, escape

from cablefem.response import Response
from validation.commands.check import figures as draw
from validation.commands.check.figures import place, pointwise, scale_of
from validation.commands.check.shared import SHARED
from validation.core import measures
from validation.core.bounds import Bound
from validation.core.measures import NotComparable
from validation.core.methods import METHODS
from validation.page.page import Section, callout, details, figure, gallery, missing, number, percent, table
from validation.page.player import SCRIPT, player
from validation.page.stored import Solver, Stored, read

# quantity of a row -> what it is, and what its gap is a ratio of
QUANTITIES = {
    "path_max": ("Mass path, largest distance", "deflection"),
    "path_rms": ("Mass path, rms distance", "deflection"),
    "path_slack": ("Mass path past the slack onset, largest distance", "deflection"),
    "tension": ("Tension along the cable, rms off the mass", "tension"),
    "tension_behind": ("Tension just behind the mass, rms", "tension"),
    "tension_ahead": ("Tension just ahead of the mass, rms", "tension"),
    "reactions": ("Forces of both supports, rms", "tension"),
    "displacement": ("Displacement field, rms of its own", ""),
    "velocity": ("Velocity across the cable, rms of its own, over fifths of it", ""),
    "slack_onset": ("Slack onset, in sₒ/l", ""),
    "impulse": ("Momentum of the mass by the cable's pull, rms defect over windows", "weight"),
    "laws_si": ("Mechanics in SI", ""),
    "energy": ("Energy balance, rms defect", "work"),
}


def sections(folder: Path) -> list[Section]:
    """Return the pages about the check stored in a folder; a folder without any answer gives one that says so."""
    faults: list[str] = []
    x = read(folder, faults)
    gone = Markup("").join(missing(fault, "What depends on it is left out below.") for fault in faults)
    if x is None:
        text = "No verdict: the folder holds no finished answer of any solver."
        return [Section("check-verdict", "Verdict", gone, "not comparable", text)]
    return [_verdict(x, gone), _path(x), *_motion(x), _tension(x), _laws(x), _refinement(x), _provenance(x)]


# --- the verdict ----------------------------------------------------------------------------------------------------


def _references(x: Stored) -> dict[str, tuple[float, str, str]]:
    """Return what gaps are ratios of: value, unit, words."""
    return {
        "deflection": (x.deflection, "m", "largest deflection"),
        "tension": (x.scene.horizontal_tension, "N", "horizontal tension H at rest"),
        "weight": (x.weight, "N", "weight M g of the mass"),
        "work": (x.weight * x.deflection, "J", "weight times the largest deflection"),
    }


def _quantity(value: float, unit: str, digits: int = 3) -> str:
    factor, name = scale_of(np.array([value]), unit)
    return f"{number(factor * value, digits)}\u202f{name}"


def _verdict(x: Stored, gone: Markup) -> Section:
    of = _references(x)
    html = [gone]
    if x.rows:
        heads = {
            "quantity": "quantity", "verdict": "verdict", "gap": "gap", "allowed": "allowed", "used": "gap / allowed",
            "where": "largest at sₒ/l", "why": "allowed because of",
        }  # fmt: skip
        told = (f"{words} {_quantity(value, unit)}" for value, unit, words in of.values())
        html += [
            table([_row(row, of) for row in x.rows], heads, sort=True, stack=True),
            Markup(
                "<p><small>Percent of: {} (mass path); {} (tension); {} (force jump); {} (energy). rms: root mean "
                "square over the compared range.</small></p>"
            ).format(*told),
        ]
    html += [Markup("<h3>How far the answer goes</h3>"), _reach(x)]
    return Section("check-verdict", "Verdict", Markup("\n").join(html), x.verdict, _headline(x))


def _row(row: dict[str, Any], of: dict[str, tuple[float, str, str]]) -> dict[str, Any]:
    words, kind = _words(row)
    gap, allowed = row.get("gap"), row.get("allowed")
    return {
        "quantity": f"{words}: {row['with']}" if row.get("with") else words,
        "gap": _both(gap, kind, of),
        "allowed": _both(allowed, kind, of),
        "used": number(gap / allowed, 2) if gap is not None and allowed else None,
        "where": None if row.get("where") is None else f"{row['where']:.3f}",
        "verdict": row.get("verdict"),
        "why": _because(row) if "bound" in row else row.get("allowed_because"),
    }


def _words(row: dict[str, Any]) -> tuple[str, str]:
    name = str(row.get("quantity", "?"))
    words, kind = QUANTITIES.get(name, (name.replace("_", " "), ""))
    return (f"{words}: {row['law']}" if row.get("law") and name != "impulse" else words), kind


def _both(ratio: float | None, kind: str, of: dict[str, tuple[float, str, str]]) -> Markup | str | None:
    """Return a ratio in percent and in its unit."""
    if ratio is None or kind not in of:
        return None if ratio is None else percent(ratio, 3)
    return Markup("{} <small>{}</small>").format(percent(ratio, 3), _quantity(ratio * of[kind][0], of[kind][1]))


def _because(row: dict[str, Any]) -> Markup | str:
    """Return the reason in a line, the whole of it folded beneath."""
    bound = Bound.of(row["bound"])
    whole = str(bound)
    short = bound.line(percent)
    return short if len(bound.parts) == 0 else details(short, Markup("<p>{}</p>").format(_formula(whole)))


def _formula(text: str) -> Markup:
    """Return text with 2^1.5 - 1 set as a formula."""
    raised = re.sub(r"(\d)\^([\d.]+)", r"\1<sup>\2</sup>", str(escape(text)))
    return Markup(raised.replace(" - ", " − "))


def _headline(x: Stored) -> str:
    """Return the verdict in a few sentences of plain text that need no table."""
    if not x.rows:
        return "No verdict: the check did not finish."
    apart = "; ".join(
        _disagreement(x, row) for row in x.rows
        if row.get("verdict") == "disagree" and row.get("quantity") != "path_max" and not row.get("with")
    )  # fmt: skip
    out = [f"The solvers disagree: {apart}."] if apart else []
    out.insert(0 if x.row("path_max").get("verdict") == "disagree" else len(out), _path_line(x))
    for party in dict.fromkeys(row["with"] for row in x.rows if row.get("with")):
        out.append(_third(str(party), [row for row in x.rows if row.get("with") == party]))
    return " ".join(out)


def _path_line(x: Stored) -> str:
    row, size = x.row("path_max"), x.deflection
    gap, allowed = row.get("gap"), row.get("allowed")
    if gap is None or allowed is None:
        return f"The mass paths cannot be compared: {row.get('allowed_because', 'no reason was stored')}."
    digits = 2 if percent(gap) != percent(allowed) else 4
    far = f"{percent(gap, digits)} of the largest deflection ({_quantity(gap * size, 'm')} of {_quantity(size, 'm')})"
    if row["verdict"] == "agree":
        return (
            f"Both solvers give the same mass path: they differ by at most {far}; their error bars allow "
            f"{percent(allowed, digits)}."
        )
    if row["verdict"] == "disagree":
        return (
            f"The solvers disagree on the mass path: they differ by up to {far}, but their error bars allow only "
            f"{percent(allowed, digits)}. One of them is wrong, or its error bar is too small."
        )
    return (
        f"No verdict on the mass path: the solvers differ by {far}, but their error bars, {percent(allowed, digits)}, "
        f"are wider than the tolerance {percent(x.tol)} asked for."
    )


def _disagreement(x: Stored, row: dict[str, Any]) -> str:
    words, kind = _words(row)
    of = f" of the {_references(x)[kind][2]}" if kind else ""
    return f"{words[0].lower() + words[1:]} {percent(row.get('gap'), 3)}{of}, allowed {percent(row.get('allowed'), 3)}"


def _third(party: str, rows: list[dict[str, Any]]) -> str:
    order = ("disagree", "not comparable", "too coarse", "agree")
    row = min(rows, key=lambda row: order.index(row["verdict"]) if row.get("verdict") in order else 1)
    says = {"agree": "agrees with them", "disagree": "disagrees with them"}.get(row["verdict"], "cannot be compared")
    if row.get("gap") is None:
        return f"{party} {says}."
    words = _words(row)[0]
    return (
        f"{party} {says} ({words[0].lower() + words[1:]} {percent(row['gap'])}, allowed {percent(row.get('allowed'))})."
    )


def _reach(x: Stored) -> Markup:
    """Say where each answer ends, where it stops being meaningful, and over what range the solvers were compared."""
    r, (low, high) = x.solvers[0].run, x.window
    if len(x.solvers) < 2:
        words = [f"Only {x.names} has an answer: there is nothing to compare it with."]
    elif high > low:
        words = [
            f"The solvers are compared over sₒ/l = {low:.3g} to {high:.3g}, t = {_time(r, low):.3g} to "
            f"{_time(r, high):.4g} s."
        ]
    else:
        words = ["The answers share no range in which they could be compared."]
    if x.onset is not None:
        words.append(
            f"From sₒ/l = {x.onset:.3f} on the cable is slack somewhere. An elastic law has no unique answer there; "
            "what follows, by a law that carries no compression, is an indication and not a result."
        )
    elif high > low:
        words.append(
            f"The cable stays taut. Past sₒ/l = {high:.3g} the mass comes near the far support, where its force grows "
            "like one over the distance; the answers go on, but are not judged there."
        )
    heads = {
        "solver": "solver", "deflection": "largest deflection of the mass",
        "tension": f"largest tension, sₒ/l ≤ {high:.3g}", "slack": "cable slack", "law": "law of the cable",
        "end": "computed up to",
    }  # fmt: skip
    bars = figure(
        draw.reach(x),
        f"Full colour: {_judged(x)}. Pale: computed, but not {_judged(x)}."
        + ("" if x.onset is None else " Cross: the cable goes slack."),
        label="Bars over the place of the mass: how far each solver got, what is compared, where the cable goes slack.",
    )
    facts = table([_facts(s, x) for s in x.solvers], heads, stack=True)
    return Markup("\n").join([callout(" ".join([*words, _parting(x)])), facts, gallery(bars)])


def _facts(s: Solver, x: Stored) -> dict[str, str]:
    r, f = s.run, s.compared.fields
    at = float(place(r)[np.argmax(r.v)])
    deflection = f"{number(r.max_deflection, 5)} m"
    if r.path_error and x.window[0] <= at <= x.window[1]:
        error = r.path_error * r.max_deflection
        digits = max(0, 1 - math.floor(math.log10(error)))
        deflection = f"{r.max_deflection:.{digits}f} ± {error:.{digits}f} m"
    slack = "never"
    if r.slack_onset is not None:
        first = "" if r.slack_at is None else f", first at s/l = {r.slack_at:.3f}"
        slack = f"from sₒ/l = {r.slack_onset:.3f} on (t = {_time(r, r.slack_onset):.4g} s){first}"
    law = {"elastic": "elastic, in compression too", "tension-only": "tension only"}.get(r.law, "elastic")
    if r.switched is not None:
        law += f"; tension only from sₒ/l = {r.switched:.3f} on"
    end = f"sₒ/l = {r.reached:.3f} (t = {r.t[-1]:.4g} s)"
    end += ", complete" if r.status == "complete" else f", where it stopped: {r.reason}"
    inside = f.s_o <= x.window[1] * r.length
    return {
        "solver": s.name, "deflection": f"{deflection}, at sₒ/l = {at:.3f} (t = {_time(r, at):.4g} s)",
        "tension": _quantity(float(f.T[inside].max()), "N", 4) if inside.any() else "–", "slack": slack, "law": law,
        "end": end,
    }  # fmt: skip


def _parting(x: Stored) -> str:
    """Say how far past the compared range both paths are still one path."""
    bound = 10.0 * (x.row("path_max").get("allowed") or x.tol or 0.0)
    if len(x.solvers) < 2 or not x.window[1] > x.window[0] or bound == 0.0:
        return ""
    at, gap = pointwise(x.solvers[0].compared, x.solvers[1].compared)
    past = at > x.window[1]
    far = past & (gap > bound * x.deflection)
    if far.any():
        return f"At sₒ/l = {at[far][0]:.3f} the two paths part by more than {percent(bound)} of the largest deflection."
    if past.any():
        most = percent(float(gap[past].max()) / x.deflection)
        return f"Up to sₒ/l = {at[-1]:.3f} the two paths differ by at most {most} of the largest deflection."
    return ""


def _time(r: Response, at: float) -> float:
    return float(np.interp(at, place(r), r.t))


# --- both answers ---------------------------------------------------------------------------------------------------


def _judged(x: Stored) -> str:
    return "compared" if len(x.solvers) > 1 else "given an error bar"


def _note(x: Stored) -> str:
    """Return what the shading and the vertical line of a figure mean."""
    return f"Grey: not {_judged(x)}." + ("" if x.onset is None else " Dotted vertical line: slack onset.")


def _path(x: Stored) -> Section:
    both = len(x.solvers) > 1
    beneath = (
        " Beneath, in percent of the largest deflection v, the distance of the two paths (black) and the error bar of "
        "each solver at the same place; the verdict asks that the black line stay below the green one, the sum of both "
        "largest bars."
    )
    figures = gallery(
        figure(
            draw.paths(x),
            f"Depth of the mass below the left support.{beneath if both else ''} {_note(x)}",
            label=f"Depth of the mass below the left support over its place on the cable, by {x.names}, with the cable "
            "at rest" + ("; beneath, the distance of both paths and their error bars." if both else "."),
        ),
        figure(
            draw.deflections(x),
            f"Deflection of the mass from its place on the cable at rest: v down, u to the right. {_note(x)}",
            label=f"Deflections v and u of the mass over its place on the cable, by {x.names}.",
        ),
    )
    alone = "" if both else f"Only {x.names} has an answer here: there is nothing to compare it with."
    return Section("check-path", "Mass path", figures, None, alone)


def _motion(x: Stored) -> list[Section]:
    moving = [s for s in x.solvers if s.compared.fields.t.size > 1]
    if not moving:
        return []
    reached = max(s.compared.fields.s_o[-1] / s.compared.length for s in moving)
    places = [p for p in (0.1, 0.3, 0.5, 0.7, 0.9) if p <= reached + 1e-6] or [0.0]
    cable, tension = draw.snapshots(x.scene, moving, places)
    still = gallery(
        figure(
            cable,
            "The cable at a few times, below the straight line between its supports; depths are stretched.",
            label=f"The cable with the mass at {len(places)} times, by {x.names}.",
        ),
        figure(
            tension,
            "Tension along it at the same times, with its jump at the mass; each panel has a scale of its own.",
            label=f"Tension along the cable at {len(places)} times, by {x.names}.",
        ),
    )
    shown = player(x.scene, [s.compared for s in moving], window=x.window, range_T=draw.tension_range(moving, x.window))
    return [Section("check-motion", "The cable in motion", shown + still, scripts=(SCRIPT,))]


def _tension(x: Stored) -> Section:
    fields = [s for s in x.solvers if s.compared.fields.t.size > 1]
    slack = "" if x.onset is None else " Dotted line: slack onset."
    lost, figures = Markup(""), []
    if fields:
        try:
            figures.append(figure(
                draw.tension_fields(fields, x.window, x.onset),
                "Tension over time and place. Slanted line: the mass. Dashed line: end of the compared range."
                f"{slack} Both solvers on one scale of colours, set by the compared range. Differences within "
                f"{measures.JUMP_WIDTH:g} l of the mass come from how each resolves the jump and are not judged.",
                label=f"Tension along the cable over time, by {x.names}, and the difference.",
            ))  # fmt: skip
        except NotComparable as reason:
            lost = missing("the difference of the tension fields", f"{reason}.")
    later = "" if x.onset is None else " Values after it may leave the frame."
    figures.append(figure(
        draw.tension_at_mass(x),
        f"Tension just behind and just ahead of the mass, and the least anywhere. {_note(x)}{later}",
        label=f"Tension behind and ahead of the mass and least tension over the place of the mass, by {x.names}.",
    ))  # fmt: skip
    return Section("check-tension", "Tension", lost + gallery(*figures))


def _laws(x: Stored) -> Section:
    text = Markup(
        "<p>Two laws hold whatever the method, and neither solver uses them in this form: energy grows by the work of "
        "the drive, and the cable pulls at the mass with its weight and inertia. They convict a solver even where both "
        "agree.</p>"
    )
    figures = gallery(
        figure(
            draw.energy(x),
            "Energy of cable and mass since entry, and the work put in. Beneath, their difference in percent of the "
            f"weight M g times the largest deflection v. {_note(x)}",
            label=f"Energy balance over the place of the mass, by {x.names}.",
        ),
        figure(
            draw.jump(x),
            "Vertical force between cable and mass: from the tensions, slopes and momentum of the cable on both sides, "
            "and from the acceleration of the mass. Beneath, the size of their difference in percent of the weight "
            f"M g. {_note(x)}",
            label=f"Force between cable and mass over the place of the mass, by {x.names}.",
        ),
    )
    return Section("check-laws", "Laws of mechanics", text + figures)


# --- where it comes from --------------------------------------------------------------------------------------------


def _refinement(x: Stored) -> Section:
    rows: list[dict[str, Any]] = []
    figures, refused = [], []
    for i, s in enumerate(x.solvers):
        words = tuple(_coarser(s, key) for key in (_resolution(s.run), "steps"))
        for k, companion in enumerate((s.in_space, s.in_time)):
            if companion is None or s.weights is None:
                continue
            try:
                rows.append({"run": f"{s.name}, {words[k]}", **_bars(s.run, companion, s.weights[k])})
            except NotComparable as reason:
                refused.append(callout(f"{s.name}, {words[k]}: {reason}.", "not comparable"))
        if s.run.path_error is not None:
            rows.append({
                "run": Markup("<strong>{}, error bar</strong>").format(s.name), "path": "", "weight": "", "tension": "",
                "path_bar": Markup("<strong>{}</strong>").format(percent(s.run.path_error)),
                "tension_bar": Markup("<strong>{}</strong>").format(percent(s.run.tension_error)),
            })  # fmt: skip
        if s.in_space is not None or s.in_time is not None:
            figures.append(figure(
                draw.refinement(s, i, x, words),
                f"{s.name}: distance of its mass path to those of its two coarser companions, in percent of the "
                f"largest deflection v. {_note(x)}",
                label=f"Distance of the mass path of {s.name} to those of its coarser companions.",
            ))  # fmt: skip
    heads = {
        "run": "run", "path": "path, largest gap", "weight": "weight", "path_bar": "bar of the path",
        "tension": "tension, rms gap", "tension_bar": "bar of the tension",
    }  # fmt: skip
    text = Markup(
        "<p>Each solver ran twice more, with half the resolution and with half the steps. Its error bar is what these "
        "gaps leave in the finest run by the order at which they shrink: weight × gap, space and time added. Percent "
        "of the largest deflection (path) and of the horizontal tension H (tension).</p>"
    )
    bases = Markup("").join(Markup("<li>{}: {}</li>").format(s.name, _formula(s.basis)) for s in x.solvers if s.basis)
    html = [
        text, table(rows, heads) if rows else Markup(""), *refused,
        Markup("<p>Where the weights come from:</p><ul>{}</ul>").format(bases) if bases else Markup(""),
        gallery(*figures),
    ]  # fmt: skip
    return Section("check-refinement", "Error bars", Markup("\n").join(html))


def _coarser(s: Solver, key: str) -> str:
    companion = s.in_time if key == "steps" else s.in_space
    if companion is None or key not in companion.settings:
        return f"half the {key}"
    return f"half the {key}: {companion.settings[key]} for {s.run.settings[key]}"


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
            "run": f"{s.name}, {words}", "resolution": _shown(r.settings.get(_resolution(r), "–")),
            "asked": r.settings.get("steps"), "n_dof": r.n_dof, **r.work, "seconds": r.seconds,
        }
        for s in x.solvers
        for words, r in (("finest", s.run), ("half resolution", s.in_space), ("half steps", s.in_time))
        if r is not None
    ]  # fmt: skip
    heads = {
        "run": "run", "resolution": "elements or terms", "n_dof": "unknowns", "asked": "steps asked",
        "steps": "steps taken", "rejected": "steps rejected", "newton_iterations": "Newton iterations",
        "factorisations": "factori\u00adsations", "residuals": "residuals", "seconds": "time [s]",
    }  # fmt: skip
    html = [
        Markup("<h3>{}</h3>").format(x.scene.title or x.scene.name), _scene(x),
        details("Scene file (TOML)", Markup("<pre>{}</pre>").format(x.scene.to_toml())),
        Markup("<h3>Runs and their work</h3>"),
        table(work, {key: head for key, head in heads.items() if any(key in row for row in work)}),
        *(_settings(s.run) for s in x.solvers),
        Markup("<h3>What both solvers share</h3><p>A fault in these would not show as a gap between them.</p>"),
        table([{"what": what, "how": how} for what, how in SHARED], {"what": "shared", "how": "checked on its own by"}),
        Markup("<p><small>Page drawn with {}.</small></p>").format(_versions()),
    ]  # fmt: skip
    return Section("check-runs", "Scene, settings and work", Markup("\n").join(html))


def _scene(x: Stored) -> Markup:
    scene = x.scene
    assert scene.mass is not None
    assert scene.travel is not None
    facts = {
        "span": f"{scene.supports.span:.6g} m",
        "right support": f"{abs(scene.supports.drop):.6g} m "
        + ("below the left one" if scene.supports.drop >= 0 else "above the left one")
        if scene.supports.drop else "level with the left one",
        "length of the cable l": f"{scene.length:.6g} m",
        "sag at rest": f"{scene.sag:.4g} m, {percent(scene.sag_ratio)} of the span",
        "horizontal tension at rest H": _quantity(scene.horizontal_tension, "N", 4),
        "mass of the cable per length ρ": f"{scene.cable.mass_per_length:.4g} kg/m",
        "axial stiffness EA": _quantity(scene.cable.EA, "N", 4),
        "moving mass M": f"{scene.mass.mass:.6g} kg",
        "travel": f"{scene.travel.kind.replace('_', ' ')}, up to {scene.top_speed:.4g} m/s, "
        f"{percent(scene.speed_ratio)} of the speed of transverse waves",
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
