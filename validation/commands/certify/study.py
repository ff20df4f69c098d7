"""The path of the mass as exactly as possible, by three ways.

Two ways by elements differ in degree and scheme, the third is Galerkin's.  Each climbs until its bar is met or costs
too much.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import maximum_filter1d

from cablefem.response import Array, Response, whole, write_json
from cablefem.scene import Scene
from validation.core import store
from validation.core.agreement import Agreement, Bound, Part, nothing, overall
from validation.core.climb import BUDGET, TooCoarse, climb
from validation.core.crossing import crossed
from validation.core.ladder import Ladder
from validation.core.measures import SLACK_END
from validation.core.methods import find
from validation.core.sidebyside import Progress, side_by_side, silent
from validation.core.view import View
from validation.oracles import moving_mass
from validation.oracles.case import Crossing, level
from validation.oracles.case import Path as MassPath

TOL = 1e-6  # of the largest deflection
AIM = 0.4  # of the tolerance: bars of two ways
NEARBY = 5  # places on either side whose gaps count, as a gap may cross zero
PLACES = np.arange(101) / 100.0  # s_o/l
WAYS = (  # method, scheme, and times BUDGET that may be spent: minutes
    ("following-p4", "radau", 16.0), ("following-p2", "gauss", 16.0), ("fourier-kink", "trapezoidal", 2.0),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Track:
    """When and where the mass passes the PLACES first; nan where it does not."""

    t: Array  # (101,) [s]
    place: Array  # (101, 2) [m] x and y
    moved: Array  # (101, 2) [m] u and v
    end: str  # why it ends

    @classmethod
    def of(cls, r: Response) -> Track:
        """Passages of a run up to the slack onset, by splines over place."""
        s_o = np.round(r.s_o / r.length, 12)
        first = (s_o > np.maximum.accumulate(np.r_[-1.0, s_o[:-1]])) & (r.t < r.slack_since)
        path = np.stack([r.t, r.x, r.y, r.u, r.v], axis=1)
        t, x, y, u, v = CubicSpline(s_o[first], path[first], extrapolate=False)(PLACES).T
        what, at = (r.reason, r.reached) if r.slack_onset is None else ("slack cable", r.slack_onset)
        end = "it arrives" if what is None else f"{what} at s_o/l = {at:.3f}"
        return cls(t, np.stack([x, y], axis=1), np.stack([u, v], axis=1), end)

    def gap(self, other: Track) -> Array:
        """(2, 101) distances in place [m] and time [s]."""
        return np.stack([np.linalg.norm(self.place - other.place, axis=1), np.abs(self.t - other.t)])


@dataclass(frozen=True, slots=True)
class Found:
    """The finest run of a way, or a shipped table, with its bars."""

    name: str
    settings: dict[str, Any]
    track: Track
    parts: Array  # (2, 2, 101) bars of space and time, in place [m] and time [s]; not finite where coarser runs ended

    @classmethod
    def of(cls, ladder: Ladder) -> Found:
        r = ladder.run
        told = (find(r.method).resolution.setting, "steps", "scheme", "grading")
        parts = [np.broadcast_to(x, (2, 101)) for x in ladder.parts(Track.of, lambda a, b: nearby(a.gap(b)))]
        settings = {k: r.settings[k] for k in told if k in r.settings}
        return cls(f"{r.method} {r.settings['scheme']}", settings, Track.of(r), np.stack(parts))

    @property
    def bar(self) -> Array:
        return self.parts.sum(axis=0)

    @property
    def left(self) -> list[float]:
        """Largest bars of space and time in place, over `scale`, up to 0.95 of the way."""
        near = SLACK_END * self.reaches >= PLACES
        return [float(np.max(part[0, near]) / self.scale) for part in self.parts]

    @property
    def scale(self) -> float:
        """Largest distance from the static cable [m]."""
        return float(np.nanmax(np.linalg.norm(self.track.moved, axis=1)))

    @property
    def reaches(self) -> float:
        return float(PLACES[np.isfinite(self.track.t)][-1])


@dataclass(frozen=True, slots=True)
class Certificate:
    """The table and its sources."""

    scene: Scene
    found: tuple[Found, ...]  # the first is the answer
    bar: Array  # (2, 101) of the answer: at least the distance to the second way
    gaps: tuple[Array, ...]  # (2, 101) from the answer to each other way
    rows: list[Agreement] = field(default_factory=list)

    @property
    def answer(self) -> Found:
        return self.found[0]

    @property
    def verdict(self) -> str:
        return overall(self.rows).value

    def depth(self, tol: float) -> float:
        return reach(self.bar[0] / self.answer.scale, tol)

    def write(self, folder: Path) -> None:
        write_table(folder / "certificate.csv", self)
        ways = [
            {"name": f.name, "settings": f.settings, "space": f.left[0], "time": f.left[1],
             "to": reach(f.bar[0] / f.scale, TOL), "reaches": f.reaches, "end": f.track.end}
            for f in self.found
        ]  # fmt: skip
        table = {
            "s_o": PLACES.tolist(), "bar": (self.bar[0] / self.answer.scale).tolist(),
            "gaps": [(gap[0] / self.answer.scale).tolist() for gap in self.gaps],
        }  # fmt: skip
        content = {
            "verdict": self.verdict, "tol": TOL, "to": self.depth(TOL), "scale": self.answer.scale, "ways": ways,
            "table": table, "rows": [row.row() for row in self.rows],
        }  # fmt: skip
        write_json(folder / "certify.json", store.plain(content))


def certify(scene: Scene, out: Path | None = None, progress: Progress = silent) -> Certificate:
    """Compare all ways and the shipped table."""
    found = side_by_side([partial(deepest, scene, *way) for way in WAYS], progress)
    made = joined(scene, tuple(found))
    rows = [row for f in found[1:] for row in compared(made, made.answer.bar, f)]
    rows += [_string(scene, f) for f in found if scene.drive.mode == "grip"]
    shipped = dict(map(read_table, tables())).get(scene.to_toml())
    made = replace(made, rows=[*rows, *(compared(made, made.bar, shipped) if shipped else ())])
    if out is not None:
        made.write(out)
    return made


def joined(scene: Scene, found: tuple[Found, ...]) -> Certificate:
    gaps = tuple(found[0].track.gap(f.track) for f in found[1:])
    return Certificate(scene, found, np.fmax(found[0].bar, nearby(gaps[0])), gaps)


def deepest(scene: Scene, method: str, scheme: str, budget: float, progress: Progress = silent) -> Found:
    """Climb by one way as far as the tolerance or the budget."""
    told = partial(progress, f"{method} {scheme}")
    settings: dict[str, Any] = {"scheme": scheme}
    if scene.drive.mode == "free" and find(method).wing == "elements":
        settings["grading"] = 10.0  # a wave at release shifts the ride
    settings |= {"budget": budget * BUDGET, "progress": told, **to_the_end(scene)}
    try:
        return Found.of(climb(scene, method, AIM * TOL, **settings))
    except TooCoarse as error:
        return Found.of(error.ladder)


def to_the_end(scene: Scene) -> dict[str, Any]:
    """Arguments of a climb with coarser runs up to the slack onset."""
    view = View.of(scene)
    return {"view": replace(view, window=(view.window[0], max(view.window[1], SLACK_END)), ends=True), "past": 0.0}


def nearby(gap: Array) -> Array:
    """Largest value around each place (last axis); nan where that place has none."""
    largest = maximum_filter1d(np.nan_to_num(gap), 2 * NEARBY + 1, axis=1, mode="constant")
    return np.where(np.isfinite(gap), largest, np.nan)


def reach(bar: Array, tol: float) -> float:
    """Last place up to which all bars are within a tolerance, or 0."""
    return float(np.max(PLACES, where=np.logical_and.accumulate(bar <= tol), initial=0.0))


def compared(made: Certificate, bar: Array, other: Found) -> Iterator[Agreement]:
    """Verdicts on another path and a free ride's times, each at the worst place."""
    gap, allowed, party = made.answer.track.gap(other.track), bar + other.bar, other.name
    asked = [("path", made.answer.scale), ("instants", 1.0)][: 1 + (made.scene.drive.mode == "free")]
    for i, (quantity, unit) in enumerate(asked):
        both = np.isfinite(gap[i]) & np.isfinite(allowed[i]) & (PLACES > 0.0)
        if not both.any():
            yield Agreement(quantity, math.nan, nothing("no place that both reach"), party=party)
            continue
        at = int(np.argmax(np.where(both, gap[i] / np.maximum(allowed[i], 1e-300), -1.0)))
        each = (made.answer.name, bar), (other.name, other.bar)
        parts = tuple(Part(name, float(x[i, at] / unit)) for name, x in each)
        yield Agreement(quantity, float(gap[i, at] / unit), Bound("error bars", parts), PLACES[at], party=party)


def _string(scene: Scene, found: Found) -> Agreement:
    """Compare a way's settings with the exact answer on a taut string with the same mass and travel."""
    law, groups = "taut string", scene.groups
    motion = groups.motion
    assert motion is not None
    try:
        exact = moving_mass.solve(motion, mu=groups.mu, sigma=groups.sigma).path
        crossing = Crossing(name="", groups=level(motion, groups.mu, groups.sigma), exact=exact, until=0.95)
        path = crossed(crossing.groups, found.name.split()[0], found.settings, **crossing.how)
        error = crossing.error(MassPath(*path))[0]
    except (ValueError, ArithmeticError) as why:
        return Agreement("path", math.nan, nothing(why), party=found.name, law=law)
    parts = (Part(f"{found.name} claims", max(TOL, sum(found.left))),)
    return Agreement("path", error, Bound("own bar", parts), party=found.name, law=law)


def tables() -> list[Path]:
    return sorted(Path(str(resources.files("validation.commands.certify") / "tables")).glob("*.csv"))


def write_table(file: Path, made: Certificate) -> None:
    """Write t, x, y (down), u, v at s_o/l = k/100 with bars [m] and [s], after their sources.

    Bars include the rounding of the digits.
    """
    a = made.answer
    digits = max(0, math.ceil(-math.log10(0.01 * TOL * a.scale)))
    bars = made.bar + 0.5 * np.array([[10.0**-digits], [10.0 ** -(digits + 3)]])
    ways = (f"{f.name.split()[0]} {', '.join(f'{k} {v}' for k, v in f.settings.items())}" for f in made.found)
    notes = [
        f"path of the mass, certified to {TOL:g} of {a.scale:.6g} m for s_o/l up to {made.depth(TOL):.2f}",
        "; ".join(ways), f"ends: {a.track.end}",
        "t in s, lengths in m, y and v down; bar: x, y, u, v within it at that s_o; bar_t: of t", "scene:",
        *made.scene.to_toml().splitlines(),
    ]  # fmt: skip
    rows = np.column_stack([PLACES, a.track.t, a.track.place, a.track.moved, bars.T])
    form = ["%.2f", f"%.{digits + 3}f", *[f"%.{digits}f"] * 4, "%.1e", "%.1e"]
    with whole(file) as temporary, temporary.open("w", encoding="utf-8") as out:
        out.writelines(f"# {line}".rstrip() + "\n" for line in notes)
        out.write("s_o/l,t,x,y,u,v,bar,bar_t\n")
        np.savetxt(out, rows[np.isfinite(rows).all(axis=1)], form, delimiter=",")


def read_table(file: Path) -> tuple[str, Found]:
    """The scene of a table as TOML, and its path."""
    lines = file.read_text(encoding="utf-8").splitlines()
    notes = [line[1:].removeprefix(" ") for line in lines if line.startswith("#")]
    toml = "\n".join(notes[notes.index("scene:") + 1 :]) + "\n"
    known = np.loadtxt(lines[len(notes) + 1 :], delimiter=",")
    rows = np.full((PLACES.size, 7), np.nan)
    rows[np.round(100.0 * known[:, 0]).astype(int)] = known[:, 1:]
    end = next(note.removeprefix("ends: ") for note in notes if note.startswith("ends: "))
    track, bar = Track(rows[:, 0], rows[:, 1:3], rows[:, 3:5], end), rows[:, 5:].T
    # rewritten, as the order of tables may differ
    return Scene.from_toml(toml).to_toml(), Found("shipped table", {}, track, np.stack([bar, np.zeros_like(bar)]))
