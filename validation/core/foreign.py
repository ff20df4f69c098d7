"""Another program's mass path, from a CSV file or arrays, in the form our measures compare.

Columns have the names of our path.csv, with an ending for another unit or direction:

    t or time [s]          t or s_o suffices: the scene's travel gives the other
    s_o       [m]          place of the mass on the cable
    v or y    [m]          positive down; from the static cable or the left support
    u or x    [m]          optional
    T_behind, T_ahead [N]  optional
    speed     [m/s]        optional, |dp/dt|, of a free ride

A free ride needs t, s_o or x, and v or y.

Endings: _over_l (of the cable's length), _mm, _km, _ms, _kN, _kmh, _up; _s, _m, _N and _down change nothing.
"""

import csv
import itertools
import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NoReturn, Self

import numpy as np

from cablefem.response import Array, Response, write_csv
from cablefem.scene import Scene
from validation.core import measures
from validation.core.agreement import Agreement, Verdict
from validation.core.bounds import Bound, Part, nothing
from validation.core.ladder import Ladder
from validation.core.measures import WINDOW, NotComparable, Window
from validation.core.rows import happened
from validation.core.store import Refused

WITH_TOL = 5e-3  # of the largest deflection, allowed beside our own bar
LEAST_ROWS = 5  # in the window
TRAVEL_TOLERANCE = 5e-3  # of l: programs may round the place to a node

_NAME = re.compile(
    r"(t_behind|t_ahead|time|t|s_o|u|v|x|y|speed)(_over_l|/l|_mm|_kmh|_km|_ms|_kn|_s|_m|_n)?(_down|_up)?", re.IGNORECASE
)
_QUANTITIES = {"time": "t", "t_behind": "T_behind", "t_ahead": "T_ahead"}  # others are named as in a file
_COLUMNS = ("t", "s_o", "x", "y", "u", "v", "T_behind", "T_ahead", "speed")


@dataclass(frozen=True, slots=True)
class ForeignPath:
    """A third party's mass path in SI, v down, with what path measures read of a `Response`; arrays (n,)."""

    method: str  # name in verdicts
    length: float  # l [m]
    t: Array  # [s], strictly increasing
    s_o: Array  # [m]
    v: Array  # [m]
    u: Array | None = None  # [m]
    T_behind: Array | None = None  # [N] or nan
    T_ahead: Array | None = None
    x: Array | None = None  # [m] from the left support
    y: Array | None = None  # [m]
    speed: Array | None = None  # [m/s]
    factor: float = 1.0  # applied to the given v (free ride: y)
    slack_onset: float | None = None  # s_o/l; files do not tell
    drive: str = "grip"
    events: tuple[()] = ()

    path_scale, path_scale_named = Response.path_scale, Response.path_scale_named

    @property
    def reached(self) -> float:
        return float(self.s_o[-1] / self.length)

    @property
    def max_deflection(self) -> float:
        return float(self.v.max())

    @classmethod
    def of(
        cls, scene: Scene, s_o: Any = None, v: Any = None, u: Any = None, *, t: Any = None, x: Any = None,
        y: Any = None, name: str = "the other solver",
    ) -> Self:  # fmt: skip
        """The path v(s_o) [m], v down; t [s] by the scene's travel unless given.  A free ride needs x, y(t).

        Raises Refused.
        """
        columns = {"s_o": s_o, "v": v, "u": u, "t": t, "x": x, "y": y}
        try:
            arrays = {k: np.asarray(x, dtype=float) for k, x in columns.items() if x is not None}
        except (TypeError, ValueError) as error:
            raise Refused(f"{name}: {error}") from None
        shapes = {x.shape for x in arrays.values()}
        if len(shapes) != 1 or len(*shapes) != 1:
            raise Refused(f"{name}: {', '.join(arrays)} must be columns of one length, got shapes {sorted(shapes)}")
        for k, given in arrays.items():
            if not np.isfinite(given).all():
                raise Refused(f"{name}: {k}[{int(np.argmin(np.isfinite(given)))}] is not a finite number")
        return cls(**_completed(scene, _Given(name, arrays, {}, range(*shapes.pop()))))

    @classmethod
    def read(cls, file: str | Path, scene: Scene) -> Self:
        """The path in a CSV file (comma, semicolon or tab; # begins a comment line).

        Raises Refused with one line per fault.
        """
        return cls(**_completed(scene, _read(Path(file), scene)))

    def write(self, file: Path) -> None:
        columns = {k: x for k in _COLUMNS if (x := getattr(self, k)) is not None}
        write_csv(file, ",".join(columns), np.stack(list(columns.values()), axis=1))


@dataclass(frozen=True, slots=True)
class _Given:
    """The columns of a third party, in SI."""

    name: str
    x: dict[str, Array]
    factor: dict[str, float]  # applied to a file's numbers
    numbers: Sequence[int]  # of the rows
    row: str = "row"

    def refuse(self, said: str) -> NoReturn:
        raise Refused(f"{self.name}: {said}")

    def lengths(self, quantity: str, l: float) -> dict[str, float]:
        """Possible names of a column of lengths, with factors on its numbers."""
        ends = {"": 1.0, "_over_l": l, "_mm": 1e-3, "_km": 1e3}
        return {quantity + end: unit / self.factor.get(quantity, 1.0) for end, unit in ends.items()}


def _read(file: Path, scene: Scene) -> _Given:
    try:
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else "not text in UTF-8"
        raise Refused(f"{file}: cannot be read ({why})") from None
    lines = [(n, line.strip()) for n, line in enumerate(text.splitlines(), 1) if line.strip()]
    head = _head([line for _, line in lines])
    if head is None:
        raise Refused(f"{file.name}: the file is empty")
    header, separator = _cells(lines[head][1]), _separator(lines[head][1])
    rows = [(n, _cells(line, separator)) for n, line in lines[head + 1 :] if line[0] != "#"]
    known = {i: _told(name, scene.length) for i, name in enumerate(header) if _NAME.fullmatch(name)}
    place = {quantity: i for i, (quantity, _) in known.items()}
    faults = _of_names(header, [quantity for quantity, _ in known.values()], rows, scene)
    faults = faults or list(_of_cells(header, place, rows))
    if faults:
        more = [f"and {len(faults) - 5} more cells like these"] if len(faults) > 5 else []
        raise Refused([f"{file.name}: {fault}" for fault in faults[:5] + more])
    factor = {quantity: known[i][1] for quantity, i in place.items()}
    x = {quantity: factor[quantity] * np.array([_number(row[i]) for _, row in rows]) for quantity, i in place.items()}
    return _Given(file.name, x, factor, [n for n, _ in rows], "line")


def _head(lines: list[str]) -> int | None:
    """Which line names the columns: the first without #, or one with # and a known name."""
    named = (line[0] != "#" or any(map(_NAME.fullmatch, _cells(line))) for line in lines)
    return next((i for i, found in enumerate(named) if found), None)


def _told(column: str, l: float) -> tuple[str, float]:
    """The quantity of a column, and the factor that gives SI and v down."""
    quantity, unit, way = _NAME.fullmatch(column.lower()).groups()  # type: ignore[union-attr]
    factors = {"_over_l": l, "/l": l, "_mm": 1e-3, "_km": 1e3, "_ms": 1e-3, "_kn": 1e3, "_kmh": 1.0 / 3.6}
    return _QUANTITIES.get(quantity, quantity), factors.get(unit, 1.0) * (-1.0 if way == "_up" else 1.0)


def _of_names(header: list[str], found: list[str], rows: list[Any], scene: Scene) -> list[str]:
    """Faults in the names of the columns; `found` are their known quantities."""
    if all(math.isfinite(_number(cell)) for cell in header):
        return ["line 1: numbers where the names of the columns should stand, e.g. t,s_o,u,v"]
    if not rows:
        return ["no rows below the names of the columns"]
    names = {q: [name for name in header if _NAME.fullmatch(name) and _told(name, 1.0)[0] == q] for q in found}
    faults = [f"columns {' and '.join(x)} both say {q}; leave one" for q, x in names.items() if len(x) > 1]
    have = f"it has {', '.join(header)}"
    if not {"v", "y"} & names.keys():
        faults.append(f"no column v (deflection of the mass [m], positive down); {have}")
    if scene.drive.mode != "free" and not {"t", "s_o"} & names.keys():
        faults.append(f"neither a column t [s] nor s_o [m]; {have}")
    return faults


def _of_cells(header: list[str], place: dict[str, int], rows: list[Any]) -> Iterator[str]:
    for n, row in rows:
        if len(row) != len(header):
            yield f"line {n}: {len(row)} cells under {len(header)} names of columns"
            continue
        for quantity, i in place.items():
            if not (math.isfinite(_number(row[i])) or (quantity.startswith("T_") and not row[i])):
                hint = " (a decimal comma? write a point)" if "," in row[i] else ""
                yield f"line {n}: {header[i]} = {row[i]!r} is no number{hint}"


def _separator(line: str) -> str:
    return max(",;\t", key=line.count)


def _cells(line: str, separator: str | None = None) -> list[str]:
    cells = next(csv.reader([line.lstrip("# \t")], delimiter=separator or _separator(line)))
    return [cell.strip() for cell in cells]


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


# --- completing, and refusing names that the numbers contradict -------------------------------------------------------


def _completed(scene: Scene, given: _Given) -> dict[str, Any]:
    """Fields of a `ForeignPath`."""
    free = scene.drive.mode == "free"
    if scene.groups.motion is None and not free:
        raise Refused(f"scene {scene.name} has no travelling mass: there is no path to compare")
    if free and not ("t" in given.x and given.x.keys() & {"s_o", "x"} and given.x.keys() & {"v", "y"}):
        given.refuse(f"a free ride needs t, s_o or x, and v or y; it has {', '.join(given.x)}")
    _rises(given, "t" if "t" in given.x else "s_o")
    x = _placed(scene, given)
    rest = {"x": scene.catenary.x(x["s_o"]), "y": scene.catenary.y(x["s_o"])}
    for moved, at in (("u", "x"), ("v", "y")):
        if moved in x:
            x.setdefault(at, rest[at] + x[moved])
        elif at in x:
            x[moved] = x[at] - rest[at]
    low, high = measures.WINDOWS[scene.drive.mode]
    place = x["s_o"] / scene.length
    within = int(np.count_nonzero((place >= low) & (place <= high * (1.0 + 1e-12))))
    if within < LEAST_ROWS:
        covers = f"s_o/l = {place[0]:.4g} to {place[-1]:.4g}" if place.size else "no time of the travel"
        given.refuse(
            f"{within} rows in s_o/l = {low:g} to {high:g}, where paths are compared; "
            f"{LEAST_ROWS} are needed (it covers {covers})"
        )
    factor = given.factor.get("y" if free and "y" in given.x else "v", 1.0)
    return {"method": given.name, "length": scene.length, "drive": scene.drive.mode, "factor": factor, **x}


def _rises(given: _Given, clock: str) -> None:
    values, unit = given.x[clock], "s" if clock == "t" else "m"
    back = np.flatnonzero(np.diff(values) <= 0.0)
    if back.size:
        i = int(back[0])
        given.refuse(
            f"{given.row} {given.numbers[i + 1]}: {clock} = {values[i + 1]:.6g} {unit} does not come after "
            f"{values[i]:.6g} {unit} in the {given.row} before; {clock} must increase"
        )


def _placed(scene: Scene, given: _Given) -> dict[str, Array]:
    """Columns with t and s_o, up to the end of the travel."""
    motion, l, tau, x = scene.groups.motion, scene.length, scene.time_scale, dict(given.x)
    if motion is None:
        s = np.linspace(0.0, l, 2001)
        x.setdefault("s_o", np.interp(x.get("x", s[:1]), scene.catenary.x(s), s))
        _on_cable(x["s_o"], float(x["s_o"].max()), given, l)
        return x
    if "t" not in x:
        _on_cable(x["s_o"], float(x["s_o"][-1]), given, l)
        x["t"] = tau * motion.times_at(np.clip(x["s_o"] / l, motion.begin, motion.end))
    elif "s_o" in x:
        _fits_travel(scene, given)
    else:
        x["s_o"] = l * motion.position(x["t"] / tau)
    on_the_way = x["t"] <= tau * motion.phases[-1][1] * (1.0 + 1e-9)
    return {k: a[on_the_way] for k, a in x.items()}


def _fits_travel(scene: Scene, given: _Given) -> None:
    """Refuse s_o(t) that is not the scene's travel; name units that would fit."""
    motion, l, tau, t, s_o = scene.groups.motion, scene.length, scene.time_scale, given.x["t"], given.x["s_o"]
    assert motion is not None
    end, now = tau * motion.phases[-1][1], given.factor.get("t", 1.0)

    def misfit(time: float, place: float) -> Array:
        # the scene's mass stays at the end
        return np.abs(np.minimum(place * s_o / l, motion.end) - motion.position(time * t / tau))

    off = misfit(1.0, 1.0)
    if off.max() <= TRAVEL_TOLERANCE:
        return
    times = {"t": 1.0 / now, "t_ms": 1e-3 / now, f"t over {tau:.6g} s = l sqrt(rho/H)": tau / now}
    for (as_t, time), (as_s, place) in itertools.product(times.items(), given.lengths("s_o", l).items()):
        # a mass at rest or past its arrival fits any travel
        moving = np.count_nonzero((place * s_o > WINDOW[0] * l) & (time * t < end))
        if moving >= LEAST_ROWS and misfit(time, place).max() <= TRAVEL_TOLERANCE:
            given.refuse(f"t and s_o are the scene's travel as {as_t} and {as_s}: name or convert them so")
    i = int(np.argmax(off))
    given.refuse(
        f"t and s_o are not the scene's travel: at t = {t[i]:.6g} s it has s_o/l = {s_o[i] / l:.4g}, "
        f"the scene {motion.position(t[i] / tau):.4g}"
    )


def _on_cable(s_o: Array, last: float, given: _Given, l: float) -> None:
    """Refuse s_o that leaves the cable; propose a unit."""
    if s_o.min() >= -TRAVEL_TOLERANCE * l and WINDOW[0] < last / l <= 1.0 + TRAVEL_TOLERANCE:
        return
    ends = {unit * last / l: column for column, unit in given.lengths("s_o", l).items()}
    fits = [end for end in ends if 0.1 < end <= 1.0 + TRAVEL_TOLERANCE]
    hint = f"; name the column {ends[max(fits)]}?" if fits else ""
    given.refuse(f"s_o runs from {s_o[0]:.6g} to {s_o[-1]:.6g} m on a cable of {l:.6g} m{hint}")


def refuse_misnamed(path: ForeignPath | Response, ours: Response) -> None:
    """Raise Refused if v (free ride: y) is far off as named but agrees in another unit or sign.

    ours : a run good to a few percent.
    """
    of = "y" if ours.drive == "free" else "v"
    given = _Given(path.method, {}, {of: getattr(path, "factor", 1.0)}, ())
    units = given.lengths(of, path.length)
    units |= {f"{column}_up": -unit for column, unit in units.items()}
    try:
        window = _common(path, measures.window_of(ours))

        def off(factor: float) -> float:
            other = replace(path, **{of: factor * getattr(path, of)})
            return measures.path_gap(_vertical(other), _vertical(ours), window)[1]

        as_named, (gap, column) = off(1.0), min((off(factor), column) for column, factor in units.items())
    except NotComparable:
        return
    if as_named > 0.2 and gap < 0.1:
        what = f"{of} points the other way" if units[column] < 0.0 else f"{of} is in another unit"
        given.refuse(
            f"{what}: as {column} it would be {gap:.2%} off (rms), as it is named "
            f"{as_named:.3g} times {ours.path_scale_named}; name it {column}"
        )


def _vertical(r: Any) -> Any:
    return replace(r, u=np.zeros_like(r.v), x=np.zeros_like(r.v))


def comparable(a: Any, b: Any) -> tuple[Any, Any]:
    """Both paths, without u if one lacks it."""
    return (a, b) if a.u is not None and b.u is not None else (_vertical(a), _vertical(b))


def _common(path: ForeignPath | Response, window: Window) -> Window:
    if path.drive == "free":
        return window
    start, stop = max(window[0], float(path.s_o[0] / path.length)), min(window[1], path.reached)
    if not start < stop:
        covered = f"{path.s_o[0] / path.length:.4g} to {path.reached:.4g}"
        raise NotComparable(f"it covers s_o/l = {covered}, our own answers {window[0]:.4g} to {window[1]:.4g}")
    return start, stop


def mass_tension_gap(a: Any, b: Any, window: Window, H: float) -> float:
    """Rms gap of both tensions at the mass over the window, over H."""
    return measures.series_gap(a, b, window, lambda r: np.stack([r.T_behind, r.T_ahead], axis=1) / (math.sqrt(2.0) * H))


Apart = Callable[[Any, Any], float]


def rows(path: ForeignPath | Response, ours: Ladder, window: Window, with_tol: float) -> Iterator[Agreement]:
    """Compare a foreign path with an estimated run; allowed is our bar plus `with_tol`.

    A path that covers less than the window is "not comparable".
    """
    party, run = path.method, ours.run
    try:
        part = _common(path, window)
        where = measures.place_of_gap(*comparable(path, run), part)
        measures.path_gap(*comparable(path, run), part)  # fails where they have too little in common
    except NotComparable as reason:
        yield Agreement("path_max", math.nan, nothing(f"{party}: {reason}"), party=party)
        return
    short = _short(path, run, window)
    kind = "covers less" if short else "foreign"
    allowed = Part(f"allowed to {party}", with_tol)
    found = []
    for name, (apart, components) in _measures(path, run, part).items():
        bars = Part(run.method, ours.bar(lambda r: r, apart), "its error bar"), allowed
        bound = Bound(kind, bars, {"party": party, "components": components, **short})
        found.append(Agreement(name, apart(path, run), bound, where if name == "path_max" else None, party))
    of_path = found[:2]
    if any(row.verdict is Verdict.DISAGREE for row in of_path):
        from validation.core.remedy import remedy  # seldom needed

        said = remedy(
            path, run, lambda x: measures.path_gap(*comparable(x, run), part), (of_path[0].allowed, of_path[1].allowed)
        )
        of_path = [replace(row, bound=replace(row.bound, notes=(said,) if said else ())) for row in of_path]
    yield from [*of_path, *found[2:]]


def _measures(path: ForeignPath | Response, run: Response, part: Window) -> dict[str, tuple[Apart, str]]:
    """The comparable quantities, path first: a distance of two answers, and the components that it takes."""
    free = run.drive == "free"
    seen: Callable[[Any], Any] = _vertical if path.u is None else lambda r: r
    along, upright = ("x", "y") if free else ("u", "v")
    components = f"{upright} alone" if path.u is None else f"{along} and {upright}"

    def of_path(a: Any, b: Any, i: int) -> float:
        return measures.path_gap(seen(a), seen(b), part)[i]

    found: dict[str, tuple[Apart, str]] = {
        "path_max": (partial(of_path, i=0), components), "path_rms": (partial(of_path, i=1), components)
    }  # fmt: skip
    if free and path.speed is not None:
        stop, top = happened("stop", run), float(run.speed.max())
        until = math.inf if stop is None else stop["t"]

        def speed(r: Any) -> Array:
            return np.where(r.t <= until, r.speed, math.nan) / top

        found["speed"] = lambda a, b: measures.series_gap(a, b, part, speed, largest=True), "speed, of the largest"
    if path.T_behind is not None and path.T_ahead is not None:
        H = run.horizontal_tension
        found["tension"] = lambda a, b: mass_tension_gap(a, b, part, H), "tension at the mass, both sides"
    return found


def _short(path: ForeignPath | Response, run: Response, window: Window) -> dict[str, Any]:
    """The part of the window that a path covers, if not all; else {}."""
    axis, at, wanted = "s_o/l", path.s_o / path.length, window
    if run.drive == "free":
        axis, at, wanted = "t [s]", path.t, (0.0, float(run.t[-1]))
    step = TRAVEL_TOLERANCE * wanted[1] + float(np.diff(at).max())
    low, high = max(wanted[0], float(at[0])), min(wanted[1], float(at[-1]))
    if low <= wanted[0] + step and high >= wanted[1] - step:
        return {}
    return {"axis": axis, "low": low, "high": high, "start": wanted[0], "stop": wanted[1]}
