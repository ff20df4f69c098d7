"""The path of the mass as deep as it goes, place by place, by three ways.

Two discretisations of the element wing differ in degree and in scheme; the Galerkin wing shares scene and time driver
alone with them.  Each is refined until its own bars are met or its limit of work is reached.  Where the car grips the
cable, the same settings are also held against the exact answer on a taut string.
A free ride's path is compared over place; when it passes a place is an answer with a bar of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
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
from validation.core.ladder import left
from validation.core.methods import Method, find, refined
from validation.core.running import steps_of
from validation.core.sampling import stacked
from validation.core.sidebyside import side_by_side
from validation.oracles import moving_mass
from validation.oracles.case import Crossing, level
from validation.oracles.case import Path as MassPath

TOL = 1e-6  # of the largest deflection
PLACES = 101  # s_o/l = 0, 0.01, ... 1
NEWTON = Newton(tol=1e-8)  # what Newton's method leaves adds up over the steps
TIME_ORDER = 2.0  # the most that is credited in time
AIM = 0.4  # of the tolerance: two ways' bars
LAST = 95  # place beyond which changes show no order, and a step that is cut ends a hauled car's way
NEARBY = 5  # places on either side whose gaps count too: a gap that passes through zero is no small error

Progress = Callable[..., None]


@dataclass(frozen=True, slots=True)
class Way:
    """A method with a scheme, where its ladder begins, and the most work of one run."""

    method: str
    scheme: str
    first: tuple[int, int]  # resolution and steps
    most: float  # steps, times what each costs (`Resolution.cost`)

    @property
    def name(self) -> str:
        return f"{self.method} {self.scheme}"


WAYS = (  # half a minute each for the largest run
    Way("following-p4", "radau", (8, 1600), 120e3),
    Way("following-p2", "gauss", (16, 4000), 320e3),
    Way("fourier-kink", "trapezoidal", (10, 1000), 100e3),
)
FREE = 4.0  # times the work of a step: slip that rings crosses zero, and every crossing is an event
# The wave of a car that is let go shifts the whole ride in time, by what the elements next to the car make of it.
AT_CAR = {"grading": 10.0}


@dataclass(frozen=True, slots=True)
class Track:
    """Where a run has the mass as it passes the places, and where it ended."""

    k: Array  # (n,) places, in hundredths of the length
    t: Array  # (n,) [s]
    place: Array  # (n, 2) [m] x and y
    moved: Array  # (n, 2) [m] u and v
    end: str  # why it goes no further

    def gap(self, other: Track) -> Array:
        """Return (2, n), distances at the places [m] and in time [s]; nan where the other is not."""
        x, y, t = at(self.k, np.vstack([other.place.T, other.t]), other.k)
        return np.stack([np.hypot(self.place[:, 0] - x, self.place[:, 1] - y), np.abs(self.t - t)])


def at(k: Array, values: Array, known: Array) -> Array:
    """Return at places k what is known (m, n) at others; nan where it is not."""
    out = np.full((values.shape[0], k.size), np.nan)
    _, i, j = np.intersect1d(k, known, return_indices=True)
    out[:, i] = values[:, j]
    return out


@dataclass(frozen=True, slots=True)
class Found:
    """The finest run of a way and its own bars at every place."""

    way: Way
    settings: dict[str, Any]
    track: Track
    bar: Array  # (2, n) of the place [m] and its instant [s]; nan where its companions did not come
    parts: tuple[float, float]  # the largest over `scale`, of space and time, over 0.95 of the way
    scale: float  # [m]

    def to(self, tol: float) -> float:
        return reach(self.track.k, self.bar[0] / self.scale, tol)


@dataclass(frozen=True, slots=True)
class Certificate:
    """The table, and what it was made of."""

    scene: Scene
    found: tuple[Found, ...]  # the first is the answer
    bar: Array  # (2, n) of the answer: its own, or the distance to the second way where that is larger
    gaps: tuple[Array, ...]  # (2, n) from the answer to each of the other ways
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


def certify(scene: Scene, out: Path | None = None, progress: Progress | None = None) -> Certificate:
    """Compute the path by all ways, with bars, and hold them against each other and the shipped table."""
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
    """Return the certificate: the first way's answer, its bar no less than its distance to the second one."""
    gaps = tuple(found[0].track.gap(f.track) for f in found[1:])
    return Certificate(scene, found, np.maximum(found[0].bar, np.stack([nearby(gap) for gap in gaps[0]])), gaps)


# --- one way ----------------------------------------------------------------------------------------------------------
def climb(scene: Scene, way: Way, progress: Progress = lambda *told: None) -> Found:
    """Refine what leaves more, space or steps, until all bars but those near the end are met, as far as it may go.

    Each part is the change from half of it at the finest of the other.
    """
    method, free = find(way.method), scene.drive.mode == "free"
    space, at_car = method.resolution.setting, free and method.wing == "elements"
    first = {space: way.first[0], "steps": way.first[1], "scheme": way.scheme} | (AT_CAR if at_car else {})
    most = way.most / (FREE if free else 1.0)
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
        found = _found(fine, coarser, way, {k: settings[k] for k in first}, (min(method.space_order, 1.5), TIME_ORDER))
        parts = dict(zip((space, "steps"), (x if math.isfinite(x) else math.inf for x in found.parts), strict=True))
        progress(way.name, 0.5, f"{settings[space]}/{settings['steps']}: {sum(found.parts):.1g}")
        # a part far below the other is not worth a run
        finer = {k: settings | {k: 2 * settings[k]} for k in parts if parts[k] >= 0.1 * max(parts.values())}
        may = [k for k, x in finer.items() if x["steps"] * method.resolution.cost(x[space]) <= most]
        if sum(found.parts) <= AIM * TOL or not may:
            break
        settings = finer[max(may, key=lambda k: parts[k])]
    progress(way.name, 1.0)
    return found


def measured(scene: Scene, way: Way) -> Found:
    """Return the first run of a way with its bar, no refinement."""
    return climb(scene, replace(way, most=0.0))


def _found(
    fine: Track, coarser: list[list[Track]], way: Way, settings: dict[str, Any], orders: tuple[float, float]
) -> Found:  # fmt: skip
    """Return a run with its bars, place by place, by runs with half and a quarter of the space and of the steps."""
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
    """Return at each place the largest value of the places around it; nan where that place has none."""
    padded = np.pad(np.nan_to_num(gap), NEARBY)
    largest = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEARBY + 1).max(axis=1)
    return np.where(np.isfinite(gap), largest, np.nan)


def reach(k: Array, bar: Array, tol: float) -> float:
    """Return the last place, over the length, to which all bars are within a tolerance; 0 if none is."""
    good = np.logical_and.accumulate(bar <= tol)
    return float(k[good][-1] / 100.0) if good.any() else 0.0


def track(scene: Scene, method: Method, settings: dict[str, Any]) -> Track:
    """March up to the slack onset, keeping the passages of the places only; elastic law."""
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
            passed = range(mark, min(PLACES, math.floor(100.0 * place) + 1))
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
    """Give the states at the places [hundredths] that the mass passes from one state to the next."""
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
    """Give the verdicts on another path and, of a free ride, its instants [s], where they fill most of what is allowed.

    own : the bar that counts of the answer, by its name; bar : the other's.
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
    """Hold a way's settings, on a taut string under the same mass and travel, against the exact answer."""
    law, groups = "taut string", scene.groups
    motion = groups.motion
    assert motion is not None
    try:
        travel = moving_mass.travel_of(motion)
        exact = moving_mass.solve(travel, mu=groups.mu, sigma=groups.sigma).path
        crossing = Crossing(
            name="", groups=level(motion, groups.mu, groups.sigma), travel=travel.position, exact=exact, until=0.95
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
    """A table that was written."""

    name: str
    scene: str  # its TOML
    track: Track
    bar: Array  # (2, n) [m], [s]
    scale: float  # [m]


def tables() -> list[Path]:
    """Return the tables that are shipped."""
    folder = resources.files("validation.commands.certify") / "tables"
    return sorted(Path(str(file)) for file in folder.iterdir() if file.name.endswith(".csv"))


def write_table(file: Path, made: Certificate) -> None:
    """Write t, x, y (down), u, v at s_o/l = k/100 with bars [m] and [s]; before them all that they are made of.

    Digits end a hundredth below the tolerance; bars hold what that rounds.
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
    # as the scene writes itself today: the order of its tables may be another one
    return Table(file.stem, Scene.from_toml(toml).to_toml(), track, data[:, 6:].T, scale)


def against(table: Table, made: Certificate) -> list[Agreement]:
    """Hold a certificate against a table: no place, nor its instant, may differ by more than both bars."""
    return list(_rows(made, {"answer": made.bar}, table.track, "shipped table", table.bar))


def shown(made: Certificate, tols: Sequence[float] = (1e-4, 1e-5, 1e-6)) -> list[list[str]]:
    """Return how far each way gets, and the answer."""
    rows = [
        [f.way.name, *(str(v) for v in list(f.settings.values())[:2]), *(f"{p:.1e}" for p in f.parts),
         *(f"{reach(f.track.k, f.bar[0] / f.scale, tol):.2f}" for tol in tols), f.track.end]
        for f in made.found
    ]  # fmt: skip
    return [*rows, ["table", "", "", "", "", *(f"{made.depth(tol):.2f}" for tol in tols), made.answer.track.end]]
