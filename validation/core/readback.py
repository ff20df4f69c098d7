"""What was written, read back: files, page and terminal against the stored fields and JSON files.

It imports nothing of what writes them; units, factors and digits are its own.  Every reader yields faults, sentences.
A table or line without a reader is noted: a test fails then.
"""

from __future__ import annotations

import base64
import html
import json
import math
import re
import tomllib
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.spatial import cKDTree

Array = NDArray[np.float64]
Faults = Iterator[str]

ROUNDING = 1e-9  # of a column's largest value
SINGLE = 1e-6  # of single precision
FRAMES = 5  # of an animation that are read
PLACES = 201
PACKED = 65535  # steps between the extremes of a packed series

# SI unit: printed units and what a value in SI is multiplied by
FACTORS = {
    "N": {"N": 1.0, "kN": 1e-3, "MN": 1e-6, "GN": 1e-9}, "m": {"m": 1.0, "mm": 1e3}, "s": {"s": 1.0},
    "m/s": {"m/s": 1.0, "km/h": 3.6}, "deg": {"deg": 1.0}, "": {"": 1.0}, "s_o/l": {"": 1.0}, "%": {"%": 100.0},
}  # fmt: skip
LAWS = {"energy", "impulse", "laws_si"}
PRINTED = {"design", "outcome"}
SHARED = {"deep"}
COUNTED = {"agree": "agree", "disagree": "disagree", "too coarse": "too coarse to tell",
           "not comparable": "cannot be compared"}  # fmt: skip


class Stored:
    """What a run or a check stored in a folder: of methods, the first one's numbers are those shown."""

    def __init__(self, folder: Path, methods: Sequence[str], judged: bool) -> None:
        self.folder = folder
        self.methods = methods
        self.summaries = [_json(folder / name / "summary.json") for name in methods]
        self.agreement = _json(folder / "agreement.json") if judged else {}
        shown = self.agreement or self.summaries[0]
        self.design: list[dict[str, Any]] = shown["design"]
        self.events: list[dict[str, Any]] = [*shown["events"], *self.agreement.get("quasi_static", [])]
        self.rows: list[dict[str, Any]] = self.agreement.get("rows", [])
        self.outcome: str = self.summaries[0].get("outcome", "")
        self.unread: list[str] = []  # what has no reader

    @property
    def asked(self) -> list[dict[str, Any]]:
        return [row for row in self.rows if row["asked"] and not row.get("with")]

    @property
    def verdict(self) -> str:
        """Of both solvers; a third party has its own."""
        return _worst(self.asked) or "not comparable"

    @cache  # noqa: B019  a few, short-lived
    def run(self, i: int) -> dict[str, Any]:
        """The stored arrays of a method, and its scene's TOML."""
        with np.load(self.folder / self.methods[i] / "response.npz", allow_pickle=False) as data:
            arrays: dict[str, Any] = {name: data[name] for name in data.files if name != "_rest"}
            arrays["rest"] = json.loads(str(data["_rest"]))
        arrays["scene"] = tomllib.loads(arrays["rest"]["scene_toml"])
        return arrays


def _worst(rows: Sequence[dict[str, Any]]) -> str | None:
    verdicts = {row["verdict"] for row in rows if row["asked"]}
    return next((v for v in ("disagree", "not comparable", "too coarse", "agree") if v in verdicts), None)


def _json(file: Path) -> Any:
    return json.loads(file.read_text(encoding="utf-8"))


# --- numbers in text ------------------------------------------------------------------------------------------------

_NUMBER = r"-?\d[\d ]*(?:\.\d+)?(?: × 10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?(?:e[+-]?\d+)?"
_VALUE = re.compile(rf"({_NUMBER})(?: ± ({_NUMBER}))?(?: ?([a-zA-Z%°][\w/%°]*))?")
_POWERS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def _plain(text: str) -> str:
    """The text of HTML, with plain minus signs and spaces."""
    text = html.unescape(re.sub(r"<[^>]*>", "", text)).replace("\u202f", " ").replace("−", "-")
    return re.sub(r"\s+", " ", text).strip()


def _real(text: str) -> float:
    mantissa, _, power = text.partition(" × 10")
    return float(mantissa.replace(" ", "")) * 10.0 ** int(power.translate(_POWERS) or 0)


def _magnitude(x: float) -> int:
    return math.floor(math.log10(abs(x)))


def shows(text: str, value: float | None, unit: str = "", *, bar: float | None = None, digits: int = 5) -> bool:
    """Whether a text shows a value in SI to its last digit, with its bar to two digits and a unit that suits.

    digits : of a value without bar; the digits before the point all count.
    """
    if value is None or not math.isfinite(value):
        return text in ("–", "-")
    found = _VALUE.fullmatch(text)
    factor = None if found is None else FACTORS[unit].get(found[3] or "")
    if found is None or factor is None:
        return False
    shown = _real(found[1])
    value = factor * value
    bar = factor * bar if bar and math.isfinite(bar) else 0.0
    if abs(value) < 1e-9 and digits >= 5:
        return shown == 0.0 and found[2] is None
    if bar < ROUNDING * abs(value) or bar == 0.0:
        step = 10.0 ** (_magnitude(value) - digits + 1) if value else 1.0
        return found[2] is None and abs(shown - value) <= 0.501 * step
    step = 10.0 ** (_magnitude(bar) - 1)
    return found[2] is not None and max(abs(shown - value), abs(_real(found[2]) - bar)) <= 0.501 * step


def _fixed(text: str, value: float | None, unit: str, decimals: int) -> bool:
    """The same of a value with so many decimals; "" if it is unknown."""
    if value is None:
        return text == ""
    found = re.fullmatch(rf"(-?\d+\.\d{{{decimals}}})(?: (.*))?", text)
    return found is not None and (found[2] or "") == unit and abs(float(found[1]) - value) <= 0.501 * 10.0**-decimals


# --- files ----------------------------------------------------------------------------------------------------------


def files(of: Stored) -> Faults:
    """Faults of the files of each method."""
    for i, method in enumerate(of.methods):
        for name, reader in FILES.items():
            file = of.folder / method / name
            if reader is not None and file.exists():
                yield from (f"{file}: {fault}" for fault in reader(file, of.run(i)))


def _table(file: Path) -> dict[str, Array]:
    """Columns of a CSV; nan for empty cells."""
    head, _, body = file.read_text(encoding="ascii").partition("\n")
    names = head.split(",")
    body = f",{body.strip()}".replace("\n", ",")
    while ",," in body:
        body = body.replace(",,", ",nan,")
    body = body[1:] + ("nan" if body.endswith(",") else "")
    return dict(zip(names, np.fromstring(body, sep=",").reshape(-1, len(names)).T, strict=True))


def _columns(found: dict[str, Array], wanted: dict[str, Array], rounding: float = ROUNDING) -> Faults:
    for name in found.keys() ^ wanted.keys():
        yield f"column {name} has no second computation or is not there"
    for name in found.keys() & wanted.keys():
        yield from _series(name, found[name], wanted[name], rounding)


def _series(name: str, found: Array, wanted: Array, rounding: float, scale: float | None = None) -> Faults:
    if found.shape != wanted.shape or not np.array_equal(np.isnan(found), np.isnan(wanted)):
        yield f"{name} has other rows than were computed"
        return
    off = float(np.nanmax(np.abs(found - wanted), initial=0.0))
    scale = scale or float(np.nanmax(np.abs(wanted), initial=0.0)) or 1.0
    if off > rounding * scale:
        yield f"{name} is not what was computed: off by {off:.3g} of {scale:.3g}"


def _path(file: Path, of: dict[str, Any]) -> Faults:
    yield from _columns(_table(file), path_of(of))


def path_of(of: dict[str, Any]) -> dict[str, Array]:
    """Columns of path.csv from the stored arrays (n,)."""
    tangent = of["slope_behind"] + of["slope_ahead"]  # (n, 2)
    across = tangent[:, 0] * of["contact"][:, 1] - tangent[:, 1] * of["contact"][:, 0]
    stored = {name: of[name] for name in ("t", "s_o", "x", "y", "u", "v", "T_behind", "T_ahead", "F_haul")}
    return stored | {
        "speed": np.sqrt(np.sum(of["velocity"] ** 2, axis=1)),
        "F_contact": across / np.sqrt(np.sum(tangent**2, axis=1)),
    }  # fmt: skip


def _tension(file: Path, of: dict[str, Any]) -> Faults:
    """All rows are counted; those of some frames are read."""
    head, *lines = file.read_text(encoding="ascii").splitlines()
    k, m = of["fields.T"].shape
    if head != "t,s,T" or len(lines) != k * (m + 2):
        yield "columns are not t, s, T, or rows are missing"
        return
    for i in np.unique(np.linspace(0, k - 1, 4 * FRAMES).round().astype(int)):
        cells = [line.split(",") for line in lines[i * (m + 2) : (i + 1) * (m + 2)]]
        found = np.array([[float(cell or "nan") for cell in row] for row in cells])  # (m + 2, 3)
        at_car = [[of["fields.s_o"][i], of[f"fields.T_{side}"][i]] for side in ("behind", "ahead")]
        wanted = np.vstack([np.stack([of["fields.s"], of["fields.T"][i]], axis=1), at_car])
        yield from _series("t", found[:, 0], np.full(m + 2, of["fields.t"][i]), ROUNDING)
        yield from _series("s", found[:, 1], wanted[:, 0], ROUNDING)
        yield from _series("T", found[:, 2], wanted[:, 1], ROUNDING)


def _profile(file: Path, of: dict[str, Any]) -> Faults:
    """Envelopes of depth and tension over x: from all taut frames, and of the car's path between them."""
    onset = of["rest"]["slack_onset"]
    until = math.inf
    if onset is not None:
        until = of["t"][np.argmin(np.abs(of["s_o"] - onset * of["rest"]["length"]))]
    taut = of["t"] <= until
    x_rest = of["fields.x"]
    y_rest = of["fields.y"]
    x = np.linspace(x_rest[0], x_rest[-1], PLACES)
    depth = [np.interp(x, x_rest, y_rest)]
    pull = [np.interp(x, x_rest, of["fields.T_static"])]
    s = of["fields.s"]
    s_o = of["fields.s_o"]
    car = car_of(of)
    at_car = np.fmax(of["fields.T_behind"], of["fields.T_ahead"])
    for k, place in enumerate(s_o[of["fields.t"] <= until]):
        i = int(np.searchsorted(s, place, side="right"))
        rope = np.insert(x_rest + of["fields.u"][k], i, car[k, 0])
        depth.append(np.interp(x, rope, np.insert(y_rest + of["fields.v"][k], i, car[k, 1])))
        pull.append(np.interp(x, rope, np.insert(of["fields.T"][k], i, at_car[k])))
    yield from _columns(_table(file), {
        "x": x, "y_rest": depth[0], "y_highest": np.min(depth, axis=0),
        "y_lowest": np.maximum(np.max(depth, axis=0), _deepest(x, of["x"][taut], of["y"][taut])),
        "tension_max": np.max(pull, axis=0), "tension_min": np.min(pull, axis=0),
    })  # fmt: skip


def car_of(of: dict[str, Any]) -> Array:
    """Where the car is at each frame (k, 2): on the rope at rest, moved."""
    rest = [np.interp(of["fields.s_o"], of["fields.s"], of[f"fields.{name}"]) for name in "xy"]
    return np.stack([rest[0] + of["fields.mass_u"], rest[1] + of["fields.mass_v"]], axis=1)


def _deepest(at: Array, x: Array, y: Array) -> Array:
    """Deepest y of a polyline (n,) at each place (m,); -inf where it does not pass."""
    low = np.minimum(x[:-1], x[1:])
    high = np.maximum(x[:-1], x[1:])
    out = np.full(at.size, -math.inf)
    for j, place in enumerate(at):
        i = np.flatnonzero((low <= place) & (place <= high) & (low < high))
        if i.size:
            w = (place - x[i]) / (x[i + 1] - x[i])
            out[j] = np.max(y[i] + w * (y[i + 1] - y[i]))
    return out


def _animation(file: Path, of: dict[str, Any]) -> Faults:
    """Points, displacement, velocity and tension of some frames; y is up there, the car's two ends come last."""
    import h5py

    x = of["fields.x"]
    s = of["fields.s"]
    s_o = of["fields.s_o"]
    reach = float(x[-1] - x[0])
    with h5py.File(file.with_suffix(".h5")) as data:
        for k, grid in _frames(file, of):
            frame = {
                name: np.array(data[str(item.text).strip().partition(":")[2]], dtype=float)
                for name, item in _items(grid) if item.get("Format") == "HDF"
            }  # fmt: skip
            moved = frame["points"] + frame["displacement"]  # (m + 2, 3)
            rates = [of["fields.du"][k], of["fields.dv"][k]]
            at_car = [np.interp(s_o[k : k + 1], s, rate) for rate in rates]
            speed = np.concatenate([_up(*rates), _up(*at_car), _up(*at_car)])
            rope = _up(x + of["fields.u"][k], of["fields.y"] + of["fields.v"][k])
            T = np.append(of["fields.T"][k], [of["fields.T_behind"][k], of["fields.T_ahead"][k]])
            yield from _series(f"rope in frame {k}", moved[:-2], rope, SINGLE, reach)
            yield from _series(f"car in frame {k}", moved[-1], _up(*car_of(of)[k : k + 1].T)[0], 1e-4, reach)
            yield from _series(f"velocity in frame {k}", frame["velocity"], speed, SINGLE)
            yield from _series(f"tension in frame {k}", frame["tension"], T, SINGLE)


def _mass(file: Path, of: dict[str, Any]) -> Faults:
    reach = float(of["fields.x"][-1] - of["fields.x"][0])
    for k, grid in _frames(file, of):
        frame = {
            name: np.array(str(item.text).split(), dtype=float)
            for name, item in _items(grid) if name in ("points", "displacement", "tension_behind", "tension_ahead")
        }  # fmt: skip
        moved = frame["points"] + frame["displacement"]
        yield from _series(f"car in frame {k}", moved, _up(*car_of(of)[k : k + 1].T)[0], 1e-4, reach)
        for name in ("tension_behind", "tension_ahead"):
            T = of[f"fields.{name.replace('tension', 'T')}"][k : k + 1]
            yield from _series(f"{name} in frame {k}", frame[name], T, SINGLE)


def _frames(file: Path, of: dict[str, Any]) -> Iterator[tuple[int, Any]]:
    """Some frames of an animation, with their numbers; all times must be those of the stored frames."""
    grids = [x for x in ElementTree.parse(file).iter("Grid") if x.get("GridType") == "Uniform"]
    times = np.array([float(x.find("Time").get("Value")) for x in grids])  # type: ignore[union-attr, arg-type]
    if not np.array_equal(times, of["fields.t"]):
        raise ValueError(f"{file}: frames at other times than were computed")
    some = np.unique(np.linspace(0, len(grids) - 1, FRAMES).round().astype(int))
    return ((int(k), grids[k]) for k in some)


def _items(grid: Any) -> Iterator[tuple[str, Any]]:
    for part in grid:
        for item in part.iter("DataItem"):
            yield (part.get("Name") or "points" if part.tag != "Topology" else "cells"), item


def _up(x: Array, y: Array) -> Array:
    return np.stack([x, -y, 0.0 * x], axis=1)


def _summary(file: Path, of: dict[str, Any]) -> Faults:
    """Numbers of summary.json that follow from the path; all others are as they are stored."""
    told = _json(file)
    rest = of["rest"]
    length = of["rest"]["length"]
    if abs(told["reached"] - of["s_o"][-1] / length) > ROUNDING:
        yield "reached is not where the path ends"
    if told["max_deflection"] not in (*of["v"], of["v"][0]):
        yield "max_deflection is no v of the path"
    same = [name for name in told.keys() & rest.keys() if name != "flags"]
    for name in same:
        if told[name] != rest[name]:
            yield f"{name} is not as stored"
    for name in told.keys() - rest.keys() - KEYS.keys() - rest["work"].keys():
        yield f"key {name} has no second computation"


# keys of summary.json that are not stored as they are, and what computes them a second time
KEYS = {
    "reached": "the path", "max_deflection": "the path", "path_scale": "max_deflection or length", "outcome": "design",
    "outcome_kind": "design", "flag_kinds": "flags", "flags": "flags",
}  # fmt: skip
FILES: dict[str, Callable[[Path, dict[str, Any]], Faults] | None] = {
    "path.csv": _path, "tension.csv": _tension, "profile.csv": _profile, "response.xdmf": _animation,
    "mass.xdmf": _mass, "summary.json": _summary,
    "response.h5": None,  # by response.xdmf
    "response.npz": None,  # the stored fields themselves
}  # fmt: skip


# --- words and numbers of page and terminal -------------------------------------------------------------------------


def _words(name: str) -> dict[str, Any]:
    package, _, file = name.rpartition("/")
    text = resources.files("validation").joinpath(*package.split("/"), file).read_text(encoding="utf-8")
    return tomllib.loads(text)


@cache
def _quantities() -> dict[str, list[str]]:
    known = _words("core/quantities.toml")
    return known["main"] | known["more"]


def _named(row: dict[str, Any]) -> str:
    kind, _, of = row["quantity"].partition(":")
    return _quantities()[kind][0].format(of)


def _valued(text: str, row: dict[str, Any]) -> bool:
    """Whether a text shows a design number with its bar; a speed in m/s and km/h."""
    value = row["value"]
    bar = row.get("bar")
    unit = row["unit"]
    if value is None:
        return text == "the car never passes"
    parts = text.split(" = ")
    units = ["m/s", "km/h"] if unit == "m/s" else [""]
    return len(parts) == len(units) and all(
        part.endswith(name) and shows(part, value, unit, bar=bar) for part, name in zip(parts, units, strict=True)
    )


def _cells_of_number(cells: Sequence[str], of: Stored) -> Faults:
    what, value, when, car, where = cells
    what = re.sub(r" \(\d+ more are larger\)$", "", what)  # after the smallest of several clearances
    row = next((x for x in of.design if _named(x) == what), None)
    if row is None:
        yield f"{what}: no such design number"
        return
    if not _valued(value, row):
        yield f"{what}: {value} where {row['value']} {row['unit']} with the bar {row.get('bar')} is stored"
    # without a value there is no place
    t, s_o, s = (row.get(name) if row["value"] is not None else None for name in ("t", "s_o", "s"))
    if not (when == "" if t is None else shows(when, t, "s", digits=4)):
        yield f"{what}: after {when} where {t} s is stored"
    for name, text, place in (("car at", car, s_o), ("at", where, s)):
        if not _fixed(text, place, "m", 1):
            yield f"{what}: {name} {text} where {place} m is stored"


def _cells_of_load(cells: Sequence[str], of: Stored) -> Faults:
    """Components of what a support carries at one instant: means over an axial round trip."""
    side, when, right, down = cells
    run = of.run(0)
    row = next(x for x in of.design if x["quantity"] == f"reaction_{cells[0]}_max")
    cable = run["scene"]["cable"]
    length = run["rest"]["length"]
    t = run["t"]
    half = length * math.sqrt((cable["mass_per_length"] + _ice(cable)) / cable["EA"])
    force = -run[f"reaction_{side}"]
    known = np.isfinite(force).all(axis=1)
    total = make_interp_spline(t[known], force[known], k=1).antiderivative()
    low, high = np.clip([row["t"] - half, row["t"] + half], t[known][0], t[known][-1])
    wanted = (total(high) - total(low)) / (high - low)
    good = [shows(text, float(x), "N", digits=4) for text, x in zip((right, down), wanted, strict=True)]
    if not all(good) or not shows(when, row["t"], "s", digits=4):
        yield f"{side} support: {right}, {down} after {when} where {wanted} N after {row['t']} s follow"


def _ice(cable: dict[str, Any]) -> float:
    """Mass of ice per length [kg/m]."""
    ice = cable.get("ice", 0.0)
    if not isinstance(ice, dict):
        return float(ice)
    return float(ice["density"] * math.pi * ice["thickness"] * (cable["diameter"] + ice["thickness"]))


def _cells_of_event(cells: Sequence[str], of: Stored) -> Faults:
    event, *texts = cells

    def alike(x: dict[str, Any]) -> bool:
        numbers = ((x["t"], x.get("bar_t"), "s", ""), (x["s_o"], x.get("bar_s_o"), "m", ""),
                   (x["speed"], x.get("bar_speed"), "m/s", " km/h"))  # fmt: skip
        return all(
            text == "" or shows(text + (name or f" {unit}"), value, unit, bar=bar)
            for text, (value, bar, unit, name) in zip(texts, numbers, strict=True)
        )

    if not any(x["event"].replace("_", " ") == event and alike(x) for x in of.events):
        yield f"{event} {', '.join(texts)}: no such event is stored"


def _cells_of_row(cells: Sequence[str], of: Stored) -> Faults:
    name, verdict, gap, allowed, asked_for, where, asked = cells
    for row in of.rows:
        said = [row["quantity"].replace("_", " "), row.get("law"), row.get("with")]
        if (
            name == _plain(": ".join(x for x in said if x))
            and verdict.lstrip("✓✗≈? ") == (row["verdict"] or "–")
            and all(shows(text, row.get(key), "%", digits=3) for key, text in
                    (("gap", gap), ("allowed", allowed), ("asked_for", asked_for)))
            and (where == "–" if row.get("where") is None else _fixed(where, row["where"], "", 3))
            and asked == ("asked" if row.get("asked", True) else "shown only")
        ):  # fmt: skip
            return
    yield f"{' | '.join(cells)}: no such comparison in agreement.json"


def _cells_of_group(cells: Sequence[str], of: Stored) -> Faults:
    group, verdict, text = cells
    known = _words("commands/check/words.toml")["groups"]
    named = {name for names in known.values() for name in names}
    rows = [
        row for row in of.rows if row.get("asked", True)
        and (row["quantity"] in known[group] if group in known else row["quantity"] not in named)
    ]  # fmt: skip
    worst = _worst(rows) or "–"
    if verdict.lstrip("✓✗≈? ") != worst:
        yield f"{group}: {verdict} where {worst} is the worst verdict"
    for name, words in COUNTED.items():
        count = sum(row["verdict"] == name for row in rows)
        if count and not re.search(rf"\b{count} {words}", text):
            yield f"{group}: {text!r} where {count} {words}"


def _cells_of_work(cells: Sequence[str], of: Stored) -> Faults:
    method, n_dof, steps, iterations, seconds, reached = cells
    i = of.methods.index(method)
    x = of.summaries[i]
    for name, text in (("n_dof", n_dof), ("steps", steps), ("newton_iterations", iterations)):
        if int(text.replace(" ", "")) != x[name]:
            yield f"{name} of {method}: {text} where {x[name]} is stored"
    if not shows(seconds, x["seconds"], digits=3):
        yield f"seconds of {method}: {seconds} where {x['seconds']} is stored"
    if not _fixed(reached, float(of.run(i)["s_o"][-1]), "m", 1):
        yield f"{method} computed up to {reached}, which is not where its path ends"


def _cells_of_setting(cells: Sequence[str], of: Stored) -> Faults:
    name, text, _ = cells
    values = [(x["settings"] | {key: x[key] for key in ("model", "load", "law")}).get(name) for x in of.summaries]
    if text not in [f"{value:g}" if isinstance(value, float) else str(value) for value in values]:
        yield f"{name} = {text} where {values} is stored"


def _cells_of_fact(cells: Sequence[str], of: Stored) -> Faults:
    """What follows from the scene, from the rope at rest."""
    name, text = cells
    run = of.run(0)
    rest = run["rest"]
    s = run["fields.s"]
    x = run["fields.x"]
    y = run["fields.y"]
    H = rest["horizontal_tension"]
    fine = np.linspace(s[0], s[-1], 20001)
    curve = CubicSpline(s, np.stack([x, y], axis=1))(fine)
    sag = float(np.max(curve[:, 1] - y[-1] * curve[:, 0] / x[-1]))
    first, _, second = text.partition(", ")
    if name == "rope between the supports":
        good = shows(first, rest["length"], "m", digits=6)
    elif name == "horizontal tension at rest":
        good = shows(first, H, "N", digits=4)
    elif name == "sag at rest":
        good = shows(first, sag, "m", digits=4) and shows(
            second.removesuffix(" of the span"), sag / float(x[-1]), "%", digits=2
        )
    elif name == "top speed over that of waves across the rope":
        rho = run["scene"]["cable"]["mass_per_length"]
        pace = np.max(np.abs(np.diff(run["s_o"]) / np.diff(run["t"])))
        # steps are short chords of the travel
        good = (
            "ice" in run["scene"]["cable"]
            or abs(_real(text.removesuffix(" %")) / 100.0 - pace * (rho / H) ** 0.5) < 0.06
        )
    else:
        of.unread.append(name)
        return
    if not good:
        yield f"{name}: {text}"


def _cells_of_input(cells: Sequence[str], of: Stored) -> Faults:
    key, text, _ = cells
    value: Any = of.run(0)["scene"]
    for name in key.split("."):
        value = value[int(name)] if isinstance(value, list) else value[name]
    if isinstance(value, int | float) and not isinstance(value, bool):
        good = abs(_real(text.split(" ")[0]) - value) <= 1e-9 * abs(value)
    else:
        good = text.startswith(str(len(value)) if isinstance(value, list) else str(value))
    if not good:
        yield f"{key}: {text} where {value} was read"


def _nothing(cells: Sequence[str], of: Stored) -> Faults:
    """A table of words alone."""
    return iter(())


def sure(text: str, of: Stored) -> Faults:
    """Counts of comparisons of two solvers, of laws, and of numbers computed twice."""
    named = LAWS | PRINTED | SHARED
    kinds = {
        "comparisons of two solvers": [row for row in of.asked if row["quantity"] not in named],
        "laws": [row for row in of.asked if row["quantity"] in LAWS],
        "printed numbers": [row for row in of.asked if row["quantity"] in PRINTED],
    }
    for kind, rows in kinds.items():
        good = sum(row["verdict"] == "agree" for row in rows)
        count = f"{good} {kind}" if good == len(rows) else f"{good} of {len(rows)} {kind}"
        if rows and not re.search(rf"(?<!of )\b{count}\b", text):
            yield f"{text!r} where {count} agree or hold"


TABLES: dict[str, Callable[[Sequence[str], Stored], Faults]] = {
    "quantity|value|when|car at|where": _cells_of_number,
    "support|when|to the right|down": _cells_of_load,
    "event|after [s]|at [m]|speed [km/h]": _cells_of_event,
    "comparison|verdict|gap|sum of both bars|asked for|largest at sₒ/l|in the verdict": _cells_of_row,
    "comparison|verdict|of those asked": _cells_of_group,
    "run|unknowns|steps|Newton iterations|time loop [s]|computed up to": _cells_of_work,
    "setting|value|meaning": _cells_of_setting,
    "shared|checked on its own by": _nothing, "follows from it|value": _cells_of_fact,
    "key|value|meaning": _cells_of_input,
}  # fmt: skip


SECTIONS = ("answer", "side-view", "ride", "tension", "scene", "how-sure", "rests")


def page(whole: str, command: str, of: Stored) -> Faults:
    """Faults of the sections of a page that show a run or a check; another command's may have the same names."""
    sections = {
        name: re.search(rf'<section id="{name}-{command}".*?</section>', whole, re.S)
        or re.search(rf'<section id="{name}".*?</section>', whole, re.S)
        for name in SECTIONS
    }
    answer = sections["answer"]
    text = "".join(x[0] for x in sections.values() if x is not None)
    if answer is None:
        yield "the page has no answer"
        return
    head = _plain("".join(re.findall(r"<h2.*?</h2>", answer[0], re.S)))
    if of.agreement and not head.endswith(f" {of.verdict}"):
        yield f"the page's verdict is {head!r}, that of the rows {of.verdict}"
    summary = _plain("".join(re.findall(r'<p class="summary">.*?</p>', answer[0], re.S)))
    if not summary.startswith(_plain(f"{of.outcome[0].upper()}{of.outcome[1:]}.")):
        yield f"{summary!r} where the outcome is {of.outcome!r}"
    if of.rows:
        yield from sure(summary, of)
    for table in re.findall(r"<table[^>]*>\s*<.*?</table>", text, re.S):  # that of the side view is empty
        head, *lines = re.findall(r"<tr>(.*?)</tr>", table, re.S)
        columns = "|".join(_plain(x) for x in re.findall(r"<th[^>]*>(.*?)</th>", head, re.S))
        reader = TABLES.get(columns)
        if reader is None:
            of.unread.append(columns)
            continue
        for line in lines:
            yield from reader([_plain(x) for x in re.findall(r"<td[^>]*>(.*?)</td>", line, re.S)], of)
    for data in re.findall(r'<script type="application/json">(.*?)</script>', text, re.S):
        yield from _side_view(json.loads(data), of)


def _side_view(view: dict[str, Any], of: Stored) -> Faults:
    run = of.run(0)
    path = path_of(run)
    scene = run["scene"]
    reach = float(np.ptp(path["x"])) or 1.0
    x, y = (np.array(z) for z in view["path"])
    off, _ = cKDTree(np.stack([path["x"], path["y"]], axis=1)).query(np.stack([x, y], axis=1))
    ends = np.hypot(x[[0, -1]] - path["x"][[0, -1]], y[[0, -1]] - path["y"][[0, -1]])
    if max(*off, *ends) > 1e-5 * reach:
        yield f"side view: the path is {max(off):.3g} m off path.csv"
    for mark in view["speeds"]:
        apart = np.hypot(path["x"] - mark["x"], path["y"] - mark["y"])
        # a car that rolls back passes a place twice
        near = np.flatnonzero(apart <= apart.min() + 0.01 * reach)
        around = 3.6 * np.stack([path["speed"][(near + i).clip(0, apart.size - 1)] for i in (-1, 0, 1)])  # (3, k)
        shown = float(mark["text"].removesuffix(" km/h"))
        if not np.any((around.min(axis=0) - 0.51 <= shown) & (shown <= around.max(axis=0) + 0.51)):
            yield f"side view: {mark['text']} where the car has {around[1].mean():.1f} km/h"
    if [view["span"], view["drop"]] != [scene["supports"]["span"], scene["supports"].get("drop", 0.0)]:
        yield "side view: span or drop is not the scene's"
    tops = [[x["name"], x["at"], x["top"]] for x in scene.get("obstacle", [])]
    if [[x["name"], x["x"], x["top"]] for x in view["obstacles"]] != tops:
        yield "side view: obstacles are not the scene's"
    if view["ground"] != scene.get("ground", []) or view["below"] != scene["mass"].get("below", 0.0):
        yield "side view: ground or the car's height is not the scene's"
    for cable in view["cables"]:
        yield from (f"side view: {fault}" for fault in _moving(cable, view, of))


def _moving(cable: dict[str, Any], view: dict[str, Any], of: Stored) -> Faults:
    """Frames of a rope against the stored ones; a frame at rest may come first."""
    run = of.run(of.methods.index(cable["name"]))
    k = run["fields.t"].size
    shown = np.abs(run["fields.s"][:, None] - np.array(view["s"])).argmin(axis=0)  # stations (m,)
    car = car_of(run)
    wanted = {"t": run["fields.t"], "s_o": run["fields.s_o"], "mass_x": car[:, 0], "mass_y": car[:, 1]}
    wanted |= {name: run[f"fields.{name}"][:, shown] for name in ("u", "v", "T")}
    for side in ("behind", "ahead"):
        other = run[f"fields.T_{'ahead' if side == 'behind' else 'behind'}"]
        wanted[side] = np.where(np.isnan(run[f"fields.T_{side}"]), other, run[f"fields.T_{side}"])
    path = path_of(run)
    unit = view["unit"]
    for told in cable["told"]:
        name, _, printed = told["name"].partition(" [")
        values, si = {"speed": (path["speed"], "m/s"), "press on the rope": (path["F_contact"], "N"),
                      "haul or thrust": (path["F_haul"], "N")}[name]  # fmt: skip
        cable[name] = told["data"]
        wanted[name] = FACTORS[si][printed.rstrip("]")] * np.interp(run["fields.t"], path["t"], values)
    if FACTORS["N"][view["unitName"]] * unit != 1.0:
        yield f"forces are in {view['unitName']} but divided by {unit}"
    for name, values in wanted.items():
        part = cable[name]
        steps = np.frombuffer(base64.b64decode(part["data"]), "<u2")
        found = part["low"] + steps / PACKED * (part["high"] - part["low"])
        step = (part["high"] - part["low"]) / PACKED
        places = 1e-4 * float(np.ptp(run["fields.x"])) if name.startswith("mass") else 0.0
        yield from _series(name, found[-values.size :], values.ravel(), 1.0, step + places + 1e-12 * abs(part["high"]))
        if found.size not in (values.size, values.size // k * (k + 1)):
            yield f"{name} has other frames than are stored"


# --- terminal -------------------------------------------------------------------------------------------------------


def terminal(lines: Sequence[str], of: Stored) -> Faults:
    """Faults of what a run or a check printed."""
    for line in lines:
        text = line.strip()
        reader = next((read for pattern, read in LINES if re.match(pattern, line)), None)
        if text and reader is not None:
            yield from reader(text, of)
        elif text:
            # the longer of two names that begin alike
            numbers = [x for x in of.design if text.startswith(f"{_named(x)} ")]
            number = max(numbers, key=lambda x: len(_named(x)), default=None)
            event = next((x for x in of.events if re.match(rf"{x['event'].replace('_', ' ')} +after ", text)), None)
            if number is None and event is None and text not in _said(of):
                of.unread.append(text)
            elif number is not None:
                yield from _line_of_number(text, number, of)
            elif event is not None:
                yield from _line_of_event(text, of)


def _said(of: Stored) -> set[str]:
    """Sentences that are printed as they are stored."""
    words = _words("commands/check/words.toml")["verdicts"]
    verdict = {words[of.verdict]} if of.agreement else set()
    flags = {flag for x in of.summaries for flag in x["flags"]}
    doubts = {f"{x['method']}: {x['words']}" for x in of.agreement.get("doubts", [])}
    return verdict | flags | doubts | {f"{of.summaries[0]['scene']}: {of.outcome}"}


def _line_of_number(text: str, row: dict[str, Any], of: Stored) -> Faults:
    rest = re.sub(r"^\(\d+ more are larger\)", "", text.removeprefix(_named(row)).strip()).strip()
    value, at, when = re.fullmatch(r"(.*?)(?:, at ([\d.-]+ m))?(?: after (\S+ s))?", rest).groups("")  # type: ignore[union-attr]
    car = f"{row['s_o']:.1f} m" if row.get("s_o") is not None and row["value"] is not None else ""
    yield from _cells_of_number([_named(row), value, when, car, at], of)


def _line_of_event(text: str, of: Stored) -> Faults:
    found = re.fullmatch(r"(.*?) +after (.*) s at (.*) m(?: with (.*) km/h)?", text)
    yield from [f"{text!r} is no event"] if found is None else _cells_of_event(found.groups(""), of)


def _line_of_slack(text: str, of: Stored) -> Faults:
    row = next((x for x in of.design if x["quantity"] == "slack_onset"), None)
    length = of.run(0)["rest"]["length"]
    found = re.match(r"slack somewhere from car at (.*) m on;", text)
    if (
        row is None
        or found is None
        or not shows(
            f"{found[1]} m", row["value"] * length, "m", bar=None if row["bar"] is None else row["bar"] * length
        )
    ):
        yield f"{text!r} is not the stored slack onset"


def _line_of_work(text: str, of: Stored) -> Faults:
    found = re.fullmatch(r"by (\S+) \((.*)\) in (\S+) s(?:; path ± (\S+) m)?", text)
    x = of.summaries[0]
    if found is None or found[1] != x["method"]:
        yield f"{text!r} is not the stored run"
        return
    known = {f"{key}={value}" for key, value in x["settings"].items()} | {x["model"], x["load"], x["law"]}
    if not set(found[2].split(", ")) <= known:
        yield f"{found[2]!r} are not the stored settings"
    bar = None if x["path_error"] is None else x["path_error"] * x["path_scale"]
    if not shows(found[3], x["seconds"], digits=2) or not (
        found[4] is None if bar is None else shows(found[4] or "", bar, digits=2)
    ):
        yield f"{text!r}: {x['seconds']} s and {bar} m are stored"


def _line_of_row(text: str, of: Stored) -> Faults:
    """A comparison: name, gap, bars, asked, where, verdict."""
    cells = re.match(r"(.*?)  +(\S+)  +(\S+)  +(\S+)  +(\S+)  +(\S.*)", text)
    for row in of.rows if cells else ():
        said = " ".join(row[key] for key in ("quantity", "law", "with") if row.get(key))
        numbers = zip(cells.groups()[1:4], ("gap", "allowed", "asked_for"), strict=True)  # type: ignore[union-attr]
        if (cells[1], cells[6]) == (said, row["verdict"] or "shown") and all(  # type: ignore[index]
            shows(cell, row.get(key), digits=2) for cell, key in numbers
        ):
            return
    yield f"{text!r} is no comparison in agreement.json"


def _line_of_party(text: str, of: Stored) -> Faults:
    for party in {row["with"] for row in of.rows if row.get("with")}:
        worst = _worst([row for row in of.rows if row.get("with") == party]) or "not comparable"
        if text.startswith(f"{party}: {_words('commands/check/words.toml')['third'][worst]}"):
            return
    yield f"{text!r} is no verdict on a third party"


def _silent(text: str, of: Stored) -> Faults:
    return iter(())


LINES: tuple[tuple[str, Callable[[str, Stored], Faults]], ...] = (
    (r"  slack somewhere from car at ", _line_of_slack),
    (r"  by the quasi-static model", _silent),
    (r"  by \S+ \(", _line_of_work),
    (r"  \d+ (of \d+ )?(comparisons|laws|printed)", sure),
    (r"  Nothing could be compared", _silent),
    (r"  written to ", _silent),
    (r"  \S.*: (agrees|DISAGREES|is too coarse|cannot be compared)", _line_of_party),
    (r"quantity +gap", _silent),
    (r"\S.*(  +(-|\d\S*)){4}  (agree|disagree|too coarse|not comparable|shown)$", _line_of_row),
)  # fmt: skip
