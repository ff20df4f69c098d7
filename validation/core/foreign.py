"""Another program's mass path, from a CSV file or arrays, in the form our measures compare.

Columns have the names and SI units of our path.csv; another unit is an ending of the name:

    t         [s]          _ms; t or s_o suffices: the scene's travel gives the other
    s_o       [m]          position of the mass on the cable
    v or y    [m]          positive down (_up: up); from the static cable or the left support
    u or x    [m]          optional; lengths have _mm, _km, _over_l (of the cable's length)
    T_behind, T_ahead [N]  _kN; optional
    speed     [m/s]        _kmh; optional, |dp/dt|, of a free ride

Other columns are ignored.
"""

import csv
import math
from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any, Self

import numpy as np

from cablefem.response import Array, MassPath, Response, write_csv
from cablefem.scene import Scene
from cablefem.scene.motion import Motion
from validation.core import measures
from validation.core.agreement import Agreement, Bound, BoundPart, no_bound
from validation.core.ladder import Distance, Ladder, identity
from validation.core.measures import WINDOW, NotComparable, Window
from validation.core.rows import find_event
from validation.core.scene_data import conversion_factor_or_nan
from validation.core.store import Refused

WITH_TOL = 5e-3  # of the largest deflection, allowed beside our own bar
TRAVEL_TOLERANCE = 5e-3  # of l: programs may round the position to a node
_ENDINGS = "t must be in s, s_o and v in m, v down; in a file a column may be t_ms, s_o_over_l, v_mm or v_up"
_UNITS = {"s": ("s", "ms"), "m": ("m", "mm", "km"), "m/s": ("km/h",), "N": ("N", "kN")}  # SI: others beside it
_COLUMNS = {
    "t": "s", "s_o": "m", "x": "m", "y": "m", "u": "m", "v": "m", "T_behind": "N", "T_ahead": "N", "speed": "m/s",
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ForeignPath(MassPath):
    """A third party's mass path in SI; None where it says nothing."""

    settings: dict[str, Any] = field(default_factory=dict)
    work: dict[str, int] = field(default_factory=dict)
    slack_onset: float | None = None  # files do not tell
    u: Any = None
    x: Any = None
    y: Any = None
    T_behind: Array | None = None  # [N] or nan
    T_ahead: Array | None = None
    speed: Array | None = None  # [m/s]
    events: tuple[()] = ()
    columns: dict[str, Array] = field(default_factory=dict)  # as they came, in SI, v and y down

    @classmethod
    def of(
        cls, scene: Scene, s_o: Any = None, v: Any = None, u: Any = None, *, t: Any = None, x: Any = None,
        y: Any = None, name: str = "the other solver",
    ) -> Self:  # fmt: skip
        """The path v(s_o) [m], v down; t [s] by the scene's travel unless given.  A free ride needs x, y(t)."""
        __tracebackhide__ = True  # pytest shows the caller's line
        columns = {"s_o": s_o, "v": v, "u": u, "t": t, "x": x, "y": y}
        try:
            arrays = {k: np.asarray(x, dtype=float) for k, x in columns.items() if x is not None}
        except (TypeError, ValueError) as error:
            raise Refused(f"{name}: {error}") from None
        _refuse_other_than_finite_columns(name, arrays)
        return cls.from_columns(name, scene, arrays)

    @classmethod
    def read(cls, file: str | Path, scene: Scene) -> Self:
        """The path in a CSV file (comma, semicolon or tab; # begins a comment line).

        Raises Refused with one line per fault.
        """
        return cls.from_columns(Path(file).name, scene, *_read_known_columns(Path(file), scene))

    @classmethod
    def from_columns(cls, name: str, scene: Scene, columns: dict[str, Array], row_names: Sequence[str] = ()) -> Self:
        """The path with these columns (n,); faults name their rows.  Raises Refused for what is no path."""
        __tracebackhide__ = True
        row_names = row_names or [f"row {i}" for i in range(len(next(iter(columns.values()))))]
        try:
            completed = _completed_columns_or_refused(scene, columns, row_names)
            return cls(method=name, length=scene.length, drive=scene.drive.mode, columns=columns, **completed)
        except Refused as fault:
            raise Refused(f"{name}: {fault}") from None

    def write(self, file: Path) -> None:
        """Write the known columns as a CSV file."""
        write_csv(file, {k: x for k in _COLUMNS if (x := getattr(self, k)) is not None})


def _refuse_other_than_finite_columns(name: str, arrays: dict[str, Array]) -> None:
    """Raise Refused unless these are columns of one length, of finite numbers."""
    shapes = {column: array.shape for column, array in arrays.items()}
    different = set(shapes.values())
    if len(different) != 1 or len(*different) != 1:
        got = ", ".join(f"{column} {shape}" for column, shape in shapes.items())
        raise Refused(f"{name}: {', '.join(arrays)} must be columns of one length, got the shapes {got}")
    for column, array in arrays.items():
        if not np.isfinite(array).all():
            raise Refused(f"{name}: {column}[{int(np.argmin(np.isfinite(array)))}] is not a finite number")


# --- reading --------------------------------------------------------------------------------------------------------


def _quantity_and_factor_by_column(l: float) -> dict[str, tuple[str, float]]:
    """Quantity and factor to SI, v and y down, of every name that a column may have on a cable of length l [m]."""
    names = {}
    for quantity, si in _COLUMNS.items():
        factors = {f"_{unit.replace('/', '')}": conversion_factor_or_nan(unit, si) for unit in _UNITS[si]} | {"": 1.0}
        if si == "m":
            factors["_over_l"] = l
        for ending, factor in factors.items():
            names[quantity + ending] = quantity, factor
            if quantity in ("y", "v"):
                names[f"{quantity}{ending}_down"] = quantity, factor
                names[f"{quantity}{ending}_up"] = quantity, -factor
    return names


def _read_known_columns(file: Path, scene: Scene) -> tuple[dict[str, Array], list[str]]:
    """The known columns of a file in SI, and the line of each row; Refused with up to five faults."""
    known = _quantity_and_factor_by_column(scene.length)
    header, rows = _read_header_and_rows(file, known)
    columns_by_index = {i: known[name] for i, name in enumerate(header) if name in known}
    faults = _header_faults(header, columns_by_index, scene) if rows else ["no rows below the names of the columns"]
    faults = faults or list(_row_length_and_cell_faults(header, columns_by_index, rows))
    if faults:
        more = [f"and {len(faults) - 5} more cells like these"] if len(faults) > 5 else []
        raise Refused([f"{file.name}: {fault}" for fault in faults[:5] + more])
    columns = {}
    for i, (quantity, factor) in columns_by_index.items():
        values = [_float_or_nan(row[i]) for _, row in rows]
        columns[quantity] = factor * np.array(values)
    return columns, [f"line {n}" for n, _ in rows]


def _read_header_and_rows(file: Path, known_columns: Container[str]) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Names of the columns, and rows of cells with their line numbers; Refused if unreadable or empty.

    A comment with a known column is a header.
    """
    try:
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else "not text in UTF-8"
        raise Refused(f"{file}: cannot be read ({why})") from None
    lines = [(n, line.strip()) for n, line in enumerate(text.splitlines(), 1) if line.strip()]
    for i, (_, line) in enumerate(lines):
        separator = max(",;\t", key=line.count)
        header = _split_cells(line.lstrip("# \t"), separator)
        if line[0] != "#" or any(name in known_columns for name in header):  # a comment may hold the names
            return header, [(n, _split_cells(row, separator)) for n, row in lines[i + 1 :] if row[0] != "#"]
    raise Refused(f"{file.name}: the file is empty")


FREE_RIDE_NEEDS = "a free ride needs t, s_o or x, and v or y"


def _header_faults(header: list[str], columns_by_index: dict[int, tuple[str, float]], scene: Scene) -> list[str]:
    """Two columns of one quantity, and quantities that are missing."""
    names: dict[str, list[str]] = {}
    for i, (quantity, _) in columns_by_index.items():
        names.setdefault(quantity, []).append(header[i])
    twice = {quantity: x for quantity, x in names.items() if len(x) > 1}
    faults = [f"columns {' and '.join(x)} both say {quantity}; leave one" for quantity, x in twice.items()]
    have = f"it has {', '.join(header)}{_unknown_endings_text(header, names)}"
    if scene.drive.mode == "free":
        if not _tells_a_free_ride(names):
            faults.append(f"{FREE_RIDE_NEEDS}; {have}")
        return faults
    if not {"v", "y"} & names.keys():
        faults.append(f"no column v (deflection of the mass [m], positive down); {have}")
    if not {"t", "s_o"} & names.keys():
        faults.append(f"neither a column t [s] nor s_o [m]; {have}")
    return faults


def _tells_a_free_ride(names: Container[str]) -> bool:
    return "t" in names and ("s_o" in names or "x" in names) and ("v" in names or "y" in names)


def _unknown_endings_text(header: Sequence[str], found: Container[str]) -> str:
    """Text on columns of quantities not found whose ending is no unit that is read; empty without any."""
    text = ""
    for name in header:
        quantity = next((x for x in sorted(_COLUMNS, key=len, reverse=True) if name.startswith(f"{x}_")), "")
        if quantity and quantity not in found:
            si, *others = _UNITS[_COLUMNS[quantity]]
            endings = " or ".join(f"{quantity}_{unit}" for unit in others)
            text += f"; the ending of {name} is not understood: must be {quantity} in {si}, or {endings}"
    return text


def _row_length_and_cell_faults(
    header: list[str], columns_by_index: dict[int, tuple[str, float]], rows: list[tuple[int, list[str]]]
) -> Iterator[str]:
    """Rows of another length than the header, and cells that are no number; a tension may be unknown."""
    for n, row in rows:
        if len(row) != len(header):
            yield f"line {n}: {len(row)} cells under {len(header)} names of columns"
            continue
        for i, (quantity, _) in columns_by_index.items():
            may_be_empty = quantity.startswith("T_")
            if not (math.isfinite(_float_or_nan(row[i])) or (may_be_empty and not row[i])):
                hint = " (a decimal comma? write a point)" if "," in row[i] else ""
                yield f"line {n}: {header[i]} = {row[i]!r} is no number{hint}"


def _split_cells(line: str, separator: str) -> list[str]:
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]


def _float_or_nan(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


# --- completing, and refusing what does not fit the scene -------------------------------------------------------------


def _completed_columns_or_refused(scene: Scene, columns: dict[str, Array], row_names: Sequence[str]) -> dict[str, Any]:
    """The given columns with all of t, s_o, x, y, u, v that follow from them; Refused where they are no path."""
    if scene.drive.mode == "free":
        if not _tells_a_free_ride(columns):
            raise Refused(f"{FREE_RIDE_NEEDS}; it has {', '.join(columns)}")
    elif scene.groups.motion is None:
        raise Refused(f"scene {scene.name} has no travelling mass: there is no path to compare")
    _refuse_not_increasing("t" if "t" in columns else "s_o", columns, row_names)
    x = _with_t_and_s_o(scene, columns)
    rest = {"x": scene.catenary.x(x["s_o"]), "y": scene.catenary.y(x["s_o"])}
    for displacement, coordinate in (("u", "x"), ("v", "y")):
        if displacement in x:
            x.setdefault(coordinate, rest[coordinate] + x[displacement])
        elif coordinate in x:
            x[displacement] = x[coordinate] - rest[coordinate]
    _refuse_too_few_in_window(x["s_o"] / scene.length, *measures.WINDOWS[scene.drive.mode])
    return x


def _refuse_not_increasing(name: str, columns: dict[str, Array], row_names: Sequence[str]) -> None:
    """Raise Refused at the first row where the column t or s_o does not increase."""
    late = np.flatnonzero(np.diff(columns[name]) <= 0.0)
    if late.size:
        i = late[0]
        unit = _COLUMNS[name]
        before, after = columns[name][i : i + 2]
        row, row_before = row_names[i + 1], row_names[i]
        raise Refused(
            f"{row}: {name} = {after:.6g} {unit} does not come after {before:.6g} {unit} in {row_before}; "
            f"{name} must increase"
        )


def _with_t_and_s_o(scene: Scene, columns: dict[str, Array]) -> dict[str, Array]:
    """The columns with t and s_o: of a free ride s_o by x, of a prescribed travel one by the other."""
    if scene.groups.motion is None:
        l = scene.length
        s = np.linspace(0.0, l, 2001)
        s_o = columns.get("s_o")
        if s_o is None:
            s_o = np.interp(columns.get("x", s[:1]), scene.catenary.x(s), s)
        _refuse_off_cable(s_o, float(s_o.max()), l)
        return columns | {"s_o": s_o}
    return _matched_to_travel_or_refused(scene, scene.groups.motion, columns)


def _matched_to_travel_or_refused(scene: Scene, motion: Motion, columns: dict[str, Array]) -> dict[str, Array]:
    """The columns with t and s_o by the scene's travel, up to its end; Refused if t and s_o are another travel."""
    l = scene.length
    tau = scene.time_scale
    x = dict(columns)
    if "t" not in x:
        _refuse_off_cable(x["s_o"], float(x["s_o"][-1]), l)
        x["t"] = tau * motion.times_at_positions(np.clip(x["s_o"] / l, motion.start_position, motion.end_position))
        once = np.append(True, np.diff(x["t"]) > 0.0)  # of places beyond an end of the travel the first
        x = {k: a[once] for k, a in x.items()}
    position = motion.position(x["t"] / tau)
    # the scene's mass stays at the end
    s_o = x.setdefault("s_o", l * position)
    off = np.abs(np.minimum(s_o / l, motion.end_position) - position)
    if "t" in columns and off.max() > TRAVEL_TOLERANCE:
        i = int(np.argmax(off))
        raise Refused(
            f"t and s_o are not the scene's travel: at t = {x['t'][i]:.6g} s it has s_o/l = {x['s_o'][i] / l:.4g}, "
            f"the scene {position[i]:.4g}; {_ENDINGS}"
        )
    travelling = x["t"] <= tau * motion.end_time * (1.0 + 1e-9)
    return {k: a[travelling] for k, a in x.items()}


def _refuse_off_cable(s_o: Array, last_position: float, l: float) -> None:
    """Raise Refused for positions before the cable, or whose last one is before the window or off the cable."""
    if s_o.min() < -TRAVEL_TOLERANCE * l or not WINDOW[0] < last_position / l <= 1.0 + TRAVEL_TOLERANCE:
        raise Refused(f"s_o runs from {s_o[0]:.6g} to {s_o[-1]:.6g} m on a cable of {l:.6g} m; {_ENDINGS}")


def _refuse_too_few_in_window(position: Array, low: float, high: float) -> None:
    """Raise Refused for positions s_o/l of which too few lie in the window."""
    within = int(np.count_nonzero((position >= low) & (position <= high * (1.0 + 1e-12))))
    fewest = 5  # in the window
    if within < fewest:
        covers = f"s_o/l = {position[0]:.4g} to {position[-1]:.4g}" if position.size else "no time of the travel"
        raise Refused(
            f"{within} rows in s_o/l = {low:g} to {high:g}, where paths are compared; "
            f"{fewest} are needed (it covers {covers})"
        )


def refuse_wrong_unit_or_direction(path: MassPath, ours: Response) -> None:
    """Raise Refused if v (free ride: y) agrees only after a change of unit or direction.

    ours : a run good to a few percent.
    """
    column = "y" if ours.drive == "free" else "v"
    l = path.length
    try:
        window = _window_cut_to_path(path, measures.common_window(ours))
        off = {}
        for unit, sign in product((1.0, 1e-3, 1e3, l, 1.0 / l), (1.0, -1.0)):
            factor = sign * unit
            changed = replace(path, **{column: factor * getattr(path, column)})
            off[factor] = measures.relative_path_gap(with_zero_u_and_x(changed), with_zero_u_and_x(ours), window).rms
    except NotComparable:
        return
    best = min(off, key=off.__getitem__)
    if off[1.0] > 0.2 and off[best] < 0.1:
        what = f"{column} points the other way" if best < 0.0 else f"{column} is in another unit"
        raise Refused(
            f"{path.method}: {what}: it is off by {off[1.0]:.3g} times {ours.path_scale_name}, and by {off[best]:.2%} "
            f"if multiplied by {best:.6g} (l = {l:.6g} m); {_ENDINGS}"
        )


def with_zero_u_and_x(r: Any) -> Any:
    """A path with zero u and x, to compare with one that lacks u."""
    return replace(r, u=np.zeros_like(r.v), x=np.zeros_like(r.v))


def _window_cut_to_path(path: MassPath, window: Window) -> Window:
    """The part of a window that a path covers, of a free ride all; NotComparable if it covers none."""
    if path.drive == "free":
        return window
    start = max(window[0], float(path.s_o[0] / path.length))
    stop = min(window[1], path.reached)
    if not start < stop:
        covered = f"{path.s_o[0] / path.length:.4g} to {path.reached:.4g}"
        raise NotComparable(f"it covers s_o/l = {covered}, our own answers {window[0]:.4g} to {window[1]:.4g}")
    return start, stop


def rms_mass_tension_gap_over_H(a: Any, b: Any, window: Window, H: float) -> float:
    """Rms gap of both tensions at the mass over the window, over H."""

    def tensions_over_H(r: Any) -> Array:
        return np.stack([r.T_behind, r.T_ahead], axis=1) / (math.sqrt(2.0) * H)

    return measures.series_gap(a, b, window, tensions_over_H)


def third_party_rows(
    path: ForeignPath | Response, ladder: Ladder, window: Window, with_tol: float
) -> Iterator[Agreement]:
    """Rows of a foreign path and our finest run; allowed is our bar plus `with_tol`.

    Where the path does not cover the window, a row is not comparable.
    """
    along, upright = ("x", "y") if ladder.finest.drive == "free" else ("u", "v")
    of_path = f"{along} and {upright}"
    if path.u is None:
        path = with_zero_u_and_x(path)
        ladder = ladder.map(with_zero_u_and_x)
        of_path = f"{upright} alone"
    other = path.method
    run = ladder.finest
    try:
        part = _window_cut_to_path(path, window)
        where = measures.relative_path_gap(path, run, part).position_of_largest
    except NotComparable as reason:
        yield Agreement("path_max", math.nan, no_bound(f"{other}: {reason}"), third_party=other)
        return
    covered = _partial_coverage_text(path, run, window)
    allowed = BoundPart(f"allowed to {other}", with_tol)
    for name, distance in _distance_functions(path, run, part).items():
        bar = BoundPart(run.method, ladder.error_bar(identity, distance), "its error bar")
        bound = Bound("our error bar", (bar, allowed), f"of {_COMPONENTS.get(name, of_path)}")
        if covered:
            bound = no_bound(f"{other} covers {covered}; there {bound.sum_or_nan:.2g} would be allowed")
        yield Agreement(name, distance(path, run), bound, where if name == "path_max" else None, other)


# what is compared, beside the path
_COMPONENTS = {"speed": "speed, of the largest", "tension": "tension at the mass, both sides"}


def _distance_functions(path: ForeignPath | Response, run: Response, part: Window) -> dict[str, Distance]:
    """Distances of two answers in all quantities that a path says, in part of the window; its path comes first."""
    stop = find_event("stop", run.events)
    stop_time = math.inf if stop is None else stop["t"]

    def relative_speed(r: Any) -> Array:
        """Unknown after a stop."""
        return np.where(r.t <= stop_time, r.speed, math.nan) / run.speed.max()

    distances: dict[str, Distance] = {
        "path_max": lambda a, b: measures.relative_path_gap(a, b, part).largest,
        "path_rms": lambda a, b: measures.relative_path_gap(a, b, part).rms,
    }
    if run.drive == "free" and path.speed is not None:
        distances["speed"] = lambda a, b: measures.series_gap(a, b, part, relative_speed, largest=True)
    if path.T_behind is not None and path.T_ahead is not None:
        distances["tension"] = lambda a, b: rms_mass_tension_gap_over_H(a, b, part, run.horizontal_tension)
    return distances


def _partial_coverage_text(path: MassPath, run: Response, window: Window) -> str:
    """The part of the window that a path covers, if not all; else ""."""
    axis = "s_o/l"
    rows = path.s_o / path.length
    begin, end = window
    if run.drive == "free":
        axis = "t [s]"
        rows = path.t
        begin, end = 0.0, float(run.t[-1])
    step = TRAVEL_TOLERANCE * end + float(np.diff(rows).max())
    low = max(begin, float(rows[0]))
    high = min(end, float(rows[-1]))
    if low <= begin + step and high >= end - step:
        return ""
    return f"{axis} {low:.4g} to {high:.4g} of {begin:.4g} to {end:.4g}"
