"""Another program's mass path, from a CSV file or from numbers, in a form that our measures compare.

Columns are named as in our own path.csv, with an ending where the unit is not SI or the direction is up:

    t         [s]   time                          t and s_o: one suffices, the scene's travel ties them together
    s_o       [m]   place of the mass on the cable
    v or y    [m]   of the mass, positive down    v from the static cable, y from the left support
    u or x    [m]   optional
    T_behind, T_ahead  [N]  optional, tension at the mass
    speed     [m/s] optional, |dp/dt|, of a free ride

A free ride is compared over time, its travel being an answer: t, s_o or x, and v or y.

Endings: _over_l (of the length of the cable), _mm, _km, _ms, _kN, _kmh, and _up; also _s, _m, _N and _down, which
change nothing.  A name and its numbers that contradict one another are refused with the name that would fit.
"""

import csv
import itertools
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from cablefem.response import Array, Response, write_csv
from cablefem.scene import Scene
from validation.core import measures
from validation.core.agreement import Agreement, happened
from validation.core.bounds import Bound, Part, nothing
from validation.core.estimate import Estimated
from validation.core.measures import WINDOW, NotComparable, Window
from validation.core.store import Refused

WITH_TOL = 5e-3  # allowed to a third party, relative to the largest deflection, beside our own error bar
LEAST_ROWS = 5  # in the window; fewer say nothing about a path
TRAVEL_TOLERANCE = 5e-3  # of l: a mass that hops from node to node rounds its place to a node
MOST_FAULTS = 5  # lines about one file

_NAME = re.compile(
    r"(t_behind|t_ahead|time|t|s_o|u|v|x|y|speed)(_over_l|/l|_mm|_kmh|_km|_ms|_kn|_s|_m|_n)?(_down|_up)?"
)
_FACTOR = {"_mm": 1e-3, "_km": 1e3, "_ms": 1e-3, "_kn": 1e3, "_kmh": 1.0 / 3.6}


@dataclass(frozen=True, slots=True)
class ForeignPath:
    """A mass path that none of our solvers computed; SI, v down, enough of a `Response` for path measures."""

    method: str  # its name in verdicts
    length: float  # l [m]
    t: Array  # (n,) [s], strictly increasing
    s_o: Array  # (n,) [m]
    v: Array  # (n,) [m]
    u: Array | None = None  # (n,) [m]
    T_behind: Array | None = None  # (n,) [N] nan where there is none
    T_ahead: Array | None = None
    x: Array | None = None  # (n,) [m] from the left support
    y: Array | None = None  # (n,) [m]
    speed: Array | None = None  # (n,) [m/s]
    factor: float = 1.0  # what the numbers given for v, of a free ride for y, were multiplied by
    slack_onset: float | None = None  # s_o/l, as in `Response`; foreign files do not say
    blur: float = 0.0  # as in `Response`
    drive: str = "grip"
    events: tuple[()] = ()  # nor these

    path_scale, path_scale_named = Response.path_scale, Response.path_scale_named

    @property
    def reached(self) -> float:
        """s_o/l of the last row."""
        return float(self.s_o[-1] / self.length)

    @property
    def max_deflection(self) -> float:
        """Largest v [m]."""
        return float(self.v.max())

    @classmethod
    def of(
        cls, scene: Scene, s_o: Any = None, v: Any = None, u: Any = None, *, t: Any = None, x: Any = None,
        y: Any = None, name: str = "the other solver",
    ) -> Self:  # fmt: skip
        """Return the path v(s_o) in [m], v down; t [s] from the scene's travel unless given.  Of a free ride x, y(t).

        Raises Refused with one line per fault.
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
        return cls._built(scene, arrays, {}, name, list(range(*shapes.pop())), "row")

    @classmethod
    def read(cls, file: str | Path, scene: Scene) -> Self:
        """Return the path in a CSV file (comma, semicolon or tab; lines that begin with # are skipped).

        Raises Refused with one line per fault: the file, the line, what is wrong and what to do.
        """
        name = Path(file).name
        header, rows, numbers = _table(Path(file))
        faults: list[str] = []
        place: dict[str, int] = {}  # quantity -> its column
        for i, column in enumerate(header):
            if found := _NAME.fullmatch(column.lower()):
                quantity = {"time": "t"}.get(found[1], found[1])
                if quantity in place:
                    both = f"{header[place[quantity]]} and {column}"
                    faults.append(f"{name}: columns {both} both say {quantity}; leave one")
                place[quantity] = i
        have = ", ".join(header)
        if not place.keys() & {"v", "y"}:
            faults.append(f"{name}: no column v (deflection of the mass [m], positive down); it has {have}")
        if scene.drive.mode != "free" and not place.keys() & {"t", "s_o"}:
            faults.append(f"{name}: neither a column t [s] nor s_o [m]; it has {have}")
        if faults:
            raise Refused(faults)
        columns = {quantity: np.empty(len(rows)) for quantity in place}
        for k, (row, n) in enumerate(zip(rows, numbers, strict=True)):
            for quantity, i in place.items():
                columns[quantity][k] = value = _number(row[i])
                if not math.isfinite(value) and not (quantity.startswith("t_") and not row[i].strip()):
                    hint = " (a decimal comma? write a point)" if "," in row[i] else ""
                    faults.append(f"{name}: line {n}: {header[i]} = {row[i].strip()!r} is no number{hint}")
        if faults:
            more = len(faults) - MOST_FAULTS
            raise Refused(faults[:MOST_FAULTS] + ([f"{name}: and {more} more cells like these"] if more > 0 else []))
        units = {quantity: _unit(header[i].lower(), scene.length) for quantity, i in place.items()}
        columns = {quantity: units[quantity] * x for quantity, x in columns.items()}
        return cls._built(scene, columns, units, name, numbers, "line")

    @classmethod
    def _built(
        cls, scene: Scene, x: dict[str, Array], factor: dict[str, float], name: str, numbers: list[int], row: str
    ) -> Self:
        """Complete t or s_o by the scene's travel, u and v by its static shape, and check that they fit it.

        factor : what the numbers given for a quantity were multiplied by; numbers : of the rows, called `row`.
        """
        motion, l, tau = scene.groups.motion, scene.length, scene.time_scale
        if motion is None and scene.drive.mode != "free":
            raise Refused(f"scene {scene.name} has no travelling mass: there is no path to compare")
        if motion is None and not ("t" in x and x.keys() & {"s_o", "x"} and x.keys() & {"v", "y"}):
            raise Refused(f"{name}: a free ride needs t, s_o or x, and v or y; it has {', '.join(x)}")
        clock = "t" if "t" in x else "s_o"
        back = np.flatnonzero(np.diff(x[clock]) <= 0.0)
        if back.size:
            i, unit = int(back[0]), "s" if clock == "t" else "m"
            raise Refused(
                f"{name}: {row} {numbers[i + 1]}: {clock} = {x[clock][i + 1]:.6g} {unit} does not come after "
                f"{x[clock][i]:.6g} {unit} in the {row} before; {clock} must increase"
            )
        if motion is None:
            if "s_o" not in x:  # near enough: it only tells where on the cable something is
                s = np.linspace(0.0, l, 2001)
                x["s_o"] = np.interp(x["x"], scene.catenary.x(s), s)
            _on_cable(x["s_o"], factor.get("s_o", 1.0), l, name, all_the_way=False)
        elif "t" in x and "s_o" in x:
            _fits_travel(scene, x, factor, name)
        elif "t" in x:
            x["s_o"] = l * motion.position(x["t"] / tau)
        else:
            _on_cable(x["s_o"], factor.get("s_o", 1.0), l, name)
            x["t"] = tau * motion.times_at(np.clip(x["s_o"] / l, motion.begin, motion.end))
        if motion is not None:
            on_the_way = x["t"] <= tau * motion.phases[-1][1] * (1.0 + 1e-9)
            x = {k: a[on_the_way] for k, a in x.items()}
        rest_x, rest_y = scene.catenary.x(x["s_o"]), scene.catenary.y(x["s_o"])
        v = x["v"] if "v" in x else x["y"] - rest_y
        u = x["u"] if "u" in x else x["x"] - rest_x if "x" in x else None
        of = "y" if motion is None and "y" in x else "v"
        path = cls(
            name, l, x["t"], x["s_o"], v, u, x.get("t_behind"), x.get("t_ahead"),
            x.get("x", None if u is None else rest_x + u), x.get("y", rest_y + v), x.get("speed"),
            factor=factor.get(of, 1.0), drive=scene.drive.mode,
        )  # fmt: skip
        window = measures.WINDOWS[path.drive]
        within = int(np.count_nonzero(measures.inside(path, window)))  # type: ignore[arg-type]
        if within < LEAST_ROWS:
            covers = f"s_o/l = {path.s_o[0] / l:.4g} to {path.reached:.4g}" if path.t.size else "no time of the travel"
            raise Refused(
                f"{name}: {within} rows in s_o/l = {window[0]:g} to {window[1]:g}, where paths are compared; "
                f"{LEAST_ROWS} are needed (it covers {covers})"
            )
        return path

    def write(self, file: Path) -> None:
        """Write the path in the units and names of our path.csv."""
        columns = {k: getattr(self, k) for k in ("t", "s_o", "x", "y", "u", "v", "T_behind", "T_ahead", "speed")}
        columns = {k: x for k, x in columns.items() if x is not None}
        write_csv(file, ",".join(columns), np.stack(list(columns.values()), axis=1))


# --- reading --------------------------------------------------------------------------------------------------------


def _table(file: Path) -> tuple[list[str], list[list[str]], list[int]]:
    """Return the names of the columns, the rows of text below them and the rows' line numbers."""
    try:
        text = file.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise Refused(f"{file}: no such file") from None
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else "not text in UTF-8"
        raise Refused(f"{file}: cannot be read ({why})") from None
    lines = [(n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip()]
    if not lines:
        raise Refused(f"{file.name}: the file is empty")
    for start, (n, line) in enumerate(lines):  # noqa: B007
        bare = line.lstrip("# \t")
        delimiter = max(",;\t", key=bare.count)
        header = [cell.strip() for cell in next(csv.reader([bare], delimiter=delimiter))]
        if not line.lstrip().startswith("#") or any(_NAME.fullmatch(cell.lower()) for cell in header):
            break
    if all(math.isfinite(_number(cell)) for cell in header):
        raise Refused(f"{file.name}: line {n}: numbers where the names of the columns should stand, e.g. t,s_o,u,v")
    body = [(n, line) for n, line in lines[start + 1 :] if not line.lstrip().startswith("#")]
    if not body:
        raise Refused(f"{file.name}: no rows below the names of the columns")
    rows = list(csv.reader([line for _, line in body], delimiter=delimiter))
    for (n, _), row in zip(body, rows, strict=True):
        if len(row) != len(header):
            raise Refused(f"{file.name}: line {n}: {len(row)} cells under {len(header)} names of columns")
    return header, rows, [n for n, _ in body]


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _unit(column: str, length: float) -> float:
    """Return what a column's numbers are multiplied by to be in SI, with v and y down."""
    found = _NAME.fullmatch(column)
    assert found is not None
    factor = length if found[2] in ("_over_l", "/l") else _FACTOR.get(found[2] or "", 1.0)
    return -factor if found[3] == "_up" else factor


# --- do numbers and names contradict one another? -------------------------------------------------------------------


def _fits_travel(scene: Scene, x: dict[str, Array], factor: dict[str, float], name: str) -> None:
    """Raise Refused unless s_o(t) is the scene's travel, with the units that would make it so."""
    motion = scene.groups.motion
    assert motion is not None
    l, tau, t, s_o = scene.length, scene.time_scale, x["t"], x["s_o"]

    def misfit(time: float, place: float) -> Array:
        # past the end the scene's mass stands still; another program's may run on
        return np.abs(np.minimum(place * s_o / l, motion.end) - motion.position(time * t / tau))

    off = misfit(1.0, 1.0)
    if off.max() <= TRAVEL_TOLERANCE:
        return
    times = {**_TIMES, f"t over {tau:.6g} s = l sqrt(rho/H)": tau}
    for (as_t, time), (as_s, place) in itertools.product(times.items(), _units("s_o", l).items()):
        time, place = time / factor.get("t", 1.0), place / factor.get("s_o", 1.0)
        # a mass that hardly moves, or has arrived, fits any travel
        moving = np.count_nonzero((place * s_o > WINDOW[0] * l) & (time * t < tau * motion.phases[-1][1]))
        if moving >= LEAST_ROWS and misfit(time, place).max() <= TRAVEL_TOLERANCE:
            raise Refused(f"{name}: t and s_o are the scene's travel as {as_t} and {as_s}: name or convert them so")
    i = int(np.argmax(off))
    raise Refused(
        f"{name}: t and s_o are not the scene's travel: at t = {t[i]:.6g} s it has s_o/l = {s_o[i] / l:.4g}, "
        f"the scene {motion.position(t[i] / tau):.4g}"
    )


def _on_cable(s_o: Array, factor: float, l: float, name: str, *, all_the_way: bool = True) -> None:
    """Raise Refused unless s_o runs along the cable, with the unit in which it would end next to the far support."""
    last = float(s_o[-1] if all_the_way else s_o.max()) / l
    if s_o.min() / l >= -TRAVEL_TOLERANCE and WINDOW[0] < last <= 1.0 + TRAVEL_TOLERANCE:
        return
    ends = {column: unit / factor * last for column, unit in _units("s_o", l).items()}
    fits = [column for column, end in ends.items() if 0.1 < end <= 1.0 + TRAVEL_TOLERANCE]
    hint = f"; name the column {max(fits, key=lambda column: ends[column])}?" if fits else ""
    raise Refused(f"{name}: s_o runs from {s_o[0]:.6g} to {s_o[-1]:.6g} m on a cable of {l:.6g} m{hint}")


_TIMES = {"t": 1.0, "t_ms": 1e-3}


def _units(column: str, l: float) -> dict[str, float]:
    """Return what a column of lengths may be named, and what its numbers are then multiplied by."""
    return {column: 1.0, f"{column}_over_l": l, f"{column}_mm": 1e-3, f"{column}_km": 1e3}


def refuse_misnamed(path: ForeignPath | Response, ours: Response) -> None:
    """Raise Refused if v, of a free ride y, disagrees grossly as it is named, but would agree in another unit or way.

    ours : any run that is good to a few percent.
    """
    of, named = "y" if ours.drive == "free" else "v", getattr(path, "factor", 1.0)
    units = _units(of, path.length)
    units |= {f"{column}_up": -factor for column, factor in units.items()}
    try:
        window = _common(path, measures.window_of(ours))
        other = {column: replace(path, **{of: factor / named * getattr(path, of)}) for column, factor in units.items()}
        gaps = {column: measures.path_gap(_vertical(x), _vertical(ours), window)[1] for column, x in other.items()}
        as_named = measures.path_gap(_vertical(path), _vertical(ours), window)[1]
    except NotComparable:
        return
    column = min(gaps, key=lambda name: gaps[name])
    if as_named > 0.2 and gaps[column] < 0.1:
        what = f"{of} points the other way" if units[column] * named < 0.0 else f"{of} is in another unit"
        raise Refused(
            f"{path.method}: {what}: as {column} it would be {gaps[column]:.2%} off (rms), as it is named "
            f"{as_named:.3g} times {ours.path_scale_named}; name it {column}"
        )


# --- comparing ------------------------------------------------------------------------------------------------------


def _vertical(r: Any) -> Any:
    return replace(r, u=np.zeros_like(r.v), x=np.zeros_like(r.v))


def comparable(a: Any, b: Any) -> tuple[Any, Any]:
    """Return both paths in the components that both have: without u where one of them does not know it."""
    return (a, b) if a.u is not None and b.u is not None else (_vertical(a), _vertical(b))


def _common(path: ForeignPath | Response, window: Window) -> Window:
    """Return the part of the window that the path covers."""
    if path.drive == "free":
        return window
    start, stop = max(window[0], float(path.s_o[0] / path.length)), min(window[1], path.reached)
    if not start < stop:
        covered = f"{path.s_o[0] / path.length:.4g} to {path.reached:.4g}"
        raise NotComparable(f"it covers s_o/l = {covered}, our own answers {window[0]:.4g} to {window[1]:.4g}")
    return start, stop


def mass_tension_gap(a: Any, b: Any, window: Window) -> float:
    """Return the rms gap of both one-sided tensions at the mass over the window, relative to H of b."""
    coarse, fine = (a, b) if a.t.size <= b.t.size else (b, a)
    within = measures.inside(coarse, window) & (coarse.t <= fine.t[-1])
    total = 0.0
    for side in ("T_behind", "T_ahead"):
        known = np.isfinite(getattr(fine, side))
        at = replace(fine, t=fine.t[known])
        gap = getattr(coarse, side) - measures.at_steps_of(coarse, at, getattr(fine, side)[known])
        total += float(np.nanmean(gap[within] ** 2))
    return math.sqrt(0.5 * total) / b.horizontal_tension


def rows(path: ForeignPath | Response, ours: Estimated, window: Window, with_tol: float) -> Iterator[Agreement]:
    """Hold a foreign path against an estimated run: allowed is our error bar plus `with_tol`.

    Where it covers less than the window, the gap is told but the row is "not comparable".
    """
    party, run = path.method, ours.run.method
    try:
        part = _common(path, window)
        max_gap, rms_gap = measures.path_gap(*comparable(path, ours.response), part)
        where = measures.place_of_gap(*comparable(path, ours.response), part)
    except NotComparable as reason:
        yield Agreement("path_max", math.nan, nothing(f"{party}: {reason}"), party=party)
        return
    free = path.drive == "free"
    along, upright = ("x", "y") if free else ("u", "v")
    components = f"{upright} alone" if path.u is None else f"{along} and {upright}"
    last = float(ours.run.t[-1])
    step = TRAVEL_TOLERANCE + float(np.diff(path.t if free else path.s_o).max()) / (last if free else path.length)
    if free:
        kind, covers = "covers less time", {"low": float(path.t[0]), "high": float(path.t[-1]), "stop": last}
        short = path.t[0] > step * last or path.t[-1] < (1.0 - step) * last
    else:
        kind, covers = "covers less", {"low": part[0], "high": part[1], "start": window[0], "stop": window[1]}
        short = part[0] > window[0] + step or part[1] < window[1] - step

    def row(name: str, gap: float, of: Any, where: float | None = None) -> Agreement:
        bars = Part(run, ours.bar(of), "its error bar"), Part(f"allowed to {party}", with_tol)
        bound = Bound("foreign", bars, {"components": components})
        if short:
            bound = Bound(kind, bars, {"party": party, **covers})
        return Agreement(name, gap, bound, where, party)

    def measured(i: int) -> Any:
        known = comparable if path.u is not None else lambda a, b: (_vertical(a), _vertical(b))
        return lambda a, b: measures.path_gap(*known(a, b), part)[i]

    yield row("path_max", max_gap, measured(0), where)
    yield row("path_rms", rms_gap, measured(1))
    if free and path.speed is not None:
        stop = happened("stop", ours.run)
        until, top = math.inf if stop is None else stop["t"], float(ours.run.speed.max())

        def speed_gap(a: Any, b: Any) -> float:
            def of(r: Any) -> Array:
                return np.where(r.t <= until, r.speed, math.nan) / top

            return measures.series_gap(a, b, part, of, largest=True)

        components = "speed, of the largest"
        yield row("speed", speed_gap(path, ours.response), speed_gap)
    if path.T_behind is not None and path.T_ahead is not None:
        gap = mass_tension_gap(path, ours.response, part)
        components = "tension at the mass, both sides"
        yield row("tension", gap, lambda a, b: mass_tension_gap(a, b, part))
