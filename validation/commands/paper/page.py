"""
The page of `cablefem paper`: every claim with its verdict, then the paper's figures redone, from stored runs alone."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from cablefem.response import Response
from cablefem.scene import Scene
from validation.page.figures import BLACK, BLUE, GREY, VERMILLION
from validation.page.page import Section, badge, details, figure, gallery, missing, number, panels, style, table

KIND = {
    "holds": "agree", "holds at the paper's resolution only": "not comparable", "does not hold": "disagree",
    "cannot be decided": "not comparable",
}  # fmt: skip
ERRATA = (
    "sign-of-h", "alpha-844", "count", "dyadic-places", "potential-energy", "unconditionally-stable", "start-48",
    "position-form", "step-2^-12", "dyadic-steps",
)  # fmt: skip
STATIC = {"color": GREY, "linestyle": (0, (6, 3)), "linewidth": 1.0, "label": "static"}
CONVERGED = {"color": BLACK, "linestyle": "-", "linewidth": 1.6, "label": "converged"}
SINES = {"color": BLUE, "linestyle": (0, (4, 1.5)), "linewidth": 1.2}
WAVELETS = {"color": VERMILLION, "linestyle": "-", "linewidth": 1.0}


def sections(folder: Path) -> list[Section]:
    """Return the claims table and one section per figure; what was not stored is named."""
    path = folder / "claims.json"
    if not path.exists():
        return [Section("claims", "Claims of the paper", missing("claims.json", "Run cablefem paper."))]
    content = json.loads(path.read_text(encoding="utf-8"))
    stored = _Stored(folder / "runs")
    out = [_claims(content), _wu_and_chen(content, stored)]
    makers: list[Callable[[dict[str, Any], _Stored], Section]] = [
        _figure_2, _figure_3, _figure_4, _figures_5_to_7, _figures_8_to_10, _beyond,
    ]  # fmt: skip
    for make in makers:
        try:
            out.append(make(content, stored))
        except FileNotFoundError as error:
            name = make.__name__.strip("_").replace("_", " ")
            out.append(
                Section(name.replace(" ", "-"), name.capitalize(), missing(str(error), "Run cablefem paper again."))
            )
    return out


class _Stored:
    """Runs by name, read when first asked for."""

    def __init__(self, folder: Path) -> None:
        self.folder, self._known = folder, dict[str, Response]()

    def __getitem__(self, name: str) -> Response:
        if name not in self._known:
            self._known[name] = Response.read(self.folder / name)
        return self._known[name]


# --- the table ------------------------------------------------------------------------------------------------------


def _claims(content: dict[str, Any]) -> Section:
    count = content["count"]
    rows = [_row(c) for c in content["claims"] if c["id"] not in ERRATA]
    errata = [_row(c) for c in content["claims"] if c["id"] in ERRATA]
    columns = {
        "claim": "Claim", "verdict_": "Verdict", "allowed": "True if", "paper": "At the paper's resolution",
        "converged": "Converged", "why": "Why",
    }  # fmt: skip
    text = Markup(
        "<p>Verdicts are computed. Each claim is turned into one or more numbers with a range (column “True if”) "
        "in which the claim is true. The converged value comes from elements that follow the mass, with companions "
        "of half the elements and half the steps; its ± covers what they leave and the distance to a second solver "
        "that shares no formula with them (sines with a travelling kink). Where a claim is about a basis of so "
        "many terms, the value is that basis's own and its ± what the paper leaves open (steps, damping). A value "
        "whose ± reaches across an end of the range decides nothing. “Path” may mean the displacement v or the "
        "place y + v: where the text leaves it open, one reading that is true is enough. v and y point down, so "
        "the paper's upward maxima are minima here.</p>"
    )
    more = Markup('<h3 id="errata">Formulas, errata and time integration</h3>')
    parts = [text, table(rows, columns, stack=True), more, table(errata, columns, stack=True)]
    plural = {"holds": "hold", "does not hold": "do not hold"}
    found = [f"{n} {plural.get(v, v.replace('holds', 'hold'))}" for v, n in count.items() if n]
    summary = f"Of {sum(count.values())} claims {', '.join(found)}."
    return Section("claims", "Claims of the paper", Markup("\n").join(parts), None, summary)


def _row(claim: dict[str, Any]) -> dict[str, Any]:
    quantities = claim["quantities"]
    join = Markup("<br>")
    word = Markup("<br><em>or</em> ") if claim["readings"] else join

    def each(make: Callable[[dict[str, Any]], Markup]) -> str:
        return word.join(make(q) for q in quantities) if quantities else "–"

    return {
        "claim": Markup('<span id="claim-{}">{}</span><br><small>{}</small>').format(
            claim["id"], _symbols(claim["claim"]), claim["where"]
        ),
        "verdict_": badge(KIND[claim["verdict"]], claim["verdict"]),
        "allowed": each(lambda q: Markup("{}: {}").format(_symbols(q["name"]), q["claimed"])),
        "paper": each(lambda q: _value(q, q["paper"])),
        "converged": each(lambda q: _value(q, q["converged"], q["uncertainty"])),
        "why": _symbols(claim["why"]),
    }


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


def _linked(content: dict[str, Any], *ids: str) -> Markup:
    """Return the verdicts that belong to a figure, each with a link to its row."""
    found = {c["id"]: c for c in content["claims"]}
    items = [
        Markup('<li>{} <a href="#claim-{}">{}</a></li>').format(
            badge(KIND[found[i]["verdict"]], found[i]["verdict"]), i, _symbols(found[i]["claim"])
        )
        for i in ids if i in found
    ]  # fmt: skip
    return Markup("<ul>{}</ul>").format(Markup("\n").join(items))


# --- Wu and Chen ----------------------------------------------------------------------------------------------------


def _wu_and_chen(content: dict[str, Any], stored: _Stored) -> Section:
    rows = [
        {
            "mu": x["mu"], "reading": x["reading"],
            "kind": "lowest" if x["kind"] == "max" else "highest (a maximum on the page)",
            "place": _with_bar(x["place"], x["uncertainty"]), "fourier_30": number(x["fourier_30"], 3),
        }
        for x in content["wu_and_chen"]
    ]  # fmt: skip
    html = Markup("\n").join([
        Markup(
            "<p>The paper finds a turn of its path at 0.655 for μ = 1, Wu & Chen one at 0.8 for μ = 2, and "
            "concludes that their mass ratio lacks a factor of two. If it did, their curve would be the one for "
            "half the mass, and a turn at 0.8 would have to be found for μ = 1. All turning points of the "
            "converged path up to the slack cable:</p>"
        ).replace("Wu & Chen", Markup("Wu &amp; Chen")),
        table(rows, {
            "mu": "μ", "reading": "Reading", "kind": "Turn", "place": "Place of the mass sₒ/l, converged",
            "fourier_30": "N = 30 sines",
        }),
        _linked(content, "turn-at-0.655", "wu-chen-0.8", "factor-of-two"),
    ])  # fmt: skip
    found = {c["id"]: c for c in content["claims"]}["factor-of-two"]
    return Section("wu-and-chen", "The factor of two", html, None, f"The claim {found['verdict']}. {found['why']}")


def _with_bar(x: float, bar: float) -> Markup:
    """Return 0.65127 ± 0.00001: down to the first digit of a small bar, the second of a large one, six at most."""
    decimals = int(np.clip(np.ceil(-np.log10(max(bar, 1e-6))) + (bar > 1e-3), 1, 6))
    shown = max(round(bar, decimals), 10.0**-decimals)
    return Markup('<span style="white-space:nowrap">{} ± {}</span>').format(
        f"{x:.{decimals}f}".replace("-", "−"), f"{shown:.{decimals}f}"
    )


# --- figures --------------------------------------------------------------------------------------------------------


def _figure_2(content: dict[str, Any], stored: _Stored) -> Section:
    f = content["frequencies"]
    with style():
        fig, ax = panels(1, 1, height=3.0)
        ax.axhline(f["linear_theory"], **{**STATIC, "label": "linear theory 5.34979"})
        ax.axhline(f["exact"], color=BLACK, linewidth=1.0, linestyle="-", label="exact catenary 5.34548")
        ax.plot(f["fourier"]["terms"], f["fourier"]["omega_1"], "o-", color=BLUE, label="Fourier")
        ax.plot(f["wavelet"]["terms"], f["wavelet"]["omega_1"], "s-", color=VERMILLION, label="wavelets, p = 4")
        ax.set(xlabel="number of terms N", ylabel="ω₁ l √(ρ/H)", xlim=(0, 62), ylim=(5.343, 5.375))
        ax.legend()
        first = figure(
            fig,
            "Figure 2. The paper shows both bases against N with the linear theory's line. Here the same, on a "
            "scale on which the linear theory (a parabola) and the exact catenary part: both bases converge to "
            "the latter, from above. N = 1 and 2 sines (6.45, 5.44) lie outside.",
            label="First natural frequency against the number of terms",
        )  # fmt: skip
        fig, ax = panels(1, 1, height=3.0)
        for name, marker, color in (("fourier", "o-", BLUE), ("wavelet", "s-", VERMILLION)):
            error = np.array(f[name]["omega_1"]) / f["exact"] - 1.0
            ok = error > 1e-10
            ax.loglog(np.array(f[name]["terms"])[ok], error[ok], marker, color=color, label=name.capitalize())
        ax.axhline(f["linear_theory"] / f["exact"] - 1.0, **{**STATIC, "label": "linear theory"})
        ax.set(xlabel="number of terms N", ylabel="relative error of ω₁")
        ax.legend()
        second = figure(fig, "The error against the exact catenary: “fast” is N⁻³ for sines, faster for wavelets.",
                        label="Relative error of the first frequency against the number of terms")  # fmt: skip
    html = gallery(first, second) + _linked(content, "omega-1", "fast-convergence", "exact-frequencies")
    return Section("figure-2", "Figure 2: first natural frequency", html)


def _path(ax: Any, r: Response, reading: str, **how: Any) -> None:
    ax.plot(r.s_o / r.length, (r.v if reading == "v" else r.y) / r.length, **how)


def _turn_marks(ax: Any, places: Sequence[float]) -> None:
    for place in places:
        ax.axvline(place, color=GREY, linewidth=0.8, linestyle=(0, (1, 2)))


def _slack(ax: Any, r: Response) -> None:
    if r.slack_onset is not None:
        ax.axvspan(r.slack_onset, 1.0, color="#f2e6c4", zorder=0, label="cable slack somewhere")


def _converged(content: dict[str, Any], claim: str, i: int = 0) -> float:
    """Return a converged value from the table, for a caption."""
    return next(c for c in content["claims"] if c["id"] == claim)["quantities"][i]["converged"]


def _figure_3(content: dict[str, Any], stored: _Stored) -> Section:
    level, heavy = stored["level-reference"], stored["heavy-reference"]
    shown = []
    with style():
        for reading, title in (("y + v", "place of the mass, y + v"), ("v", "displacement of the mass, v")):
            fig, ax = panels(1, 1, height=3.4)
            _slack(ax, level)
            _turn_marks(ax, (0.655, 0.8))
            if reading == "y + v":
                s = np.linspace(0.0, level.length, 201)
                ax.plot(s / level.length, Scene.from_toml(level.scene_toml).catenary.y(s) / level.length, **STATIC)
            _path(ax, level, reading, **{**CONVERGED, "label": "μ = 1 converged"})
            _path(ax, stored["level-fourier-30"], reading, **SINES, label="μ = 1, 30 sines")
            _path(ax, stored["level-wavelet-31"], reading, **WAVELETS, label="μ = 1, 31 wavelets")
            _path(ax, heavy, reading, color="#009e73", linestyle="-", linewidth=1.2, label="μ = 2 converged")
            ax.invert_yaxis()
            ax.set(xlabel="place of the mass sₒ/l", ylabel=f"{reading}, over l (down)", xlim=(0.0, 1.0), title=title)
            fig.legend(loc="outside lower center", ncols=2, fontsize=8.0)
            shown.append(fig)
    one = figure(
        shown[0],
        "Figure 3, read as the place of the mass. The paper shows its path for μ = 1 and Wu & Chen's for μ = 1 "
        "and 2. Dotted: 0.655 and 0.8, the turns the paper names. The curve for μ = 2 turns at "
        f"{_converged(content, 'wu-chen-0.8', 1):.3f}, where Wu & Chen's does.",
        label="Path of the mass as y plus v for both mass ratios",
    )  # fmt: skip
    two = figure(
        shown[1], "Figure 3, read as the displacement alone: for μ = 1 its turn lies at "
        f"{_converged(content, 'turn-at-0.655'):.3f}, the paper's 0.655. Thirty sines are "
        f"{100 * _converged(content, 'enough-sines'):.0f} percent from the converged path. Shaded: for μ = 1 the "
        "cable is slack somewhere, and from there on the path rests on a law without compression.",
        label="Path of the mass as v for both mass ratios",
    )  # fmt: skip
    html = gallery(one, two) + _linked(
        content, "turn-at-0.655", "deepest-at-a-third", "enough-sines", "wu-chen-0.8", "factor-of-two"
    )
    return Section("figure-3", "Figure 3: path at constant speed", html)


def _at(r: Response, s_o: float) -> int:
    return int(np.argmin(np.abs(r.fields.s_o / r.length - s_o)))


def _with_mass(r: Response, i: int, what: str) -> tuple[np.ndarray, np.ndarray]:
    """Return s/l and a field of one frame with the mass put in between the stations, twice for the tension."""
    f = r.fields
    k = int(np.searchsorted(f.s, f.s_o[i], side="right"))
    head, tail = slice(0, k), slice(k, None)
    s, s_o = f.s / r.length, f.s_o[i] / r.length
    place = np.concatenate([s[head], [s_o, s_o], s[tail]])
    if what == "T":
        values, mass = (
            f.T_pointwise[i] / r.horizontal_tension,
            np.array([f.T_behind_pointwise[i], f.T_ahead_pointwise[i]]) / r.horizontal_tension,
        )
    else:
        static = Scene.from_toml(r.scene_toml).catenary
        values = (static.y(f.s) + f.v[i]) / r.length
        mass = np.full(2, (float(static.y(f.s_o[i : i + 1])[0]) + f.mass_v[i]) / r.length)
    return place, np.concatenate([values[head], mass, values[tail]])


def _instants(
    runs: Sequence[tuple[Response, dict[str, Any]]], places: Sequence[float], what: str, *, top: float | None = None
) -> Figure:
    """Return one panel per instant with the cable's place or tension of each run."""
    fig, axes = panels(len(places), 1, height=1.15 + 1.25 * len(places), sharex=True, sharey=True)
    axes = np.atleast_1d(axes)
    first = runs[0][0]
    scene = Scene.from_toml(first.scene_toml)
    s = first.fields.s
    for ax, place in zip(axes, places, strict=True):
        static = (
            scene.catenary.y(s) / first.length if what == "y" else scene.catenary.tension(s) / first.horizontal_tension
        )
        ax.plot(s / first.length, static, **STATIC)
        for r, how in runs:
            i = _at(r, place)
            x, y = _with_mass(r, i, what)
            ax.plot(x, y, **how)
            if what == "y" and r is first:
                k = int(np.searchsorted(x, r.fields.s_o[i] / r.length))
                ax.plot(x[k], y[k], "o", color=BLACK, markersize=5, label="mass")
        if what == "T":
            ax.axvline(place, color=GREY, linewidth=0.8, linestyle=(0, (1, 2)))
        t = first.fields.t[_at(first, place)] / scene.time_scale
        ax.set_title(f"sₒ/l = {place:g}   (t* = {t:.2f})", fontsize=9)
        ax.set_ylabel("y + v, over l" if what == "y" else "T/H")
    if what == "y":
        axes[0].invert_yaxis()
    elif top is not None:
        axes[0].set_ylim(0.0, top)
    axes[-1].set_xlabel("place on the cable s/l")
    handles, labels = axes[0].get_legend_handles_labels()
    columns = 4 if sum(map(len, labels)) < 40 else 3
    fig.legend(handles, labels, loc="outside upper center", ncols=columns, fontsize=8.0)
    return fig


def _figure_4(content: dict[str, Any], stored: _Stored) -> Section:
    level, F, W = (stored[n] for n in ("level-reference", "level-fourier-30", "level-wavelet-31"))
    places = (0.15, 0.3, 0.45, 0.65, 0.75)
    both = [
        (level, CONVERGED), (F, {**SINES, "label": "30 sines"}), (W, {**WAVELETS, "label": "31 wavelets"}),
    ]  # fmt: skip
    damped = [
        (level, CONVERGED),
        (stored["level-fourier-30-overdamped"], {**SINES, "label": "30 sines, γ = 1"}),
        (stored["level-wavelet-31-overdamped"], {**WAVELETS, "label": "31 wavelets, γ = 1"}),
    ]
    with style():
        shape, tension = _instants(both, places, "y"), _instants(both, places, "T", top=4.0)
        lines = _instants(damped, (0.15, 0.3, 0.45), "T", top=4.0)
        fig, ax = panels(1, 1, height=3.2)
        _slack(ax, level)
        for r, how in both:
            ax.plot(r.fields.s_o / r.length, np.median(r.fields.T_pointwise, axis=1) / r.horizontal_tension, **how)
        ax.axhspan(2.5, 2.7, color="#dbe8f3", zorder=0, label="2.6 ± 0.1")
        ax.set(xlabel="place of the mass sₒ/l", ylabel="median of T/H along the cable", xlim=(0, 1), ylim=(0, 3.4))
        ax.legend(fontsize=8.0)
    html = gallery(
        figure(
            shape,
            "Figure 4 (a), the cable's place. The paper does not print its instants; these are ours. The two bases "
            "are hardly told apart, as the paper says.", label="Shape of the cable at five instants",
        ),
        figure(
            tension,
            "Figure 4 (b), the tension. The sines oscillate along the whole cable, the wavelets mostly beside the "
            "mass, where their ripples are higher and longer. The converged tension is all but a straight line "
            "until the "
            "mass is past 0.63.", label="Tension along the cable at five instants",
        ),
        figure(
            lines,
            "The paper's “horizontal straight lines” come with damping: the same bases with Newmark's γ = 1 and "
            "256 steps. The lines are straighter, and stand at another height than the true tension; the path is "
            "wrong.",
            label="Tension with strong numerical damping",
        ),
        figure(
            fig,
            "The tension over time. It is about 2.6 H from a quarter of the way to the meeting with the reflected "
            f"wave at {_converged(content, 'meets-half-way'):.3f}, and anything but constant after mid-span.",
            label="Median tension against the place of the mass",
        ),
    )  # fmt: skip
    html += _linked(
        content, "meets-half-way", "partly-transmitted", "same-motion", "straight-lines", "local-oscillations",
        "function-of-time", "sines-oscillate", "wavelet-tension-better", "tension-2.6", "tension-constant",
    )  # fmt: skip
    return Section("figure-4", "Figure 4: shape and tension at constant speed", html)


def _figures_5_to_7(content: dict[str, Any], stored: _Stored) -> Section:
    cruise = stored["cruise-reference"]
    scene = Scene.from_toml(cruise.scene_toml)
    motion = scene.groups.motion
    assert motion is not None
    with style():
        law, axes = panels(3, 1, height=4.2, sharex=True)
        for k, (t0, t1) in enumerate(motion.phases):
            t = np.linspace(t0, t1, 60)
            rows = np.array([motion.at(float(x), k) for x in t])
            for ax, column in zip(axes, (2, 1, 0), strict=True):
                ax.plot(t, rows[:, column], color=BLUE, linestyle="-")
        for ax, name in zip(axes, ("aₒ*", "Vₒ*", "sₒ*"), strict=True):
            ax.set_ylabel(name)
        axes[1].axhline(0.41095, **{**STATIC, "label": "0.41095"})
        axes[1].legend(loc="lower center")
        axes[2].set_xlabel("t*")
        path, ax = panels(1, 1, height=3.4)
        _slack(ax, cruise)
        s = np.linspace(0.0, cruise.length, 201)
        ax.plot(s / cruise.length, scene.catenary.y(s) / cruise.length, **STATIC)
        _path(ax, cruise, "y + v", **CONVERGED)
        _path(ax, stored["cruise-fourier-30"], "y + v", **SINES, label="30 sines")
        _path(ax, stored["cruise-wavelet-31"], "y + v", **WAVELETS, label="31 wavelets")
        _path(
            ax,
            stored["level-reference"],
            "y + v",
            color="#009e73",
            linestyle=(0, (1, 1.2)),
            label="constant speed, converged",
        )
        ax.invert_yaxis()
        ax.set(xlabel="place of the mass sₒ/l", ylabel="y + v, over l (down)", xlim=(0, 1))
        path.legend(loc="outside lower center", ncols=2, fontsize=8.0)
        both = [
            (cruise, CONVERGED), (stored["cruise-fourier-30"], {**SINES, "label": "30 sines"}),
            (stored["cruise-wavelet-31"], {**WAVELETS, "label": "31 wavelets"}),
        ]  # fmt: skip
        shapes = _instants(both, (0.15, 0.33, 0.5, 0.67, 0.85), "y")
    html = gallery(
        figure(
            law,
            "Figure 5, law (40): acceleration, speed and place of the mass; every method steps on both jumps of the "
            "acceleration.", label="Acceleration, speed and place of the mass over time",
        ),
        figure(
            path,
            "Figure 6, path of the mass: lowest near the middle, and nearly as low as at constant speed (dotted, "
            "lowest "
            "at a third).", label="Path of the mass under law (40)",
        ),
        figure(shapes, "Figure 7, the cable's place at five instants of ours.", label="Shape of the cable, law (40)"),
    )  # fmt: skip
    html += _linked(content, "top-speed", "deepest-in-the-middle", "same-depth")
    return Section("figures-5-to-7", "Figures 5 to 7: accelerate, cruise, brake", html)


def _figures_8_to_10(content: dict[str, Any], stored: _Stored) -> Section:
    inclined, rising = stored["inclined-reference"], stored["rising-following"]
    places = (0.25, 0.5, 0.75)
    with style():
        path, ax = panels(1, 1, height=3.4)
        s = np.linspace(0.0, inclined.length, 201)
        ax.plot(s / inclined.length, Scene.from_toml(inclined.scene_toml).catenary.y(s) / inclined.length, **STATIC)
        _turn_marks(ax, (0.8,))
        _path(ax, inclined, "y + v", **CONVERGED)
        _path(ax, stored["inclined-fourier-10"], "y + v", **SINES, label="10 sines")
        _path(
            ax, rising, "y + v", color="#009e73", linestyle=(0, (1, 1.2)), label="right support higher, (12) as printed"
        )
        ax.invert_yaxis()
        ax.set(xlabel="place of the mass sₒ/l", ylabel="y + v, over l (down)", xlim=(0, 1))
        path.legend(loc="outside lower center", ncols=2, fontsize=8.0)
        pages = [
            figure(
                path,
                "Figure 8, path of the mass on the inclined cable from rest with a = g: lowest at "
                f"{_converged(content, 'lowest-at-0.8'):.3f} (dotted: the "
                "paper's 0.8). Only a right support 90 m lower gives that.",
                label="Path of the mass on the inclined cable",
            )
        ]
        for n, name in ((10, "9"), (17, "10")):
            both = [
                (inclined, CONVERGED), (stored[f"inclined-fourier-{n}"], {**SINES, "label": f"{n} sines"}),
                (stored[f"inclined-wavelet-{n}"], {**WAVELETS, "label": f"{n} wavelets"}),
            ]  # fmt: skip
            fig = _instants(both, places, "T")
            what = "steps in time" if n == 10 else "steps of 2⁻¹² in sₒ, (45) with (48)"
            pages.append(figure(
                _instants(both, places, "y"),
                f"Figure {name} (a), the cable's place, N = {n}, {what}; the paper's three instants "
                "are not printed, these are ours.", label=f"Shape of the inclined cable, N = {n}",
            ))  # fmt: skip
            pages.append(figure(
                fig, f"Figure {name} (b), the tension, N = {n}. " + (
                    "The true one steps up at the mass and is otherwise straight; both bases ripple about it."
                    if n == 10 else "More terms: ripples are finer, and beside the mass about as high."
                ), label=f"Tension of the inclined cable, N = {n}",
            ))  # fmt: skip
    html = gallery(pages[0]) + gallery(*pages[1:3]) + gallery(*pages[3:]) + _linked(
        content, "lowest-at-0.8", "sign-of-h", "static-constant", "same-displacement", "sines-oscillate-more",
        "jump-at-the-mass", "slow-elsewhere", "wavelet-oscillations-fall", "higher-levels", "sine-oscillations-stay",
        "more-terms-more-oscillations", "position-form",
    )  # fmt: skip
    return Section("figures-8-to-10", "Figures 8 to 10: inclined cable, from rest", html)


def _beyond(content: dict[str, Any], stored: _Stored) -> Section:
    looks = {
        "fourier": ("sines", {"marker": "o", "color": BLUE}),
        "wavelet": ("wavelets, p = 4", {"marker": "s", "color": VERMILLION}),
        "fourier-kink": ("sines and a travelling kink", {"marker": "^", "color": "#009e73"}),
    }
    with style():
        fig, ax = panels(1, 1, height=3.2)
        for method, ladder in content["overshoot"].items():
            label, how = looks[method]
            n, size, spread = (np.array([x[k] for x in ladder]) for k in ("terms", "size", "spread"))
            ax.errorbar(n, size, spread, label=label, linestyle="-", capsize=2, **how)
        ax.set(
            xscale="log", yscale="log", xlabel="number of terms N", ylabel="largest |T − T converged|/H beside the mass"
        )
        ax.legend(fontsize=8.0)
    caption = (
        "Gibbs' overshoot on the inclined cable, between half a wavelength and two beside the mass, mean over "
        "eleven instants. It does not shrink with N for sines nor, after the first level, for wavelets; one hat "
        "that travels with the mass takes it away."
    )
    references = [
        {
            "scene": name,
            "method": f"{x['method']}, {x['settings']['elements']} + {x['settings']['elements']} elements, "
            f"{x['settings']['steps']} steps",
            "cross": x["crossed_by"], "bar": x["path_bar"], "slack": x["slack_onset"],
        }
        for name, x in content["references"].items()
    ]  # fmt: skip
    names = {"level": "level", "heavy": "level, μ = 2", "cruise": "law (40)", "inclined": "inclined"}
    for row in references:
        row["scene"] = names[row["scene"]]
    rest = table(references, {
        "scene": "Scene", "method": "Converged run", "cross": "Crossed by",
        "bar": "Error bar of the path (of largest v)",
        "slack": "Slack from sₒ/l",
    })  # fmt: skip
    html = gallery(figure(fig, caption, label="Overshoot of the tension against the number of terms"))
    html += details("What the converged values rest on", rest)
    return Section("overshoot", "Beyond the paper: the overshoot beside the mass", html, None, caption.split(". ")[1])
