"""The path of the mass as exactly as possible, place by place, by three ways.

Two discretisations by elements differ in degree and scheme; the Galerkin solver shares only scene and time driver with
them.  Each is refined until its bars are met or its limit of work is reached.  For a gripping car, the same settings
are also compared with the exact answer on a taut string.
The path of a free ride is compared over place; the time of passage has its own bar.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq

from cablefem import newmark
from cablefem.newmark import Newton, State, StepFailure, between
from cablefem.response import Array, whole, write_json
from cablefem.scene import Scene
from validation.core import store
from validation.core.agreement import Agreement, overall
from validation.core.bounds import Bound, Part, nothing
from validation.core.crossing import crossed
from validation.core.methods import Method, find, refined
from validation.core.order import left
from validation.core.running import steps_of
from validation.core.sampling import stacked
from validation.core.sidebyside import Progress, side_by_side, silent
from validation.oracles import moving_mass
from validation.oracles.case import Crossing, level
from validation.oracles.case import Path as MassPath

TOL = 1e-6  # of the largest deflection
NEWTON = Newton(tol=1e-8)  # errors of Newton's method add up over the steps
AIM = 0.4  # of the tolerance: bars of two ways
LAST = 95  # beyond it changes show no order, and a cut step ends a hauled ride
NEARBY = 5  # places on either side whose gaps count: a gap may cross zero


@dataclass(frozen=True, slots=True)
class Way:
    """A method and scheme, its first settings, and the most work of a run."""

    method: str
    scheme: str
    first: tuple[int, int]  # resolution and steps
    most: float  # steps times cost of each (`Resolution.cost`)

    @property
    def name(self) -> str:
        return f"{self.method} {self.scheme}"


WAYS = (  # largest run: half a minute
    Way("following-p4", "radau", (8, 1600), 120e3),
    Way("following-p2", "gauss", (16, 4000), 320e3),
    Way("fourier-kink", "trapezoidal", (10, 1000), 100e3),
)


@dataclass(frozen=True, slots=True)
class Track:
    """When and where the mass passes the places."""

    k: Array  # (n,) places, in percent of the length
    t: Array  # (n,) [s]
    place: Array  # (n, 2) [m] x and y
    moved: Array  # (n, 2) [m] u and v
    end: str  # why it ends

    def gap(self, other: Track) -> Array:
        """(2, n) distances in place [m] and time [s]; nan where one is missing."""
        x, y, t = at(self.k, np.vstack([other.place.T, other.t]), other.k)
        return np.stack([np.hypot(self.place[:, 0] - x, self.place[:, 1] - y), np.abs(self.t - t)])


def at(k: Array, values: Array, known: Array) -> Array:
    """Values (m, n) at places k; nan where unknown."""
    out = np.full((values.shape[0], k.size), np.nan)
    _, i, j = np.intersect1d(k, known, return_indices=True)
    out[:, i] = values[:, j]
    return out


@dataclass(frozen=True, slots=True)
class Found:
    """The finest run of a way and its bars."""

    way: Way
    settings: dict[str, Any]
    track: Track
    bar: Array  # (2, n) of place [m] and time [s]; nan where coarser runs ended
    parts: tuple[float, float]  # largest over `scale`, of space and time, up to 0.95 of the way
    scale: float  # [m]

    def to(self, tol: float) -> float:
        return reach(self.track.k, self.bar[0] / self.scale, tol)


@dataclass(frozen=True, slots=True)
class Certificate:
    """The table and its sources."""

    scene: Scene
    found: tuple[Found, ...]  # the first is the answer
    bar: Array  # (2, n) of the answer: its own, or the larger distance to the second way
    gaps: tuple[Array, ...]  # (2, n) from the answer to each other way
    rows: list[Agreement] = field(default_factory=list)

    @property
    def answer(self) -> Found:
        return self.found[0]

    @property
    def verdict(self) -> str:
        return overall(self.rows).value

    def depth(self, tol: float) -> float:
        return reach(self.answer.track.k, self.bar[0] / self.answer.scale, tol)

    def write(self, folder: Path) -> None:
        """Write certificate.csv and certify.json."""
        write_table(folder / "certificate.csv", self)
        ways = [
            {"name": f.way.name, "settings": f.settings, "space": f.parts[0], "time": f.parts[1], "to": f.to(TOL),
             "reaches": f.track.k[-1] / 100.0, "end": f.track.end}
            for f in self.found
        ]  # fmt: skip
        table = {
            "s_o": (self.answer.track.k / 100.0).tolist(), "bar": (self.bar[0] / self.answer.scale).tolist(),
            "gaps": [(gap[0] / self.answer.scale).tolist() for gap in self.gaps],
        }  # fmt: skip
        content = {
            "verdict": self.verdict, "tol": TOL, "to": self.depth(TOL), "scale": self.answer.scale, "ways": ways,
            "table": table, "rows": [row.row() for row in self.rows],
        }  # fmt: skip
        write_json(folder / "certify.json", store.plain(content))


def certify(scene: Scene, out: Path | None = None, progress: Progress = silent) -> Certificate:
    """Compute the path by all ways with bars; compare them and the shipped table."""
    found = side_by_side([partial(climb, scene, way) for way in WAYS], progress)
    made = joined(scene, tuple(found))
    own = {found[0].way.name: found[0].bar}
    rows = [row for f in found[1:] for row in _rows(made, own, f.track, f.way.name, f.bar)]
    rows += [_string(scene, made.answer, f) for f in made.found if scene.drive.mode == "grip"]
    shipped = next((t for t in map(read_table, tables()) if t.scene == scene.to_toml()), None)
    if shipped is not None:
        rows += against(shipped, made)
    made = replace(made, rows=rows)
    if out is not None:
        made.write(out)
    return made


def joined(scene: Scene, found: tuple[Found, ...]) -> Certificate:
    """The first way's answer; its bar is at least its distance to the second."""
    gaps = tuple(found[0].track.gap(f.track) for f in found[1:])
    return Certificate(scene, found, np.maximum(found[0].bar, np.stack([nearby(gap) for gap in gaps[0]])), gaps)


# --- one way ----------------------------------------------------------------------------------------------------------
def climb(scene: Scene, way: Way, progress: Progress = silent) -> Found:
    """Refine space or steps, whichever matters more, until all bars but the last are met or work ends.

    Each part is the change from half of it, with the other at its finest.
    """
    method = find(way.method)
    space, most = method.resolution.setting, way.most
    first = {space: way.first[0], "steps": way.first[1], "scheme": way.scheme}
    if scene.drive.mode == "free":
        # a wave at release shifts the ride in time, depending on the elements next to the car
        first |= {"grading": 10.0} if method.wing == "elements" else {}
        most /= 4.0  # each zero of the slip is an event
    runs: dict[tuple[int, int], Track] = {}

    def ran(settings: dict[str, Any]) -> Track:
        key = settings[space], settings["steps"]
        if key not in runs:
            runs[key] = track(scene, method, settings)
        return runs[key]

    settings = method.settings(first)
    while True:
        fine = ran(settings)
        coarser = [[ran(refined(method, settings, **{of: share})) for share in (0.5, 0.25)] for of in ("space", "time")]
        found = _found(fine, coarser, way, {k: settings[k] for k in first}, (min(method.space_order, 1.5), 2.0))
        parts = dict(
            zip((space, "steps"), np.nan_to_num(found.parts, nan=math.inf, posinf=math.inf).tolist(), strict=True)
        )
        progress(way.name, 0.5, f"{settings[space]}/{settings['steps']}: {sum(found.parts):.1g}")
        # small parts are not refined
        finer = {k: settings | {k: 2 * settings[k]} for k in parts if parts[k] >= 0.1 * max(parts.values())}
        may = [k for k, x in finer.items() if x["steps"] * method.resolution.cost(x[space]) <= most]
        if sum(found.parts) <= AIM * TOL or not may:
            break
        settings = finer[max(may, key=lambda k: parts[k])]
    progress(way.name, 1.0)
    return found


def measured(scene: Scene, way: Way) -> Found:
    """The first run of a way with its bar."""
    return climb(scene, replace(way, most=0.0))


def _found(
    fine: Track, coarser: list[list[Track]], way: Way, settings: dict[str, Any], orders: tuple[float, float]
) -> Found:  # fmt: skip
    """A run with bars at all places, from runs with half and a quarter of space and steps."""
    scale = float(np.linalg.norm(fine.moved, axis=1).max())
    lefts = []
    for (half, quarter), order in zip(coarser, orders, strict=True):
        d = np.stack([nearby(gap) for gap in fine.gap(half)])
        before = np.nan_to_num(np.stack([nearby(at(fine.k, gap[None], half.k)[0]) for gap in half.gap(quarter)]))
        lefts.append(np.where(np.isnan(d), np.nan, left(d, before, (2.0, 2.0), order)))
    near = fine.k <= 0.95 * fine.k[-1]
    in_space, in_time = (float(np.max(part[0, near]) / scale) for part in lefts)
    return Found(way, settings, fine, lefts[0] + lefts[1], (in_space, in_time), scale)


def nearby(gap: Array) -> Array:
    """Largest value around each place; nan where that place has none."""
    padded = np.pad(np.nan_to_num(gap), NEARBY)
    largest = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEARBY + 1).max(axis=1)
    return np.where(np.isfinite(gap), largest, np.nan)


def reach(k: Array, bar: Array, tol: float) -> float:
    """Last place/length up to which all bars are within a tolerance, or 0."""
    good = np.logical_and.accumulate(bar <= tol)
    return float(k[good][-1] / 100.0) if good.any() else 0.0


def track(scene: Scene, method: Method, settings: dict[str, Any]) -> Track:
    """Run up to the slack onset and keep the passages; elastic law."""
    groups = scene.groups
    solver = method.build(groups, settings, model="full", load="mass", law="elastic")
    scheme = newmark.scheme(settings["scheme"])
    states: list[State] = []
    mark, before, end, work, cuts = 0, None, "it arrives", newmark.Work(), 0
    try:
        for x in newmark.integrate(solver, scheme, steps_of(solver, groups, settings), newton=NEWTON, work=work):
            place = solver.place(x)
            if work.rejected > cuts and 100.0 * place > LAST and groups.drive.mode == "haul":
                end = f"steps too long at s_o/l = {place:.3f}"
                break
            cuts = work.rejected
            if before is not None and solver.least_tension[0] < 0.0:
                end = f"slack cable at s_o/l = {place:.3f}"
                break
            passed = range(mark, math.floor(100.0 * place) + 1)
            states += _passages(solver, before, x, passed)
            mark, before = max(mark, passed.stop), x
    except StepFailure as error:
        end = f"{error.cause} at s_o/l = {solver.place(before) if before else 0.0:.3f}"
        if not states:
            raise
    seen = solver.observe(stacked(states), np.zeros(0), np.zeros(0, np.intp))
    l, tau, X = scene.length, scene.time_scale, scene.catenary
    s_o, moved = l * seen.s_o, l * seen.path
    rest = np.stack([X.x(s_o), X.y(s_o)], axis=1)
    return Track(np.round(100.0 * seen.s_o), tau * seen.t, rest + moved, moved, end)


def _passages(solver: Any, before: State | None, after: State, marks: range) -> Iterator[State]:
    """The states at places [percent] passed between two states."""
    for mark in marks:
        if before is not None and 100.0 * solver.place(before) < mark:
            yield _passage(solver, before, after, mark / 100.0)
        elif 100.0 * solver.place(after) == mark:
            yield after


def _passage(solver: Any, before: State, after: State, s_o: float) -> State:
    def ahead(t: float) -> float:
        return float(solver.place(between(before, after, t)) - s_o)

    if not ahead(after.t) > 0.0:
        return after
    return between(before, after, brentq(ahead, before.t, after.t, xtol=1e-15, rtol=1e-15))


# --- verdicts ---------------------------------------------------------------------------------------------------------
def _rows(made: Certificate, own: dict[str, Array], other: Track, party: str, bar: Array) -> Iterator[Agreement]:
    """Verdicts on another path and the times [s] of a free ride, where comparable over most of the way.

    own : bars of the answer by name; bar : the other's.
    """
    answer = made.answer
    bars, gap = own | {party: at(answer.track.k, bar, other.k)}, answer.track.gap(other)
    asked = [("path", answer.scale), ("instants", 1.0)][: 1 + (made.scene.drive.mode == "free")]
    for i, (quantity, unit) in enumerate(asked):
        allowed = np.sum([x[i] for x in bars.values()], axis=0)
        both = np.isfinite(gap[i]) & np.isfinite(allowed) & (answer.track.k > 0)
        if not both.any():
            yield Agreement(quantity, math.nan, nothing("no place that both reach"), party=party)
            continue
        at_most = int(np.argmax(np.where(both, gap[i] / np.maximum(allowed, 1e-300), -1.0)))
        parts = tuple(Part(name, float(x[i, at_most] / unit)) for name, x in bars.items())
        where = float(answer.track.k[at_most] / 100.0)
        yield Agreement(quantity, float(gap[i, at_most] / unit), Bound("error bars", parts), where, party=party)


def _string(scene: Scene, answer: Found, found: Found) -> Agreement:
    """Compare a way's settings on a taut string, with the same mass and travel, with the exact answer."""
    law, groups = "taut string", scene.groups
    motion = groups.motion
    assert motion is not None
    try:
        exact = moving_mass.solve(motion, mu=groups.mu, sigma=groups.sigma).path
        crossing = Crossing(
            name="", groups=level(motion, groups.mu, groups.sigma), travel=motion.position, exact=exact, until=0.95
        )  # fmt: skip
        path = crossed(crossing.groups, found.way.method, found.settings, **crossing.how)
        error = crossing.error(MassPath(*path))[0]
    except (ValueError, ArithmeticError) as why:
        return Agreement("path", math.nan, nothing(why), party=found.way.name, law=law)
    parts = (Part(f"{found.way.name} claims", max(TOL, sum(found.parts))),)
    return Agreement("path", error, Bound("own bar", parts), party=found.way.name, law=law)


# --- tables -----------------------------------------------------------------------------------------------------------
COLUMNS = "s_o/l,t,x,y,u,v,bar,bar_t"


@dataclass(frozen=True, slots=True)
class Table:
    name: str
    scene: str  # its TOML
    track: Track
    bar: Array  # (2, n) [m], [s]
    scale: float  # [m]


def tables() -> list[Path]:
    folder = resources.files("validation.commands.certify") / "tables"
    return sorted(Path(str(file)) for file in folder.iterdir() if file.name.endswith(".csv"))


def write_table(file: Path, made: Certificate) -> None:
    """Write t, x, y (down), u, v at s_o/l = k/100 with bars [m] and [s], after their sources.

    Bars include the rounding of the digits.
    """
    a = made.answer
    digits = max(0, math.ceil(-math.log10(0.01 * TOL * a.scale)))
    bars = made.bar + 0.5 * np.array([[10.0**-digits], [10.0 ** -(digits + 3)]])
    lines = [
        f"path of the mass, certified to {TOL:g} of {a.scale:.6g} m for s_o/l up to {made.depth(TOL):.2f}",
        f"{'; '.join(_told(f) for f in made.found)}",
        f"ends: {a.track.end}",
        "t in s, lengths in m, y and v down; bar: x, y, u, v within it at that s_o; bar_t: of t", "scene:",
        *made.scene.to_toml().splitlines(),
    ]  # fmt: skip
    with whole(file) as temporary, temporary.open("w", encoding="utf-8") as out:
        out.writelines(f"# {line}".rstrip() + "\n" for line in lines)
        out.write(COLUMNS + "\n")
        of = a.track.k, a.track.t, a.track.place, a.track.moved, *bars
        for k, t, xy, uv, bar, bar_t in zip(*of, strict=True):
            if np.isfinite(bar):
                values = ",".join(f"{x:.{digits}f}" for x in (*xy, *uv))
                out.write(f"{k / 100.0:.2f},{t:.{digits + 3}f},{values},{bar:.1e},{bar_t:.1e}\n")


def _told(f: Found) -> str:
    return f"{f.way.method} {', '.join(f'{k} {v}' for k, v in f.settings.items())}"


def read_table(file: Path) -> Table:
    """Read what `write_table` wrote."""
    lines = file.read_text(encoding="utf-8").splitlines()
    notes = [line[1:].removeprefix(" ") for line in lines if line.startswith("#")]
    toml = "\n".join(notes[notes.index("scene:") + 1 :]) + "\n"
    data = np.array([[float(x) for x in line.split(",")] for line in lines[len(notes) + 1 :]])
    scale = float(notes[0].split(" of ")[2].split()[0])
    end = next(note.removeprefix("ends: ") for note in notes if note.startswith("ends: "))
    track = Track(np.round(100.0 * data[:, 0]), data[:, 1], data[:, 2:4], data[:, 4:6], end)
    # rewritten, as the order of tables may differ
    return Table(file.stem, Scene.from_toml(toml).to_toml(), track, data[:, 6:].T, scale)


def against(table: Table, made: Certificate) -> list[Agreement]:
    """Compare with a table: place and time may differ by both bars."""
    return list(_rows(made, {"answer": made.bar}, table.track, "shipped table", table.bar))


def shown(made: Certificate, tols: Sequence[float] = (1e-4, 1e-5, 1e-6)) -> list[list[str]]:
    """Range of each way, and of the answer."""
    rows = [
        [f.way.name, *(str(v) for v in list(f.settings.values())[:2]), *(f"{p:.1e}" for p in f.parts),
         *(f"{reach(f.track.k, f.bar[0] / f.scale, tol):.2f}" for tol in tols), f.track.end]
        for f in made.found
    ]  # fmt: skip
    return [*rows, ["table", "", "", "", "", *(f"{made.depth(tol):.2f}" for tol in tols), made.answer.track.end]]
