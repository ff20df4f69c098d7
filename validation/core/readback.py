"""What was written, read back: files, page and terminal against the stored fields and JSON files.

It imports nothing of what writes them.  Every reader yields faults, sentences.
A table or printed text without a reader is noted: a test fails then.
"""

from __future__ import annotations

import base64
import csv
import html
import itertools
import json
import math
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq
from scipy.spatial import cKDTree

from validation.core.scene_data import ROUNDING, Array, ice_mass, max_depth_at, mean_around, read_columns, si_factor

Faults = Iterator[str]
Run = dict[str, Any]  # stored arrays of a method by name, its TOML as "scene", its numbers as "rest"
Row = dict[str, Any]  # of a JSON file

SINGLE_PRECISION = 1e-6  # of single precision
FRAMES = 5  # of an animation that are read
POINTS = 201  # of profile.csv
PACKED = 65535  # steps between the extremes of a packed series
ORDER = ("disagree", "not comparable", "too coarse", "agree")  # of verdicts: the first one counts
SHOWN_AS = {"too coarse": "too coarse to tell", "not comparable": "cannot be compared"}


class StoredResults:
    """What a run or a check stored in a folder: of methods, the first one's numbers are those shown."""

    def __init__(self, folder: Path, methods: Sequence[str], judged: bool) -> None:
        self.folder = folder
        self.methods = methods
        self.summaries = [_read_json(folder / name / "summary.json") for name in methods]
        self.agreement = _read_json(folder / "agreement.json") if judged else {}
        shown = self.agreement or self.summaries[0]
        self.design: list[Row] = shown["design"]
        self.shown_events: list[Row] = shown["events"]
        self.events: list[Row] = [*shown["events"], *self.agreement.get("quasi_static", [])]
        self.rows: list[Row] = self.agreement.get("rows", [])
        self.limits: list[Row] = shown.get("limits", [])
        self.outcome: str = self.summaries[0].get("outcome", "")
        self.unread: list[str] = []  # what has no reader

    @property
    def verdict(self) -> str:
        """Of both solvers; another program has its own."""
        return _worst_verdict(row for row in self.rows if not row.get("with")) or "not comparable"

    @cache  # noqa: B019  a few, short-lived
    def stored_run(self, i: int) -> Run:
        """The stored arrays of a method, and its scene's TOML."""
        with np.load(self.folder / self.methods[i] / "response.npz", allow_pickle=False) as data:
            run: Run = {name: data[name] for name in data.files if name != "_rest"}
            run["rest"] = json.loads(str(data["_rest"]))
        run["scene"] = tomllib.loads(run["rest"]["scene_toml"])
        return run


def _worst_verdict(rows: Iterable[Row]) -> str | None:
    verdicts = {row["verdict"] for row in rows if row["asked"]}
    return next((verdict for verdict in ORDER if verdict in verdicts), None)


def _read_json(file: Path) -> Any:
    return json.loads(file.read_text(encoding="utf-8"))


# --- numbers in text ------------------------------------------------------------------------------------------------

_NUMBER = r"-?\d[\d ]*(?:\.\d+)?(?: × 10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?(?:e[+-]?\d+)?"
_VALUE = re.compile(rf"({_NUMBER})(?: ± ({_NUMBER}))?(?: ?([a-zA-Z%°][\w/%°]*))?")
_POWERS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def plain_text(text: str) -> str:
    """The text of HTML, with plain minus signs and spaces."""
    text = html.unescape(re.sub(r"<[^>]*>", "", text)).replace("\u202f", " ").replace("−", "-")
    return re.sub(r"\s+", " ", text).strip()


def _parse_number(text: str) -> float:
    mantissa, _, power = text.partition(" × 10")
    return float(mantissa.replace(" ", "")) * 10.0 ** int(power.translate(_POWERS) or 0)


def _magnitude(x: float) -> int:
    return math.floor(math.log10(abs(x))) if x else 0


def shows_value(text: str, value: float | None, unit: str = "", *, bar: float | None = None, digits: int = 5) -> bool:
    """Whether a text shows a value in SI to its last digit, with its bar to two digits and a unit that suits.

    digits : of a value without bar; the digits before the point all count.
    """
    if value is None or not math.isfinite(value):
        return text in ("–", "-")
    match = _VALUE.fullmatch(text)
    factor = math.nan if match is None else si_factor(match[3] or "", unit)
    if match is None or math.isnan(factor):
        return False
    printed = [_parse_number(number) for number in match.group(1, 2) if number]
    if printed == [0.0] and abs(value / factor) < ROUNDING:
        return True
    expected = [value / factor]
    digit = _magnitude(value / factor) - digits + 1
    if _is_bar_printed(bar, value):
        expected.append((bar or 0.0) / factor)
        digit = _magnitude(expected[1]) - 1
    return len(printed) == len(expected) and np.allclose(printed, expected, rtol=0.0, atol=0.501 * 10.0**digit)


def _is_bar_printed(bar: float | None, value: float) -> bool:
    """Whether a bar is known and no rounding."""
    return bool(bar) and ROUNDING * abs(value) <= (bar or 0.0) < math.inf


def shows_decimals(text: str, value: float | None, unit: str, decimals: int) -> bool:
    """The same of a value with so many decimals; "" if it is unknown."""
    if value is None:
        return text == ""
    number, _, printed = text.partition(" ")
    good = re.fullmatch(rf"-?\d+\.\d{{{decimals}}}", number) and printed == unit
    return bool(good) and abs(float(number) - value) <= 0.501 * 10.0**-decimals


# --- files ----------------------------------------------------------------------------------------------------------


def file_faults(of: StoredResults) -> Faults:
    """Faults of the files of each method, and of the limits."""
    for faults in limit_faults(of.limits, of.stored_run(0)["scene"], of.design, of.shown_events):
        yield f"limits: {faults}"
    for faults in verification_faults(of):
        yield f"verification: {faults}"
    for i, method in enumerate(of.methods):
        for name, reader in FILES.items():
            file = of.folder / method / name
            if reader is not None and file.exists():
                for fault in reader(file, of.stored_run(i)):
                    yield f"{file}: {fault}"


def _csv_faults(file: Path, expected: dict[str, Array]) -> Faults:
    """Faults of the columns of a CSV; its empty cells are nan."""
    header, _, body = file.read_text(encoding="ascii").rstrip().partition("\n")
    names = header.split(",")
    cells = [float(cell or "nan") for cell in body.replace("\n", ",").split(",")]
    columns = dict(zip(names, np.reshape(cells, (-1, len(names))).T, strict=True))
    for name in columns.keys() ^ expected.keys():
        yield f"column {name} has no second computation or is not there"
    for name in columns.keys() & expected.keys():
        yield from _series_faults(name, columns[name], expected[name], ROUNDING)


def _series_faults(name: str, written: Array, expected: Array, rounding: float, scale: float | None = None) -> Faults:
    if written.shape != expected.shape or not np.array_equal(np.isnan(written), np.isnan(expected)):
        yield f"{name} has other rows than were computed"
        return
    off = float(np.nanmax(np.abs(written - expected), initial=0.0))
    scale = scale or float(np.nanmax(np.abs(expected), initial=0.0)) or 1.0
    if off > rounding * scale:
        yield f"{name} is not what was computed: off by {off:.3g} of {scale:.3g}"


def _path_faults(file: Path, run: Run) -> Faults:
    yield from _csv_faults(file, path_columns(run))


def path_columns(run: Run) -> dict[str, Array]:
    """Columns of path.csv from the stored arrays (n,)."""
    tangent = run["slope_behind"] + run["slope_ahead"]  # (n, 2)
    across = tangent[:, 0] * run["contact"][:, 1] - tangent[:, 1] * run["contact"][:, 0]
    path = {name: run[name] for name in ("t", "s_o", "x", "y", "u", "v", "T_behind", "T_ahead", "F_haul")}
    path["speed"] = np.sqrt(np.sum(run["velocity"] ** 2, axis=1))
    path["F_contact"] = across / np.sqrt(np.sum(tangent**2, axis=1))
    return path


def _tension_faults(file: Path, run: Run) -> Faults:
    """Rows of each frame: all stations, then the car's two sides."""
    k, m = run["fields.T"].shape
    s_o = run["fields.s_o"]
    columns = {
        "t": np.repeat(run["fields.t"], m + 2),
        "s": np.column_stack([np.tile(run["fields.s"], (k, 1)), s_o, s_o]),
        "T": np.column_stack([run["fields.T"], run["fields.T_behind"], run["fields.T_ahead"]]),
    }
    yield from _csv_faults(file, {name: x.ravel() for name, x in columns.items()})


def _profile_faults(file: Path, run: Run) -> Faults:
    """Envelopes of depth and tension over x: from all taut frames, and of the car's path between them.

    Up to where waves get slower than the mass, too.
    """
    length = run["rest"]["length"]
    onset = run["rest"]["slack_onset"]
    until = math.inf
    if onset is not None:
        until = run["t"][np.argmin(np.abs(run["s_o"] - onset * length))]
    for flag in run["rest"]["flags"]:
        if flag["kind"] == "slow waves":
            until = min(until, np.interp(flag["numbers"]["since"] * length, run["s_o"], run["t"]))
    taut = run["t"] <= until
    x_rest = run["fields.x"]
    y_rest = run["fields.y"]
    x = np.linspace(x_rest[0], x_rest[-1], POINTS)
    depths = [np.interp(x, x_rest, y_rest)]
    tensions = [np.interp(x, x_rest, run["fields.T_static"])]
    car = car_positions(run)
    at_car = np.fmax(run["fields.T_behind"], run["fields.T_ahead"])
    for k in np.flatnonzero(run["fields.t"] <= until):
        i = int(np.searchsorted(run["fields.s"], run["fields.s_o"][k], side="right"))
        x_rope = np.insert(x_rest + run["fields.u"][k], i, car[k, 0])
        y_rope = np.insert(y_rest + run["fields.v"][k], i, car[k, 1])
        depths.append(np.interp(x, x_rope, y_rope))
        tensions.append(np.interp(x, x_rope, np.insert(run["fields.T"][k], i, at_car[k])))
    columns = {
        "x": x,
        "y_rest": depths[0],
        "y_highest": np.min(depths, axis=0),
        "y_lowest": np.maximum(np.max(depths, axis=0), max_depth_at(x, run["x"][taut], run["y"][taut])),
        "tension_max": np.max(tensions, axis=0),
        "tension_min": np.min(tensions, axis=0),
    }
    yield from _csv_faults(file, columns)


def car_positions(run: Run) -> Array:
    """Where the car is at each frame (k, 2): on the rope at rest, moved."""
    s_o = run["fields.s_o"]
    x = np.interp(s_o, run["fields.s"], run["fields.x"]) + run["fields.mass_u"]
    y = np.interp(s_o, run["fields.s"], run["fields.y"]) + run["fields.mass_v"]
    return np.stack([x, y], axis=1)


def _animation_faults(file: Path, run: Run) -> Faults:
    """Points, velocity and tension of the rope in some frames; the car's two ends come last."""
    for k, frame in _frames_of_animation(file, run):
        u = run["fields.u"][k]
        v = run["fields.v"][k]
        rates = [run["fields.du"][k], run["fields.dv"][k]]
        at_car = [np.interp(run["fields.s_o"][[k, k]], run["fields.s"], rate) for rate in rates]
        rope = _point_with_y_up(run["fields.x"] + u, run["fields.y"] + v)
        T = [*run["fields.T"][k], run["fields.T_behind"][k], run["fields.T_ahead"][k]]
        velocity = np.concatenate([_point_with_y_up(*rates), _point_with_y_up(*at_car)])
        moved = frame["points"] + frame["displacement"]  # (m + 2, 3)
        yield from _series_faults(
            f"rope in frame {k}", moved[:-2], rope, SINGLE_PRECISION, float(np.ptp(run["fields.x"]))
        )
        yield from _car_faults(k, moved[-1], run)
        yield from _series_faults(f"velocity in frame {k}", frame["velocity"], velocity, SINGLE_PRECISION)
        yield from _series_faults(f"tension in frame {k}", frame["tension"], np.array(T), SINGLE_PRECISION)


def _mass_faults(file: Path, run: Run) -> Faults:
    for k, frame in _frames_of_animation(file, run):
        yield from _car_faults(k, frame["points"] + frame["displacement"], run)
        for side in ("behind", "ahead"):
            T = run[f"fields.T_{side}"][k : k + 1]
            yield from _series_faults(f"tension {side} in frame {k}", frame[f"tension_{side}"], T, SINGLE_PRECISION)


def _car_faults(k: int, point: Array, run: Run) -> Faults:
    x, y = car_positions(run)[k]
    yield from _series_faults(f"car in frame {k}", point, _point_with_y_up(x, y), 1e-4, float(np.ptp(run["fields.x"])))


def _frames_of_animation(file: Path, run: Run) -> Iterator[tuple[int, dict[str, Array]]]:
    """Numbers and arrays of some frames of an animation, whose times must be those of the stored frames."""
    grids: list[Any] = [x for x in ElementTree.parse(file).iter("Grid") if x.get("GridType") == "Uniform"]
    times = np.array([float(grid.find("Time").get("Value")) for grid in grids])
    if not np.array_equal(times, run["fields.t"]):
        raise ValueError(f"{file}: frames at other times than were computed")
    for k in np.unique(np.linspace(0, len(grids) - 1, FRAMES).round().astype(int)):
        parts = [part for part in grids[k] if part.tag != "Topology" and part.find("DataItem") is not None]
        yield int(k), {part.get("Name") or "points": _values_of_item(part.find("DataItem"), file) for part in parts}


def _values_of_item(item: Any, file: Path) -> Array:
    """Values of an item of XDMF: in the file, or in the HDF5 beside it."""
    import h5py  # seldom needed

    text = item.text.strip()
    if item.get("Format") != "HDF":
        return np.array(text.split(), dtype=float)
    with h5py.File(file.with_suffix(".h5")) as data:
        return np.array(data[text.partition(":")[2]], dtype=float)


def _point_with_y_up(x: Any, y: Any) -> Array:
    return np.stack([x, -y, 0.0 * x], axis=-1)


def _summary_faults(file: Path, run: Run) -> Faults:
    """Numbers of summary.json that follow from the path; all others are as they are stored."""
    written = _read_json(file)
    rest = run["rest"]
    if abs(written["reached"] - run["s_o"][-1] / rest["length"]) > ROUNDING:
        yield "reached is not where the path ends"
    if written["max_deflection"] not in run["v"]:
        yield "max_deflection is no v of the path"
    for name in written.keys() & rest.keys() - {"flags"}:
        if written[name] != rest[name]:
            yield f"{name} is not as stored"
    for name in written.keys() - rest.keys() - COMPUTED - rest["work"].keys():
        yield f"key {name} has no second computation"


# keys of summary.json that are not stored as they are: this reader and `recomputed` compute them a second time
COMPUTED = {"reached", "max_deflection", "path_scale", "outcome", "outcome_kind", "flag_kinds", "limits"}
FILES: dict[str, Callable[[Path, Run], Faults] | None] = {
    "path.csv": _path_faults,
    "tension.csv": _tension_faults,
    "profile.csv": _profile_faults,
    "response.xdmf": _animation_faults,
    "mass.xdmf": _mass_faults,
    "summary.json": _summary_faults,
    "response.h5": None,  # by response.xdmf
    "response.npz": None,  # the stored fields themselves
}


# --- words and numbers of page and terminal -------------------------------------------------------------------------


@cache
def _read_words(package: str, file: str) -> dict[str, Any]:
    home = package if package.startswith("cablefem") else f"validation.{package}"
    return tomllib.loads(resources.files(home).joinpath(file).read_text(encoding="utf-8"))


def _quantity_words(row: Row) -> str:
    kind, _, of = row["quantity"].partition(":")
    quantities = _read_words("core", "quantities.toml")
    words: str = (quantities["main"] | quantities["more"])[kind][0]
    return words.format(of)


def _comparison_words(row: Row) -> str:
    """What a row of agreement.json compares, in the words of the page."""
    words = (row["quantity"].replace("_", " "), row.get("law"), row.get("with"))
    return plain_text(": ".join(x for x in words if x))


def _shows_number(text: str, row: Row) -> bool:
    """Whether a text shows a design number with its bar; a speed in m/s and km/h."""
    if row["value"] is None:
        return text == "the car never passes"
    parts = text.split(" = ")
    endings = ["m/s", "km/h"] if row["unit"] == "m/s" else [""]
    return [True] * len(endings) == [
        part.endswith(endings[i % len(endings)]) and shows_value(part, row["value"], row["unit"], bar=row.get("bar"))
        for i, part in enumerate(parts)
    ]


def _number_faults(cells: Sequence[str], of: StoredResults) -> Faults:
    name, value, when, car_at, at = cells
    name = re.sub(r" \(\d+ more, larger\)$", "", name)  # after the smallest of several clearances
    row = next((x for x in of.design if _quantity_words(x) == name), None)
    if row is None:
        yield f"{name}: no such design number"
        return
    if not _shows_number(value, row):
        yield f"{name}: {value} where {row['value']} {row['unit']} with the bar {row.get('bar')} is stored"
    where = row if row["value"] is not None else {}
    t = where.get("t")
    if when != "" if t is None else not shows_value(when, t, "s", digits=4):
        yield f"{name}: after {when} where {t} s is stored"
    for text, s in ((car_at, where.get("s_o")), (at, where.get("s"))):
        if not shows_decimals(text, s, "m", 1):
            yield f"{name}: at {text} where {s} m is stored"


def _support_load_faults(cells: Sequence[str], of: StoredResults) -> Faults:
    """Components of what a support carries at one instant: means over an axial round trip."""
    side, when, right, down = cells
    run = of.stored_run(0)
    t_max = next(x["t"] for x in of.design if x["quantity"] == f"reaction_{side}_max")
    cable = run["scene"]["cable"]
    period = 2.0 * run["rest"]["length"] * math.sqrt((cable["mass_per_length"] + ice_mass(cable)) / cable["EA"])
    force = -run[f"reaction_{side}"]  # (n, 2)
    known = np.isfinite(force).all(axis=1)
    mean = mean_around(run["t"][known], force[known], np.array([t_max]), period)[0]
    good = shows_value(right, mean[0], "N", digits=4) and shows_value(down, mean[1], "N", digits=4)
    if not good or not shows_value(when, t_max, "s", digits=4):
        yield f"{side} support: {right}, {down} after {when} where {mean} N after {t_max} s follow"


def _event_faults(cells: Sequence[str], of: StoredResults) -> Faults:
    event, t, s_o, speed = cells
    texts = [f"{t} s", f"{s_o} m", f"{speed} km/h"]
    for row in of.events:
        shown = [
            text[0] == " " or shows_value(text, row[name], unit, bar=row.get(f"bar_{name}"))
            for text, name, unit in zip(texts, ("t", "s_o", "speed"), ("s", "m", "m/s"), strict=True)
        ]
        if row["event"].replace("_", " ") == event and all(shown):
            return
    yield f"{event} {', '.join(texts)}: no such event is stored"


def _comparison_faults(cells: Sequence[str], of: StoredResults) -> Faults:
    name, verdict, *numbers, where, counts = cells
    for row in of.rows:
        words = [_comparison_words(row), row["verdict"] or "–", "asked" if row["asked"] else "shown only"]
        at = row.get("where")
        if (
            [name, verdict.lstrip("✓✗≈? "), counts] == words
            and _shows_gaps(numbers, row, 3)
            and (where == "–" if at is None else shows_decimals(where, at, "", 3))
        ):
            return
    yield f"{' | '.join(cells)}: no such comparison in agreement.json"


def _shows_gaps(texts: Sequence[str], row: Row, digits: int) -> bool:
    """Whether texts show gap, bars and tolerance of a comparison."""
    values = [row.get(name) for name in ("gap", "allowed", "asked_for")]
    return all(shows_value(text, value, digits=digits) for text, value in zip(texts, values, strict=True))


def _group_faults(cells: Sequence[str], of: StoredResults) -> Faults:
    group, verdict, text = cells
    groups = _read_words("commands.check", "words.toml")["groups"]
    others = {row["quantity"] for row in of.rows}.difference(*groups.values())
    rows = [row for row in of.rows if row["asked"] and row["quantity"] in groups.get(group, others)]
    worst = _worst_verdict(rows) or "–"
    if verdict.lstrip("✓✗≈? ") != worst:
        yield f"{group}: {verdict} where {worst} is the worst verdict"
    for name in ORDER:
        count = sum(row["verdict"] == name for row in rows)
        words = SHOWN_AS.get(name, name)
        if count and not re.search(rf"\b{count} {words}", text):
            yield f"{group}: {text!r} where {count} {words}"


def _cost_faults(cells: Sequence[str], of: StoredResults) -> Faults:
    method, *counts, seconds, reached = cells
    i = of.methods.index(method)
    summary = of.summaries[i]
    for name, text in zip(("n_dof", "steps", "newton_iterations"), counts, strict=True):
        if int(text.replace(" ", "")) != summary[name]:
            yield f"{name} of {method}: {text} where {summary[name]} is stored"
    if not shows_value(seconds, summary["seconds"], digits=3):
        yield f"seconds of {method}: {seconds} where {summary['seconds']} is stored"
    if not shows_decimals(reached, float(of.stored_run(i)["s_o"][-1]), "m", 1):
        yield f"{method} computed up to {reached}, which is not where its path ends"


def _setting_faults(cells: Sequence[str], of: StoredResults) -> Faults:
    name, text, _ = cells
    values = [(x | x["settings"]).get(name) for x in of.summaries]
    if text not in [f"{value:g}" if isinstance(value, float) else str(value) for value in values]:
        yield f"{name} = {text} where {values} is stored"


def _fact_faults(cells: Sequence[str], of: StoredResults) -> Faults:
    """What follows from the scene: length, tension and sag of the rope at rest, and how fast the car is."""
    name, text = cells
    run = of.stored_run(0)
    x = run["fields.x"]
    y = run["fields.y"]
    length = run["rest"]["length"]
    H = run["rest"]["horizontal_tension"]
    first, _, second = text.partition(", ")
    if name == "rope between the supports":
        good = shows_value(first, length, "m", digits=6)
    elif name == "horizontal tension at rest":
        good = shows_value(first, H, "N", digits=4)
    elif name == "sag at rest":
        below = CubicSpline(run["fields.s"], y - y[-1] / x[-1] * x)  # the chord
        sag = float(below(np.linspace(0.0, length, 20001)).max())
        share = second.removesuffix(" of the span")
        good = shows_value(first, sag, "m", digits=4) and shows_value(share, sag / float(x[-1]), digits=2)
    elif name == "top speed over that of waves across the rope":
        cable = run["scene"]["cable"]
        rho = cable["mass_per_length"] + ice_mass(cable)
        speed = np.max(np.abs(np.diff(run["s_o"]) / np.diff(run["t"])))  # steps are short chords of the travel
        good = abs(_parse_number(text.removesuffix(" %")) / 100.0 - speed * math.sqrt(rho / H)) < 0.06
    else:
        of.unread.append(name)
        return
    if not good:
        yield f"{name}: {text}"


def _input_faults(cells: Sequence[str], of: StoredResults) -> Faults:
    key, text, _ = cells
    value: Any = of.stored_run(0)["scene"]
    for name in key.split("."):
        value = value[int(name)] if isinstance(value, list) else value[name]
    if isinstance(value, int | float) and not isinstance(value, bool):
        good = abs(_parse_number(text.split(" ")[0]) - value) <= ROUNDING * abs(value)
    else:
        good = text.startswith(str(len(value)) if isinstance(value, list) else str(value))
    if not good:
        yield f"{key}: {text} where {value} was read"


def _no_faults(text: Any, of: StoredResults) -> Faults:
    """Words alone."""
    return iter(())


def count_faults(text: str, of: StoredResults) -> Faults:
    """Counts of comparisons of two solvers, of laws, and of numbers computed twice."""
    kinds = dict.fromkeys(("energy", "impulse", "laws_si"), "laws")
    kinds |= dict.fromkeys(("design", "outcome"), "printed numbers") | {"deep": ""}
    verdicts: dict[str, list[str]] = {}
    for row in of.rows:
        if row["asked"] and not row.get("with"):
            kind = kinds.get(row["quantity"], "comparisons of two solvers")
            verdicts.setdefault(kind, []).append(row["verdict"])
    verdicts.pop("", None)
    for kind, each in verdicts.items():
        good = each.count("agree")
        words = f"{good} {kind}" if good == len(each) else f"{good} of {len(each)} {kind}"
        if not re.search(rf"(?<!of )\b{words}\b", text):
            yield f"{text!r} where {words} agree or hold"


def limit_table_faults(html_text: str, rows: Sequence[Row]) -> Faults:
    """Faults of the tables of limits on a page, which show all stored rows."""
    shown = []
    for table in _contents_of_tags("table", html_text):
        rows_of_table = [_cell_texts(row) for row in _contents_of_tags("tr", table)]
        if rows_of_table and "|".join(rows_of_table[0]) == LIMITS:
            shown += rows_of_table[1:]
    if len(shown) != len(rows):
        yield f"{len(shown)} limits are shown where {len(rows)} are stored"
    for cells in shown:
        yield from _limit_row_faults(cells, rows)


def _limit_row_faults(cells: Sequence[str], rows: Sequence[Row]) -> Faults:
    for row in rows:
        verdict = cells[4].lstrip("✓✗≈? ")
        if (cells[0], cells[3], verdict) == (row["demand"], row["source"], row["verdict"]):
            side = f"{row['side']} "
            limit = {"value": row["limit"], "unit": row["unit"]}
            good = cells[2].startswith(side) and _shows_number(cells[2].removeprefix(side), limit)
            value = cells[1] in ("–", "-") if row["value"] is None else _shows_number(cells[1], row)
            if good and value:
                return
    yield f"{' | '.join(cells)}: no such limit is stored"


def _verification_row_faults(cells: Sequence[str], of: StoredResults) -> Faults:
    """A number in the terms of ASME V&V 20, whose row has no fault either."""
    name, printed, in_space, in_time, other, gap, uncertainty = cells
    row = next((x for x in of.agreement["verification"] if _quantity_words(x) == name), None)
    if row is None:
        yield f"{name}: not in the verification"
        return
    good = [
        _shows_number(printed, row),
        _shows_number(other, row | {"value": row["other"], "bar": row["bar_other"]}),
        *(
            shows_value(text, row[key], row["unit"], digits=2)
            for text, key in ((gap, "gap"), (uncertainty, "uncertainty"))
        ),
        *(
            text == "not reached" if row[key] is None else shows_decimals(text, row[key], "", 1)
            for text, key in ((in_space, "order_space"), (in_time, "order_time"))
        ),
    ]
    if not all(good):
        yield f"{' | '.join(cells)}: is not what is stored"


# --- verification ---------------------------------------------------------------------------------------------------

SAFETY = 1.25
ORDERS = (0.5, 12.0)  # that are observed
CREDITED = 2.0  # most


def verification_faults(of: StoredResults) -> Faults:
    """Faults of each row from the comparison of both solvers and from the values of three resolutions."""
    gaps = {x["law"]: x for x in of.rows if x["quantity"] == "design gap"}
    for row in of.agreement.get("verification", []):
        for fault in _verification_faults_of_row(of, row, gaps[row["quantity"]]):
            yield f"{row['quantity']}: {fault}"


def _verification_faults_of_row(of: StoredResults, row: Row, gap: Row) -> Faults:
    size = max(abs(row["value"]), abs(row["other"])) or 1.0
    i = of.methods.index(row["method"])
    values = [_stored_value(of, method, row["quantity"]) for method in (i, 1 - i)]
    bars = [size * gap[f"bar_{'ab'[method]}"] for method in (i, 1 - i)]
    expected = {"value": values[0], "other": values[1], "bar": bars[0], "bar_other": bars[1]}
    expected |= {"gap": abs(row["value"] - row["other"]), "uncertainty": math.hypot(row["bar"], row["bar_other"])}
    smallest = 0.0
    for direction in ("space", "time"):
        order = _observed_order(row[f"levels_{direction}"], row[f"ratios_{direction}"])
        finest, half = row[f"levels_{direction}"][:2]
        if (order is None) is not (row[f"order_{direction}"] is None):
            yield f"order in {direction} {row[f'order_{direction}']} where {order} follows"
        elif order is not None:
            expected[f"order_{direction}"] = order
        if finest != row["value"]:
            yield f"{finest} is not the value"
        credited = min(order or ORDERS[0], CREDITED)
        smallest += SAFETY * abs(finest - half) / (row[f"ratios_{direction}"][0] ** credited - 1.0)
    if smallest > row["bar"] * (1.0 + ROUNDING):
        yield f"the bar {row['bar']} is smaller than {smallest} from the last changes"
    for key, value in expected.items():
        if abs(row[key] - value) > 1e-5 * abs(value) + ROUNDING * size:
            yield f"{key} {row[key]} where {value} follows"


def _stored_value(of: StoredResults, method: int, quantity: str) -> float:
    """A design number of a method."""
    value: float = next(x["value"] for x in of.stored_run(method)["rest"]["design"] if x["quantity"] == quantity)
    return value


def _observed_order(levels: Sequence[float], ratios: Sequence[float]) -> float | None:
    """The order whose falling changes are those of three resolutions; None: none in the range."""
    if len(levels) < 3 or levels[0] == levels[1]:
        return None
    fall = abs((levels[1] - levels[2]) / (levels[0] - levels[1]))
    r, coarser = ratios

    def excess(p: float) -> float:
        return r**p * (coarser**p - 1.0) / (r**p - 1.0) - fall

    low, high = ORDERS
    return float(brentq(excess, low, high)) if excess(low) < 0.0 < excess(high) else None


def _printed_limit_faults(text: str, of: StoredResults) -> Faults:
    yield from _limit_row_faults(re.split("  +", text), of.limits)


# --- limits ---------------------------------------------------------------------------------------------------------

RATIOS = {  # of demands: numbers whose ratio they are
    "safety_factor": ("breaking_load", "tension_max"), "tension_over_contact": ("tension_min", "contact_max"),
    "sag_growth": ("sag_car_max", "sag_car_rest"),
}  # fmt: skip
NUMBERS = {  # of other demands
    "tension_over_wheel": "tension_over_wheel_min",
    "knee_empty": "knee_empty_min",
    "knee_loaded": "knee_max",
    "knee_last": "knee_max",
    "speed": "speed_max",
    "acceleration": "acceleration_max",
    "deceleration": "deceleration_max",
}
OVER = "smallest clearance over "
GROUND_NAMES = ("the ground", "ground")


def limit_faults(rows: Sequence[Row], scene: Row, design: Sequence[Row], events: Sequence[Row]) -> Faults:
    """Faults of verdicts on limits, from a scene's TOML, the shipped texts and the printed numbers."""
    given = scene.get("limits", {})
    shipped = _read_words("cablefem.scene", "limits.toml")
    for row in rows:
        words = shipped["demand"]
        name = next(key for key in words if re.fullmatch(words[key][0].format(".*"), row["demand"]))
        if [row["side"], row["unit"]] != words[name][1:3]:
            yield f"{row['demand']}: {row['side']} in {row['unit']}"
        if row["source"] == "the scene":
            known = given.get(name) == row["limit"]
        else:
            texts = shipped["text"].values()
            known = any(_states_rule(rule, name, row, text, scene) for text in texts for rule in text["limit"])
        if not known:
            yield f"{row['demand']}: {row['limit']} is not the limit of {row['source']}"
        yield from _verdict_faults(name, row, scene, design, events)
    sources = [row["source"] for row in rows]
    for name in given.get("use", []):
        if not any(source.startswith(shipped["text"][name]["source"]) for source in sources):
            yield f"{name}: none of its limits is printed"


def _states_rule(rule: Row, name: str, row: Row, text: Row, scene: Row) -> bool:
    """Whether a row states a rule of a text, which is for this obstacle and for what the scene says."""
    same = rule["demand"] == name and rule["limit"] == row["limit"]
    kind = _kinds_of_obstacles(scene).get(row["demand"].removeprefix(OVER))
    fits = rule.get("kind") in (None, kind) or kind is None
    applies = rule.get("when") in (None, *scene["limits"].get("when", []))
    return same and fits and applies and row["source"] == f"{text['source']}, {rule['clause']}"


def _kinds_of_obstacles(scene: Row) -> dict[str, str | None]:
    kinds = {x["name"]: x.get("kind") for x in scene.get("obstacle", [])}
    return kinds | {"the ground": scene["limits"].get("ground")}


def _verdict_faults(name: str, row: Row, scene: Row, design: Sequence[Row], events: Sequence[Row]) -> Faults:
    value = _limit_value(name, row, scene, design, events)
    if value is None or row["value"] is None:
        if value is not row["value"] or not row["verdict"].startswith(("cannot be judged: ", "not computed")):
            yield f"{row['demand']}: {row['value']}, {row['verdict']}, where {value} follows"
        return
    if abs(value - row["value"]) > ROUNDING * abs(value) + ROUNDING:
        yield f"{row['demand']}: {row['value']} where {value} follows"
    margin = value - row["limit"]
    if row["side"] != "at least":
        margin = -margin
    verdict = "met" if margin >= 0.0 else "not met"
    if row["bar"] is None or abs(margin) < row["bar"]:
        verdict = "too close to tell"
    if row["verdict"] != verdict:
        yield f"{row['demand']}: {row['verdict']} where {verdict} follows"


def _limit_value(
    name: str, row: Row, scene: Row, design: Sequence[Row], events: Sequence[Row]
) -> float | None:  # fmt: skip
    """The value of a demand; None where it is unknown."""
    values: Values = {}
    for number in design:
        if number["value"] is not None:
            kind, _, of = number["quantity"].partition(":")
            values.setdefault(kind, {})[of] = number["value"]
    if name == "clearance":
        return _clearance_for_demand(row, values, scene)
    if name == "arrival_speed":
        return next((x["speed"] for x in events if x["event"] in ("brake", "arrival")), None)
    if name == "swing_along":
        swings = [*values.get("swing_max", {}).values(), *values.get("swing_min", {}).values()]
        return float(np.tan(np.radians(np.abs(swings).max()))) if swings else None
    if name in NUMBERS:
        return _extreme_for_demand(name, values.get(NUMBERS[name], {}), scene)
    return _ratio_for_demand(name, values, scene) if name in RATIOS else None


Values = dict[str, dict[str, float]]  # numbers by kind, then by obstacle or contact


def _extreme_for_demand(name: str, numbers: dict[str, float], scene: Row) -> float | None:
    """The number of a demand; of knees under load, of the last contact before the end or of the others."""
    last = scene["contact"][-2]["name"] if "contact" in scene else ""
    if name.startswith("knee_l"):
        numbers = {of: x for of, x in numbers.items() if (of == last) is (name == "knee_last")}
    extreme = min if name in ("knee_empty", "tension_over_wheel") else max
    return extreme(numbers.values(), default=None)


def _ratio_for_demand(name: str, values: Values, scene: Row) -> float | None:
    """The ratio of two numbers that a demand names; the breaking load is the scene's."""
    if "breaking_load" in scene["cable"]:
        values["breaking_load"] = {"": scene["cable"]["breaking_load"]}
    above, below = (values.get(kind, {}).values() for kind in RATIOS[name])
    if not above or not below:
        return None
    ratio = min(above) / max(below)
    return ratio - 1.0 if name == "sag_growth" else ratio


def _clearance_for_demand(row: Row, values: Values, scene: Row) -> float | None:
    name = row["demand"].removeprefix(OVER)
    if _kinds_of_obstacles(scene).get(name) is None and row["source"] != "the scene":
        return None
    names = GROUND_NAMES if name in GROUND_NAMES else (name,)
    clearances = [numbers for kind, numbers in values.items() if kind.startswith("clearance")]
    found = [x for numbers in clearances for of, x in numbers.items() if of.split(" over ")[-1] in names]
    return min(found, default=None)


LIMITS = "limit|value|demanded|by|verdict"  # columns
TABLES: dict[str, Callable[[Sequence[str], StoredResults], Faults]] = {
    "quantity|value|when|car at|where": _number_faults,
    "support|when|to the right|down": _support_load_faults,
    LIMITS: _no_faults,  # by `limit_table_faults`
    "quantity|S|order in space|order in time|D||E||validation uncertainty": _verification_row_faults,
    "event|after [s]|at [m]|speed [km/h]": _event_faults,
    "comparison|verdict|gap|sum of both bars|asked for|largest at sₒ/l|in the verdict": _comparison_faults,
    "comparison|verdict|of those asked": _group_faults,
    "run|unknowns|steps|Newton iterations|time loop [s]|computed up to": _cost_faults,
    "setting|value|meaning": _setting_faults,
    "shared|checked on its own by": _no_faults,
    "question|answer": _no_faults,
    "follows from it|value": _fact_faults,
    "key|value|meaning": _input_faults,
}
SECTIONS = ("answer", "side-view", "ride", "tension", "scene", "how-sure", "rests")


def _contents_of_tags(tag: str, text: str) -> list[str]:
    """Contents of all elements of a tag, a pattern that may name a class."""
    name = tag.partition(" ")[0]
    return re.findall(rf"<{tag}[^>]*>(.*?)</{name}>", text, re.S)


def _cell_texts(row: str) -> list[str]:
    """Texts of a row's cells, or of its heads."""
    return [plain_text(x) for x in _contents_of_tags("t[hd]", row)]


def _section_html(html_text: str, name: str, command: str) -> str:
    """A section of a command; another command's may have the same name."""
    for of in (f"{name}-{command}", name):
        for content in _contents_of_tags(f'section id="{of}"', html_text):
            return str(content)
    return ""


def page_faults(html_text: str, command: str, of: StoredResults) -> Faults:
    """Faults of the sections of a page that show a run or a check."""
    sections = {name: _section_html(html_text, name, command) for name in SECTIONS}
    answer = sections["answer"]
    if not answer:
        yield "the page has no answer"
        return
    head = plain_text("".join(_contents_of_tags("h2", answer)))
    if of.agreement and not head.endswith(f" {of.verdict}"):
        yield f"the page's verdict is {head!r}, that of the rows {of.verdict}"
    summary = plain_text("".join(_contents_of_tags('p class="summary"', answer)))
    if not summary.startswith(plain_text(f"{of.outcome[0].upper()}{of.outcome[1:]}.")):
        yield f"{summary!r} where the outcome is {of.outcome!r}"
    if of.rows:
        yield from count_faults(summary, of)
    text = "".join(sections.values())
    yield from limit_table_faults(text, of.limits)
    for table in _contents_of_tags("table", text):
        yield from _table_faults(table, of)
    for data in _contents_of_tags('script type="application/json"', text):
        for fault in _side_view_faults(json.loads(data), of):
            yield f"side view: {fault}"


def _table_faults(table: str, of: StoredResults) -> Faults:
    rows = _contents_of_tags("tr", table)
    if not rows:  # the side view's, before its script runs
        return
    columns = "|".join(_cell_texts(rows[0]))
    reader = TABLES.get(columns)
    if reader is None:
        of.unread.append(columns)
        return
    for row in rows[1:]:
        yield from reader(_cell_texts(row), of)


# --- the side view --------------------------------------------------------------------------------------------------


def _side_view_faults(view: dict[str, Any], of: StoredResults) -> Faults:
    run = of.stored_run(0)
    path = path_columns(run)
    points = np.stack([path["x"], path["y"]], axis=1)  # (n, 2)
    reach = float(np.ptp(path["x"])) or 1.0
    track = view["paths"][0]
    drawn = np.array([track["x"], track["y"]]).T  # (m, 2)
    distances, _ = cKDTree(points).query(drawn)
    ends = np.linalg.norm(drawn[[0, -1]] - points[[0, -1]], axis=1)
    if max(*distances, *ends) > 1e-5 * reach:
        yield f"the path is {max(distances):.3g} m off path.csv"
    for mark in view["speeds"]:
        yield from _speed_mark_faults(mark, points, path["speed"], 0.01 * reach)
    scene = run["scene"]
    supports = scene["supports"]
    obstacles = [{"name": x["name"], "x": x["at"], "top": x["top"]} for x in scene.get("obstacle", [])]
    expected = {
        "span": supports["span"],
        "drop": supports.get("drop", 0.0),
        "obstacles": obstacles,
        "ground": scene.get("ground", []),
    }
    if track["below"] != scene["mass"].get("below", 0.0):
        yield "below is not the scene's"
    for name, value in expected.items():
        if view[name] != value:
            yield f"{name} is not the scene's"
    for cable in view["cables"]:
        yield from _moving_rope_faults(cable, view, of)


def _speed_mark_faults(mark: dict[str, Any], points: Array, speed: Array, near: float) -> Faults:
    """A car that rolls back passes a point twice: one of the speeds near a mark is its text."""
    distances = np.hypot(*(points - [mark["x"], mark["y"]]).T)
    i = np.flatnonzero(distances <= distances.min() + near)
    around = 3.6 * np.stack([speed[(i + j).clip(0, speed.size - 1)] for j in (-1, 0, 1)])  # (3, k)
    shown = float(mark["text"].removesuffix(" km/h"))
    if not np.any((around.min(axis=0) - 0.51 <= shown) & (shown <= around.max(axis=0) + 0.51)):
        yield f"{mark['text']} where the car has {around[1].mean():.1f} km/h"


# columns that a side view shows beside the car: column of path.csv and its SI unit
BESIDE = {"speed": ("speed", "m/s"), "press on the rope": ("F_contact", "N"), "haul or thrust": ("F_haul", "N")}


def _moving_rope_faults(cable: dict[str, Any], view: dict[str, Any], of: StoredResults) -> Faults:
    """Frames of a rope against the stored ones; a frame at rest may come first."""
    drawn = cable["touching"][0]
    run = of.stored_run(of.methods.index(drawn["name"]))
    t = run["fields.t"]
    stations = np.abs(run["fields.s"][:, None] - np.array(view["s"])).argmin(axis=0)  # (m,)
    car = car_positions(run)
    behind = run["fields.T_behind"]
    ahead = run["fields.T_ahead"]
    sides = {"behind": np.where(np.isnan(behind), ahead, behind), "ahead": np.where(np.isnan(ahead), behind, ahead)}
    series = {name: cable[name] for name in ("t", "u", "v", "T")}
    expected = {"t": t} | {name: run[f"fields.{name}"][:, stations] for name in ("u", "v", "T")}
    places = {"s": run["fields.s_o"], "x": car[:, 0], "y": car[:, 1]}
    series |= {name: drawn[name] for name in (*places, *sides)}
    expected |= places | sides
    path = path_columns(run)
    felt: dict[str, tuple[Any, str]] = {f"tension {side}": (values, "N") for side, values in sides.items()}
    felt["deflection"] = run["fields.mass_v"], "m"
    felt |= {name: (np.interp(t, path["t"], path[column]), si) for name, (column, si) in BESIDE.items()}
    for beside in drawn["readout"]:
        name, _, unit = beside["name"].rstrip("]").partition(" [")
        values, si = felt[name]
        series[name] = beside["data"]
        expected[name] = values / si_factor(unit, si)
    if si_factor(view["unitName"], "N") != view["unit"]:
        yield f"forces are in {view['unitName']} but divided by {view['unit']}"
    for name, values in expected.items():
        rounding = 1e-4 * float(np.ptp(run["fields.x"])) if name in ("x", "y") else 0.0
        yield from _packed_faults(name, series[name], values, rounding)
        if _unpacked(series[name]).size not in (values.size, values.size // t.size * (t.size + 1)):
            yield f"{name} has other frames than are stored"


def _packed_faults(name: str, part: dict[str, Any], values: Array, rounding: float = 0.0) -> Faults:
    """Faults of a packed series that ends with these values."""
    allowed = _packing_step(part) + rounding
    yield from _series_faults(name, _unpacked(part)[-values.size :], values.ravel(), 1.0, allowed)


def _packing_step(part: dict[str, Any]) -> float:
    """Rounding of a packed series."""
    return float((part["high"] - part["low"]) / PACKED + 1e-12 * abs(part["high"]))


def _unpacked(part: dict[str, Any]) -> Array:
    steps = np.frombuffer(base64.b64decode(part["data"]), "<u2")
    return np.asarray(part["low"] + (part["high"] - part["low"]) / PACKED * steps)


def line_motion_faults(html_text: str, folder: Path, motion: Any) -> Faults:
    """Faults of rope.csv, and of the side view of a line in motion."""
    rope = read_columns(folder / "rope.csv")
    t = np.unique(rope["t"])
    stations = np.searchsorted(motion.s, np.unique(rope["s"]) - 1e-9 * motion.s[-1])  # (m,)
    steps = np.searchsorted(motion.t, t - 1e-9 * motion.t[-1])  # (n,)
    shape = steps.size, stations.size
    grid = np.ix_(steps, stations)
    columns = {
        "t": np.broadcast_to(motion.t[steps, None], shape), "s": np.broadcast_to(motion.s[stations], shape),
        "x": motion.points[grid][..., 0], "y": motion.points[grid][..., 1], "T": motion.tension[grid],
    }  # fmt: skip
    ends = motion.t[[0, -1]]
    for name, values in columns.items():
        allowed = ROUNDING * np.nanmax(np.abs(values)) + 1e-12
        if not np.allclose(rope[name], values.ravel(), rtol=0.0, atol=allowed, equal_nan=True):
            yield f"rope.csv: {name} is not what was computed"
    if not np.allclose(t[[0, -1]], ends, rtol=1e-9, atol=0.0):
        yield "rope.csv ends before the run does"
    for data in _contents_of_tags('script type="application/json"', html_text):
        view = json.loads(data)
        cable = view["cables"][0]
        here = np.isfinite(columns["T"])
        for name, column in (("u", "x"), ("v", "y"), ("T", "T")):
            shown = _unpacked(cable[name]).reshape(shape)
            yield from _series_faults(
                f"side view: {name}", shown[here], columns[column][here], 1.0, _packing_step(cable[name])
            )
        yield from _packed_faults("side view: t", cable["t"], t)
        for car in motion.cars:
            drawn = next(x for x in cable["touching"] if x["name"] == car.name)
            path = {name: x[steps] for name, x in read_columns(folder / f"path-{car.name}.csv").items()}
            for fault in _drawn_car_faults(drawn, car, steps, path):
                yield f"side view: {car.name}: {fault}"


def _drawn_car_faults(drawn: dict[str, Any], car: Any, steps: Array, path: dict[str, Array]) -> Faults:
    """Faults of a packed car; path : its columns at these steps."""
    x, y = car.point[steps].T
    known = {"s": car.s[steps], "x": x, "y": y}
    known |= {"behind": car.tension_behind[steps], "ahead": car.tension_ahead[steps]}
    if car.turning is not None:
        known["turn"] = car.turning.angle[steps]
        if drawn["body"] != ("wheels" if car.turning.wheels else "hangs"):
            yield "another body is drawn"
    for name, values in known.items():
        yield from _packed_faults(name, drawn[name], values)
    columns = BESIDE | {"deflection": ("v", "m"), "swing": ("swing", "deg"), "pitch": ("pitch", "deg")}
    columns |= {f"tension {side}": (f"T_{side}", "N") for side in ("behind", "ahead")}
    columns |= {f"{side} wheel": (f"wheel_{side}", "N") for side in ("rear", "front")}
    for beside in drawn["readout"]:
        name, _, unit = beside["name"].rstrip("]").partition(" [")
        column, si = columns[name]
        yield from _packed_faults(name, beside["data"], path[column] / si_factor(unit, si))


# --- terminal -------------------------------------------------------------------------------------------------------


def terminal_faults(printed: Sequence[str], of: StoredResults) -> Faults:
    """Faults of what a run or a check printed."""
    stored = _stored_sentences(of)
    for text in printed:
        reader = next((read for pattern, read in LINE_CHECKS if re.match(pattern, text)), _printed_number_faults)
        if text.strip() and text.strip() not in stored:
            yield from reader(text.strip(), of)


def _stored_sentences(of: StoredResults) -> set[str]:
    """Sentences that are printed as they are stored."""
    sentences = {f"{of.summaries[0]['scene']}: {of.outcome}"}
    for summary in of.summaries:
        sentences |= set(summary["flags"])
    for doubt in of.agreement.get("doubts", []):
        sentences.add(f"{doubt['method']}: {doubt['words']}")
    if of.agreement:
        sentences.add(_read_words("page", "assets/verdicts.toml")[of.verdict])
    return sentences


def _printed_number_faults(text: str, of: StoredResults) -> Faults:
    """A design number; of two names that begin alike the longer one."""
    rows = [row for row in of.design if text.startswith(f"{_quantity_words(row)} ")]
    if not rows:
        of.unread.append(text)
        return
    row = max(rows, key=lambda x: len(_quantity_words(x)))
    rest = re.sub(r"^\(\d+ more, larger\)", "", text.removeprefix(_quantity_words(row)).strip()).strip()
    parts = re.fullmatch(r"(.*?)(?:, at ([\d.-]+ m))?(?: after (\S+ s))?", rest)
    assert parts is not None
    value, at, when = parts.groups("")
    car = f"{row['s_o']:.1f} m" if row.get("s_o") is not None and row["value"] is not None else ""
    yield from _number_faults([_quantity_words(row), value, when, car, at], of)


def _printed_event_faults(text: str, of: StoredResults) -> Faults:
    parts = re.fullmatch(r"(.*?) +after (.*) s at (.*) m(?: with (.*) km/h)?", text)
    if parts is None or parts[1].replace(" ", "_") not in [row["event"] for row in of.events]:
        of.unread.append(text)
    else:
        yield from _event_faults(parts.groups(""), of)


def _printed_slack_faults(text: str, of: StoredResults) -> Faults:
    row = next((x for x in of.design if x["quantity"] == "slack_onset"), {"value": None})
    length = of.stored_run(0)["rest"]["length"]
    number = text.removeprefix("slack somewhere from car at ").partition(" on;")[0]
    if row["value"] is None or not shows_value(number, row["value"] * length, "m", bar=(row["bar"] or 0.0) * length):
        yield f"{text!r} is not the stored slack onset"


def _scope_faults(text: str, of: StoredResults) -> Faults:
    """What a text is for, and whether the scene is that."""
    for x in _read_words("cablefem.scene", "limits.toml")["text"].values():
        expected = f"{x['source']}: for {x['scope']}"
        if of.stored_run(0)["rest"]["drive"] not in x["modes"]:
            expected += "; this scene is outside its scope"
        if text == expected:
            return
    yield f"{text!r} is no scope of a text"


def _printed_work_faults(text: str, of: StoredResults) -> Faults:
    parts = re.fullmatch(r"by (\S+) \((.*)\) in (\S+) s(?:; path ± (\S+) m)?", text)
    run = of.summaries[0]
    if parts is None or parts[1] != run["method"]:
        yield f"{text!r} is not the stored run"
        return
    settings = {f"{key}={value}" for key, value in run["settings"].items()} | {run["model"], run["load"], run["law"]}
    if not set(parts[2].split(", ")) <= settings:
        yield f"{parts[2]!r} are not the stored settings"
    bar = None if run["path_error"] is None else run["path_error"] * run["path_scale"]
    if not shows_value(parts[3], run["seconds"], digits=2) or not shows_value(parts[4] or "–", bar, digits=2):
        yield f"{text!r}: {run['seconds']} s and {bar} m are stored"


def _printed_comparison_faults(text: str, of: StoredResults) -> Faults:
    """Name, gap, bars, tolerance, where, verdict."""
    name, *cells, verdict = re.split("  +", text)
    for row in of.rows:
        words = " ".join(row[key] for key in ("quantity", "law", "with") if row.get(key))
        if (name, verdict) == (words, row["verdict"] or "shown") and _shows_gaps(cells[:3], row, 2):
            return
    yield f"{text!r} is no comparison in agreement.json"


def _printed_third_party_faults(text: str, of: StoredResults) -> Faults:
    words = _read_words("commands.check", "words.toml")["third"]
    for party in {row["with"] for row in of.rows if row.get("with")}:
        worst = _worst_verdict(row for row in of.rows if row.get("with") == party)
        if text.startswith(f"{party}: {words[worst or 'not comparable']}"):
            return
    yield f"{text!r} is no verdict on another program"


LINE_CHECKS: tuple[tuple[str, Callable[[str, StoredResults], Faults]], ...] = (
    (r"  slack somewhere from car at ", _printed_slack_faults),
    (r"  by the quasi-static model|  Nothing could be compared|  written to |quantity +gap", _no_faults),
    (r"  by \S+ \(", _printed_work_faults),
    (r"limit  +value", _no_faults),
    (r"\S.*  (met|not met|too close to tell|cannot be judged: .*|not computed.*)$", _printed_limit_faults),
    (r"  [^:]*: for .*", _scope_faults),
    (r"  \d+ (of \d+ )?(comparisons|laws|printed)", count_faults),
    (r"  \S.*: (agrees|DISAGREES|is too coarse|cannot be compared)", _printed_third_party_faults),
    (r"\S.*(  +(-|\d\S*)){4}  (agree|disagree|too coarse|not comparable|shown)$", _printed_comparison_faults),
    (r"  \S.* after \S+( ± \S+)? s at .* m", _printed_event_faults),
)


# --- an inverse question ----------------------------------------------------------------------------------------------

_CLAUSE = re.compile(r"(.+?)\s*(<=|>=|<|>|=)\s*(\S+)\s*(\S*)")
_ANSWER = re.compile(rf"(at most|at least) (about )?({_NUMBER}(?: ± {_NUMBER})?)(?: (\S+))?; (above|below): ")
EVENT_UNITS = {"t": "s", "s_o": "m", "speed": "m/s"}


def find_faults(folder: Path, html_text: str, printed: Sequence[str]) -> Faults:
    """Faults of find.json, find.csv, their page and what was printed."""
    found = _read_json(folder / "find.json")
    section = _section_html(html_text, "find", "find")
    rows = [
        _cell_texts(row) for table in _contents_of_tags("table", section) for row in _contents_of_tags("tr", table)
    ][1:]
    if "rows" in found:
        sentences = [f"{found['for']} = {row['of']}: {row['answer']}" for row in _curve_points(found["rows"])]
        yield from _curve_faults(found, folder / "find.csv", rows)
    else:
        sentences = [found["sentence"]]
        yield from _search_faults(found)
        if plain_text("".join(_contents_of_tags('p class="summary"', section))) != plain_text(found["sentence"]):
            yield "the page has another answer than find.json"
        tried = [[x["value"], "yes" if x["holds"] else "no", x["outcome"]] for x in found["evaluations"]]
        yield from _row_faults([[cells[0], *cells[2:]] for cells in rows], tried)
        for cells, row in zip(rows, found["evaluations"], strict=False):
            yield from _row_faults([cells[1].split("; ")], [list(itertools.chain(*row["read"]))])
    for sentence in sentences:
        if sentence not in printed:
            yield f"{sentence!r} was not printed"


def _curve_points(rows: Sequence[Row]) -> list[Row]:
    """Rows of a curve, whose first key is the one that varies."""
    return [dict(zip(("of", "value", "answer"), row.values(), strict=True)) for row in rows]


def _curve_faults(found: Row, table: Path, shown: Sequence[Sequence[str]]) -> Faults:
    """Faults of a curve in find.csv and in the rows of its page."""
    stored = [list(row.values()) for row in found["rows"]]
    expected = [[found["for"], found["key"], "answer"], *stored]
    with table.open(encoding="utf-8", newline="") as file:
        if [*csv.reader(file)] != [["" if x is None else str(x) for x in row] for row in expected]:
            yield "find.csv is not find.json"
    for row in _curve_points(found["rows"]):
        match = _ANSWER.search(row["answer"])
        unknown = row["value"] is None
        if (match is None) is not unknown or (match and not _rounds_to(match, row["value"])):
            yield f"{row['answer']!r} where {row['value']} is stored"
    yield from _row_faults(shown, stored)


def _row_faults(shown: Sequence[Sequence[str]], stored: Sequence[Sequence[Any]]) -> Faults:
    if len(shown) != len(stored):
        yield f"{len(shown)} rows are shown where {len(stored)} are stored"
    for cells, row in zip(shown, stored, strict=False):
        for text, value in zip(cells, row, strict=True):
            if isinstance(value, str) and value:
                good = text == plain_text(value)
            else:
                good = shows_value(text, None if value == "" else value, digits=6)
            if not good:
                yield f"{text} is shown where {value} is stored"


def _rounds_to(match: re.Match[str], value: float) -> bool:
    """Whether an answer in words is a value to its last digit, two of one that is about."""
    bar = match[3].partition(" ± ")[2]
    return shows_value(match[3], value, bar=float(bar) if bar else None, digits=2 if match[2] else 5)


def _search_faults(found: Row) -> Faults:
    """Faults of the values that were tried, of each change between them, and of the sentence."""
    clauses = [_CLAUSE.fullmatch(text.strip()) for text in re.split(r"\band\b", found["condition"])]
    reads = {row["value"]: list(itertools.chain(*row["read"])) for row in found["evaluations"]}
    rooms = {value: list(map(_clause_margin, itertools.cycle(clauses), read)) for value, read in reads.items()}
    for row in found["evaluations"]:
        if row["holds"] is not all(room >= 0.0 for room in rooms[row["value"]]):
            yield f"at {row['value']}: holds is {row['holds']} where {rooms[row['value']]} follow"
    first = found["changes"][0] if found["changes"] else {}
    for name in ("value", "bar", "holds_at", "fails_at"):
        if found[name] != first.get(name):
            yield f"{name} is not that of the first change"
    yield from _changes_faults(found, rooms, reads)


def _changes_faults(found: Row, rooms: dict[float, list[float]], reads: dict[float, list[Any]]) -> Faults:
    """Faults of each change, and of its answer in words."""
    answers = [] if "interrupted" in found["sentence"] else list(_ANSWER.finditer(found["sentence"]))
    if answers and len(answers) != len(found["changes"]):
        yield f"{len(answers)} answers in words of {len(found['changes'])}"
    for i, change in enumerate(found["changes"]):
        yield from _change_faults(change, rooms, reads)
        if answers:
            yield from _answer_faults(answers[i], change)


def _clause_margin(match: re.Match[str] | None, read: Any) -> float:
    """By how much a clause holds; negative or nan: it does not."""
    if match is None or match[2] == "=":
        return 0.0 if read == ("met" if match is None else match[3]) else math.nan
    if read is None:
        return math.nan
    kind = re.split("[.:]", match[1])[0]
    quantities = _read_words("core", "quantities.toml")
    units = {name: row[1] for table in ("main", "more") for name, row in quantities[table].items()}
    unit = next((units[name] for name in (kind, f"{kind}_min", f"{kind}_max") if name in units), None)
    if unit is None:
        unit = EVENT_UNITS[match[1].partition(".")[2]]
    room = float(read) - float(match[3]) * si_factor(match[4], unit)
    return room if match[2][0] == ">" else -room


def _change_faults(change: Row, rooms: dict[float, list[float]], read: dict[float, list[Any]]) -> Faults:
    """Faults of a change: where the first number that fails crosses its limit on a chord, and the bar of a check."""
    good, bad = change["holds_at"], change["fails_at"]
    above, below = rooms[good], rooms[bad]
    if not all(x >= 0.0 for x in above) or all(x >= 0.0 for x in below):
        yield f"the condition does not change between {good} and {bad}"
    shares = [a / (a - b) for a, b in zip(above, below, strict=False) if b < 0.0 <= a]
    value = good + min(shares, default=0.0) * (bad - good)
    if abs(change["value"] - value) > 1e-9 * abs(value):
        yield f"value {change['value']} where {value} follows"
    if change["checked"] is not None and change["bar"] is not None:
        i, number, of_number = change["checked"]
        slope = abs((read[bad][i] - read[good][i]) / (bad - good))
        bar = (abs(number - read[good][i]) + of_number) / slope
        if abs(change["bar"] - bar) > ROUNDING * bar:
            yield f"bar {change['bar']} where {bar} follows from the check"


def _answer_faults(match: re.Match[str], change: Row) -> Faults:
    at_most = change["fails_at"] > change["holds_at"]
    words = match[1] == ("at most" if at_most else "at least") and match[5] == ("above" if at_most else "below")
    width = max(change["bar"] or 0.0, abs(change["fails_at"] - change["holds_at"]))
    good = _rounds_to(match, change["value"]) if match[2] else shows_value(match[3], change["value"], bar=width)
    if not words or not good or (match[4] or "") != change["unit"]:
        yield f"{match[0]!r} where {change['value']} with the bar {change['bar']} is stored"
