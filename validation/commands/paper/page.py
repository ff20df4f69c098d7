"""The page of `cablefem paper`: every claim with its verdict, then the paper's figures redone, from stored runs alone.

figures.toml holds its words and looks, and says which stored runs each figure shows.
"""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from cablefem.response import Response
from cablefem.scene import Scene
from validation.commands.paper.verdicts import FAILS, HOLDS, sentence
from validation.core import store
from validation.page.figures import panels, style
from validation.page.page import Section, badge, details, figure, gallery, number, table
from validation.page.plot import BLACK, BLUE, GREY

SAID = store.shipped(__package__, "figures.toml")
LOOKS: dict[str, dict[str, Any]] = SAID["looks"]
STATIC = LOOKS["static"] | {"label": "static"}
KIND = {HOLDS: "agree", FAILS: "disagree"}  # all else: not comparable

Shown = list[tuple[Response, dict[str, Any]]]  # runs and their looks


def sections(folder: Path) -> list[Section]:
    """Return the claims table and one section per figure."""
    content = store.read(folder / "claims.json")

    @cache
    def stored(name: str) -> Response:
        return Response.read(folder / "runs" / name)

    out = [_claims(content), _wu_and_chen(content)]
    for entry in SAID["section"]:
        figures = gallery(*(_figure(one, content, stored) for one in entry["figure"]))
        html, found = figures + _linked(content, entry["claims"]), ""
        if entry["id"] == "overshoot":
            html, found = html + _references(content), SAID["words"]["overshoot"]
        out.append(Section(entry["id"], entry["title"], html, None, found))
    return out


# --- tables ---------------------------------------------------------------------------------------------------------


def _claims(content: dict[str, Any]) -> Section:
    claims, errata = (
        table([_row(c) for c in content["claims"] if c["erratum"] is erratum], SAID["heads"]["claims"], stack=True)
        for erratum in (False, True)
    )
    more = Markup('<h3 id="errata">Formulas, errata and time integration</h3>')
    plural = {HOLDS: "hold", FAILS: "do not hold"}
    found = [f"{n} {plural.get(v, v.replace('holds', 'hold'))}" for v, n in content["count"].items() if n]
    summary = f"Of {sum(content['count'].values())} claims {', '.join(found)}."
    html = Markup("<p>{}</p>\n{}\n{}\n{}").format(SAID["words"]["claims"], claims, more, errata)
    return Section("claims", "Claims of the paper", html, None, summary)


def _row(claim: dict[str, Any]) -> dict[str, Any]:
    word = Markup("<br><em>or</em> " if claim["readings"] else "<br>")

    def each(make: Callable[[dict[str, Any]], Markup]) -> str:
        return word.join(make(q) for q in claim["quantities"]) or "–"

    return {
        "claim": Markup('<span id="claim-{}">{}</span><br><small>{}</small>').format(
            claim["id"], _symbols(claim["claim"]), claim["where"]
        ),
        "verdict_": _badge(claim),
        "allowed": each(lambda q: Markup("{}: {}").format(_symbols(q["name"]), q["claimed"])),
        "paper": each(lambda q: _value(q, q["paper"])),
        "converged": each(lambda q: _value(q, q["converged"], q["uncertainty"])),
        "why": _symbols(claim["why"]),
    }


def _badge(claim: dict[str, Any]) -> Markup:
    return badge(KIND.get(claim["verdict"], "not comparable"), claim["verdict"])


def _symbols(text: str) -> str:
    """Return the text with the paper's index."""
    return text.replace("s_o", "sₒ").replace("so/l", "sₒ/l").replace("s̈_o", "s̈ₒ")


def _value(q: dict[str, Any], x: float | None, bar: float | None = None) -> Markup:
    """Return a value with as many digits as its bar, or as the claim's range needs."""
    if x is None:
        return Markup("–")
    if bar is not None and bar > 1e-8 * abs(x) and abs(x) >= 1e-3:
        return _with_bar(x, bar)
    ends = [abs(x - e) for e in (q["low"], q["high"]) if e not in (None, x)]
    needed = np.log10(max(abs(x), 1e-300) / min(ends, default=1.0)) if x else 0.0
    text = number(x, int(np.clip(np.ceil(needed) + 2, 3, 8)))
    known = bar is None or bar <= 1e-8 * abs(x)
    return Markup("{}").format(text) if known else Markup("{} ± {}").format(text, number(bar, 1))


def _with_bar(x: float, bar: float) -> Markup:
    """Return 0.65127 ± 0.00001: down to the first digit of a small bar, the second of a large one, six at most."""
    decimals = int(np.clip(np.ceil(-np.log10(max(bar, 1e-6))) + (bar > 1e-3), 1, 6))
    shown = max(round(bar, decimals), 10.0**-decimals)
    return Markup('<span style="white-space:nowrap">{} ± {}</span>').format(
        f"{x:.{decimals}f}".replace("-", "−"), f"{shown:.{decimals}f}"
    )


def _linked(content: dict[str, Any], ids: list[str]) -> Markup:
    """Return the verdicts that belong to a figure, each with a link to its row."""
    found = {c["id"]: c for c in content["claims"]}
    items = [
        Markup('<li>{} <a href="#claim-{}">{}</a></li>').format(_badge(found[i]), i, _symbols(found[i]["claim"]))
        for i in ids if i in found
    ]  # fmt: skip
    return Markup("<ul>{}</ul>").format(Markup("\n").join(items)) if items else Markup()


def _wu_and_chen(content: dict[str, Any]) -> Section:
    turns = {"max": "lowest", "min": "highest (a maximum on the page)"}
    rows = [
        x | {"kind": turns[x["kind"]], "place": _with_bar(x["place"], x["uncertainty"])} for x in content["wu_and_chen"]
    ]
    html = Markup("<p>{}</p>\n{}\n{}").format(
        SAID["words"]["wu_and_chen"], table(rows, SAID["heads"]["turns"]),
        _linked(content, ["turn-at-0.655", "wu-chen-0.8", "factor-of-two"]),
    )  # fmt: skip
    found = {c["id"]: c for c in content["claims"]}["factor-of-two"]
    return Section("wu-and-chen", "The factor of two", html, None, f"The claim {found['verdict']}. {found['why']}")


def _references(content: dict[str, Any]) -> Markup:
    def run(x: dict[str, Any]) -> str:
        return "{method}, {elements} + {elements} elements, {steps} steps".format(**x["settings"], method=x["method"])

    rows = [x | {"scene": SAID["scenes"][name], "method": run(x)} for name, x in content["references"].items()]
    return details("What the converged values rest on", table(rows, SAID["heads"]["references"]))


# --- figures --------------------------------------------------------------------------------------------------------


def _figure(
    one: dict[str, Any], content: dict[str, Any], stored: Callable[[str], Response]
) -> Markup:  # fmt: skip
    def converged(claim: str, i: int = 0) -> float:
        return next(c for c in content["claims"] if c["id"] == claim)["quantities"][i]["converged"]

    runs = [(stored(name), LOOKS[look] | {"label": label}) for name, look, label in one.get("of", ())]
    caption = sentence(one["caption"], {"converged": converged, "overshoot": SAID["words"]["overshoot"]})
    with style():
        return figure(DRAWN[one["draw"]](one, content, runs), caption, label=one["label"])


def _frequencies(one: dict[str, Any], content: dict[str, Any], runs: Shown) -> Figure:
    f = content["frequencies"]
    fig, ax = panels(1, 1, height=3.0)
    ax.axhline(f["linear_theory"], **STATIC | {"label": f"linear theory {f['linear_theory']:.5f}"})
    ax.axhline(f["exact"], color=BLACK, linewidth=1.0, linestyle="-", label=f"exact catenary {f['exact']:.5f}")
    for name, how in _bases():
        ax.plot(f[name]["terms"], f[name]["omega_1"], "-", **how)
    ax.set(xlabel="number of terms N", ylabel="ω₁ l √(ρ/H)", xlim=(0, 62), ylim=(5.343, 5.375))
    ax.legend()
    return fig


def _frequency_errors(one: dict[str, Any], content: dict[str, Any], runs: Shown) -> Figure:
    f = content["frequencies"]
    fig, ax = panels(1, 1, height=3.0)
    for name, how in _bases():
        error = np.array(f[name]["omega_1"]) / f["exact"] - 1.0
        ok = error > 1e-10
        ax.loglog(np.array(f[name]["terms"])[ok], error[ok], "-", **how)
    ax.axhline(f["linear_theory"] / f["exact"] - 1.0, **STATIC | {"label": "linear theory"})
    ax.set(xlabel="number of terms N", ylabel="relative error of ω₁")
    ax.legend()
    return fig


def _bases() -> list[tuple[str, dict[str, Any]]]:
    return [(name, SAID["ladders"][name]) for name in ("fourier", "wavelet")]


def _slack(ax: Any, r: Response) -> None:
    if r.slack_onset is not None:
        ax.axvspan(r.slack_onset, 1.0, color="#f2e6c4", zorder=0, label="cable slack somewhere")


def _paths(one: dict[str, Any], content: dict[str, Any], runs: Shown) -> Figure:
    """Return the path of the mass in one reading, over its place; the first run says where the cable is slack."""
    first, reading = runs[0][0], one["reading"]
    fig, ax = panels(1, 1, height=3.4)
    _slack(ax, first)
    for place in one.get("marks", ()):
        ax.axvline(place, color=GREY, linewidth=0.8, linestyle=(0, (1, 2)))
    if reading == "y + v":
        s = np.linspace(0.0, first.length, 201)
        ax.plot(s / first.length, Scene.from_toml(first.scene_toml).catenary.y(s) / first.length, **STATIC)
    for r, how in runs:
        ax.plot(r.s_o / r.length, (r.v if reading == "v" else r.y) / r.length, **how)
    ax.invert_yaxis()
    ax.set(xlabel="place of the mass sₒ/l", ylabel=f"{reading}, over l (down)", xlim=(0.0, 1.0))
    ax.set_title(one.get("title", ""))
    fig.legend(loc="outside lower center", ncols=2, fontsize=8.0)
    return fig


def _with_mass(r: Response, i: int, what: str) -> tuple[np.ndarray, np.ndarray]:
    """Return s/l and a field of one frame with the mass put in between the stations, twice for the tension."""
    f = r.fields
    if what == "T":
        H, sides = r.horizontal_tension, [f.T_behind_pointwise[i], f.T_ahead_pointwise[i]]
        values, mass = f.T_pointwise[i] / H, np.array(sides) / H
    else:
        static = Scene.from_toml(r.scene_toml).catenary
        values = (static.y(f.s) + f.v[i]) / r.length
        mass = np.full(2, (float(static.y(f.s_o[i : i + 1])[0]) + f.mass_v[i]) / r.length)
    k = np.full(2, np.searchsorted(f.s, f.s_o[i], side="right"))
    return np.insert(f.s, k, f.s_o[i]) / r.length, np.insert(values, k, mass)


def _instants(one: dict[str, Any], content: dict[str, Any], runs: Shown) -> Figure:
    """Return one panel per instant with the cable's place or tension of each run."""
    places, what = one["places"], one["what"]
    fig, axes = panels(len(places), 1, height=1.15 + 1.25 * len(places), sharex=True, sharey=True)
    first = runs[0][0]
    scene, s = Scene.from_toml(first.scene_toml), first.fields.s
    hangs, pulls = scene.catenary.y(s) / first.length, scene.catenary.tension(s) / first.horizontal_tension

    def at(r: Response, place: float) -> int:
        return int(np.argmin(np.abs(r.fields.s_o / r.length - place)))

    for ax, place in zip(np.atleast_1d(axes), places, strict=True):
        ax.plot(s / first.length, hangs if what == "y" else pulls, **STATIC)
        for r, how in runs:
            i = at(r, place)
            x, y = _with_mass(r, i, what)
            ax.plot(x, y, **how)
            if what == "y" and r is first:
                k = int(np.searchsorted(x, r.fields.s_o[i] / r.length))
                ax.plot(x[k], y[k], "o", color=BLACK, markersize=5, label="mass")
        if what == "T":
            ax.axvline(place, color=GREY, linewidth=0.8, linestyle=(0, (1, 2)))
        ax.set_title(f"sₒ/l = {place:g}   (t* = {first.fields.t[at(first, place)] / scene.time_scale:.2f})", fontsize=9)
        ax.set_ylabel("y + v, over l" if what == "y" else "T/H")
    if what == "y":
        axes[0].invert_yaxis()
    elif "top" in one:
        axes[0].set_ylim(0.0, one["top"])
    axes[-1].set_xlabel("place on the cable s/l")
    handles, labels = axes[0].get_legend_handles_labels()
    columns = 4 if sum(map(len, labels)) < 40 else 3
    fig.legend(handles, labels, loc="outside upper center", ncols=columns, fontsize=8.0)
    return fig


def _levels(one: dict[str, Any], content: dict[str, Any], runs: Shown) -> Figure:
    fig, ax = panels(1, 1, height=3.2)
    _slack(ax, runs[0][0])
    for r, how in runs:
        ax.plot(r.fields.s_o / r.length, np.median(r.fields.T_pointwise, axis=1) / r.horizontal_tension, **how)
    ax.axhspan(2.5, 2.7, color="#dbe8f3", zorder=0, label="2.6 ± 0.1")
    ax.set(xlabel="place of the mass sₒ/l", ylabel="median of T/H along the cable", xlim=(0, 1), ylim=(0, 3.4))
    ax.legend(fontsize=8.0)
    return fig


def _law(one: dict[str, Any], content: dict[str, Any], runs: Shown) -> Figure:
    """Return acceleration, speed and place of the mass over time."""
    motion = Scene.from_toml(runs[0][0].scene_toml).groups.motion
    assert motion is not None
    fig, axes = panels(3, 1, height=4.2, sharex=True)
    for k, (t0, t1) in enumerate(motion.phases):
        t = np.linspace(t0, t1, 60)
        rows = np.array([motion.at(float(x), k) for x in t])
        for ax, column in zip(axes, (2, 1, 0), strict=True):
            ax.plot(t, rows[:, column], color=BLUE, linestyle="-")
    for ax, name in zip(axes, ("aₒ*", "Vₒ*", "sₒ*"), strict=True):
        ax.set_ylabel(name)
    axes[1].axhline(0.41095, **STATIC | {"label": "0.41095"})
    axes[1].legend(loc="lower center")
    axes[2].set_xlabel("t*")
    return fig


def _overshoot(one: dict[str, Any], content: dict[str, Any], runs: Shown) -> Figure:
    fig, ax = panels(1, 1, height=3.2)
    for method, ladder in content["overshoot"].items():
        n, size, spread = (np.array([x[k] for x in ladder]) for k in ("terms", "size", "spread"))
        ax.errorbar(n, size, spread, linestyle="-", capsize=2, **SAID["ladders"][method])
    ax.set(
        xscale="log", yscale="log", xlabel="number of terms N", ylabel="largest |T − T converged|/H beside the mass"
    )  # fmt: skip
    ax.legend(fontsize=8.0)
    return fig


DRAWN: dict[str, Callable[[dict[str, Any], dict[str, Any], Shown], Figure]] = {
    "frequencies": _frequencies, "frequency_errors": _frequency_errors, "paths": _paths, "instants": _instants,
    "levels": _levels, "law": _law, "overshoot": _overshoot,
}  # fmt: skip
