"""Laws of a line at rest, and a second computation of its printed numbers, from TOML, states and files alone.

Of a piece of unstretched length S with the force (H, P) at its left end, P1 = P - q S, a = 1 + a_T dT:

    x = a [H S/EA + (H/q) (asinh(P/H) - asinh(P1/H))],   y = a [(P S - q S^2/2)/EA + (N - N1)/q]

(Irvine, Cable Structures, 1981).  Defects are over the reach of the line or over its largest tension.
"""

from __future__ import annotations

import csv
import html
import itertools
import json
import math
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cablefem.response import Array
from validation.core.agreement import Agreement, Bound, Part
from validation.core.evidence import ROUNDING

DOWN = np.array([0.0, 1.0])
GROUND = "the ground"
UNITS = {"N": 1.0, "kN": 1e3, "MN": 1e6, "GN": 1e9, "m": 1.0, "mm": 1e-3, "°": 1.0, "": 1.0}
LENGTHS = ("x", "depth", "rope_over", "rise", "shift", "sag", "clearance_rope", "clearance_car")
Numbers = dict[str, Any]  # by name: a value, a word or None


@dataclass(frozen=True, slots=True)
class Station:
    """A contact or a car on the rope, as the TOML has it."""

    name: str
    kind: str  # of a contact; or "grips", "hauled"
    x: float
    y: float  # nan of a car
    data: Mapping[str, Any]
    weight: float = 0.0  # [N] of a car


class LineData:
    """A line's numbers from its TOML, SI."""

    def __init__(self, toml: str) -> None:
        data = tomllib.loads(toml)
        cable = data["cable"]
        self.gravity: float = data.get("gravity", 9.81)
        self.contacts: list[dict[str, Any]] = data["contact"]
        self.cars: list[dict[str, Any]] = data.get("car", [])
        self.obstacles: list[dict[str, Any]] = data.get("obstacle", [])
        self.ground = np.array(data.get("ground", []), float).reshape(-1, 2)
        self.EA: float = cable["EA"]
        self.length: float | None = cable.get("length")
        self.tie: dict[str, Any] | None = cable.get("tension")
        self.breaking_load: float | None = cable.get("breaking_load")
        ice = cable.get("ice", 0.0)
        if isinstance(ice, dict):
            outer = 0.5 * cable["diameter"] + ice["thickness"]
            ice = ice["density"] * math.pi * (outer**2 - (0.5 * cable["diameter"]) ** 2)
        self.q_empty = cable["mass_per_length"] * self.gravity
        self.q = (cable["mass_per_length"] + ice) * self.gravity
        warmer = cable["temperature"] - cable["reference_temperature"] if "temperature" in cable else 0.0
        self.heat = 1.0 + cable.get("expansion", 0.0) * warmer

    def x(self, car: dict[str, Any], i: int) -> float:
        at = car["at"] if isinstance(car["at"], list) else [car["at"]]
        return float(at[i] if len(at) > 1 else at[0])

    def saddle(self, car: dict[str, Any], i: int) -> dict[str, Any] | None:
        """The saddle on whose shoe a car rests at position i."""
        x = self.x(car, i)
        return next((c for c in self.contacts if "shoe" in c and abs(x - c["at"][0]) <= c["shoe"]), None)

    def stations(self, i: int | None, on_rope: Mapping[str, float] | None = None) -> list[Station]:
        """Stations at position i, None of the empty line; on_rope : x of cars that a shoe does not carry."""
        there = [Station(c["name"], c["kind"], c["at"][0], c["at"][1], c) for c in self.contacts]
        for car in self.cars if i is not None else ():
            x = (on_rope or {}).get(car["name"])
            if x is None and self.saddle(car, i or 0) is None:
                x = self.x(car, i or 0)
            if x is not None:
                kind = "hauled" if car["hauled"] else "grips"
                there.append(Station(car["name"], kind, x, math.nan, car, car["mass"] * self.gravity))
        return sorted(there, key=lambda p: p.x)


class Rope:
    """A state of rest with n stations: s (n,) [m], points (n, 2) [m], forces behind and ahead (n, 2) [N]."""

    def __init__(self, data: LineData, state: Any, stations: list[Station], empty: bool = False) -> None:
        self.stations = stations
        self.EA = data.EA
        self.q = data.q_empty if empty else data.q
        self.heat = 1.0 if empty else data.heat
        self.s, self.points, self.behind, self.ahead, self.haul = (
            np.asarray(getattr(state, name)) for name in ("s", "place", "behind", "ahead", "haul")
        )
        self.reach = float(np.ptp([p.x for p in stations]))
        tensions = np.concatenate([np.linalg.norm(self.ahead[:-1], axis=1), np.linalg.norm(self.behind[1:], axis=1)])
        self.tension_max = float(tensions.max())

    def index(self, name: str) -> int:
        return [p.name for p in self.stations].index(name)

    def along(self, s: Array) -> tuple[Array, Array, Array]:
        """x, y [m] and tension [N] at s (m,) [m]."""
        k = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, self.s.size - 2)
        S = s - self.s[k]
        H, P = self.ahead[k].T
        P1 = P - self.q * S
        N = np.hypot(H, P)
        N1 = np.hypot(H, P1)
        x = self.heat * (H * S / self.EA + H / self.q * (np.arcsinh(P / H) - np.arcsinh(P1 / H)))
        y = self.heat * ((P * S - 0.5 * self.q * S**2) / self.EA + (N - N1) / self.q)
        return self.points[k, 0] + x, self.points[k, 1] + y, N1

    def at(self, x: Array) -> tuple[Array, Array]:
        """Depth [m] and tension [N] at x (m,) [m], by bisection and three steps of Newton's method."""
        k = np.clip(np.searchsorted(self.points[:, 0], x, side="right") - 1, 0, self.s.size - 2)
        low = self.s[k]
        high = self.s[k + 1]
        for _ in range(12):
            middle = 0.5 * (low + high)
            short = self.along(middle)[0] < x
            low = np.where(short, middle, low)
            high = np.where(short, high, middle)
        s = 0.5 * (low + high)
        for _ in range(3):
            x_s, _, N = self.along(s)
            s = s - (x_s - x) / (self.heat * self.ahead[k, 0] * (1.0 / N + 1.0 / self.EA))
        _, y, N = self.along(s)
        return y, N

    def smallest(self, height: Callable[[Array, Array], Array], first: int = 0, last: int | None = None) -> float:
        """Smallest height(x, y) between two stations, by samples ever closer to the smallest one."""
        pieces = itertools.pairwise(self.s[first : None if last is None else last + 1])
        s = np.unique(np.concatenate([np.linspace(a, b, 65) for a, b in pieces]))
        for _ in range(4):
            heights = height(*self.along(s)[:2])
            k = int(np.argmin(heights))
            s = np.append(np.linspace(s[max(k - 1, 0)], s[min(k + 1, s.size - 1)], 65), s[k])  # s[k] may be a kink
            s.sort()
        return float(np.min(heights))

    def tension_min(self) -> float:
        """Distance of the origin from the straight lines that N t follows along the pieces."""
        # (n - 1, 2)
        start = self.ahead[:-1]
        end = self.behind[1:]
        change = end - start
        part = np.clip(-np.sum(start * change, axis=1) / np.sum(change**2, axis=1), 0.0, 1.0)
        return float(np.linalg.norm(start + part[:, None] * change, axis=1).min())


def _ropes(data: LineData, rest: Any) -> Iterator[tuple[str, Rope]]:
    """All states of a line, with what to call them."""
    yield "empty", Rope(data, rest.empty, data.stations(None), empty=True)
    for i, state in rest.states.items():
        yield f"position {i + 1}", Rope(data, state, data.stations(i))
    for (i, name), ends in rest.shoe_ends.items():
        for side, state in zip((-1.0, 1.0), ends, strict=True):
            yield f"position {i + 1}, {name} at an end of the shoe", _at_shoe_end(data, i, name, side, state)


def _at_shoe_end(data: LineData, i: int, name: str, side: float, state: Any) -> Rope:
    saddle = data.saddle(next(car for car in data.cars if car["name"] == name), i)
    assert saddle is not None
    return Rope(data, state, data.stations(i, {name: saddle["at"][0] + side * saddle["shoe"]}))


def laws(toml: str, rest: Any) -> Iterator[Agreement]:
    """Laws of statics on all states of a line; of each law the worst state.

    rest : `empty` and, by position, `states`; by position and car on a shoe, `shoe_ends`.
    """
    data = LineData(toml)
    worst: dict[str, tuple[float, str]] = {}
    for where, rope in _ropes(data, rest):
        for law, defect in _defects(data, rope, rest.empty, where == "empty"):
            largest = float(np.max(np.abs(defect), initial=0.0))
            largest = largest if math.isfinite(largest) else math.inf
            worst[law] = max(worst.get(law, (0.0, where)), (largest, where), key=lambda x: x[0])
    for law, (gap, where) in worst.items():
        yield Agreement(
            "laws_si", gap, Bound("law", (Part("catenaries", ROUNDING, "rounding"),)), where, law=law, unit="-"
        )


def _defects(data: LineData, rope: Rope, empty: Any, is_empty: bool) -> Iterator[tuple[str, Any]]:
    """Defects of the laws on one state."""
    S = np.diff(rope.s)
    T = rope.tension_max
    yield "weight of each piece", (rope.behind[1:] - rope.ahead[:-1] + rope.q * S[:, None] * DOWN) / T
    end = np.stack(rope.along(np.nextafter(rope.s[1:], -math.inf))[:2], axis=1)  # (n - 1, 2)
    yield "shape and stretch", (end - rope.points[1:]) / rope.reach
    if not any(c["kind"] == "counterweight" for c in data.contacts):
        length = float(np.ptp(empty.s)) if data.length is None else data.length
        yield "unstretched length", (np.ptp(rope.s) - length) / length
    if is_empty and data.tie is not None:
        k = rope.index(data.tie["at"])
        tension = np.linalg.norm(rope.ahead[k] if k < rope.s.size - 1 else rope.behind[k])
        yield "tension of the empty line", (tension - data.tie["value"]) / T
    total = rope.behind[-1] - rope.ahead[0] + rope.q * np.ptp(rope.s) * DOWN
    for k, p in enumerate(rope.stations):
        inner = 0 < k < rope.s.size - 1
        force = rope.ahead[k] - rope.behind[k] if inner else np.zeros(2)  # of the rope on the station
        N = np.linalg.norm([rope.behind[k], rope.ahead[k]], axis=1)
        if p.kind == "spring":
            of_rope = rope.ahead[k] if k == 0 else -rope.behind[k]
            of_spring = np.array(p.data["stiffness"]) * (rope.points[k] - [p.x, p.y])
            yield "force of springs", (of_rope - of_spring) / T
        elif p.weight:
            tau = (rope.ahead[k] + rope.behind[k]) / np.linalg.norm(rope.ahead[k] + rope.behind[k])
            F = rope.haul[k] if p.kind == "hauled" else 0.0
            yield "balance of cars", (force + p.weight * DOWN + F * tau) / T
            yield "points of contacts and cars", (rope.points[k, 0] - p.x) / rope.reach
            total = total + p.weight * DOWN + F * tau
        else:
            yield "points of contacts and cars", (rope.points[k] - [p.x, p.y]) / rope.reach
            total = total - force
        if p.kind == "counterweight":
            yield "tension at the counterweight", (np.nanmax(N) - p.data["tension"]) / T
        if p.kind in ("saddle", "hauled"):
            yield "tension past saddles and hauled cars", (N[1] - N[0]) / T
        if p.kind == "saddle":
            yield "saddles press down", min(force[1], 0.0) / T
    yield "rope, loads and reactions", total / T


def numbers(toml: str, rest: Any) -> list[Numbers | None]:
    """The numbers of each position, named as in positions.csv; None without rest."""
    data = LineData(toml)
    return [_position(data, rest, i) if i in rest.states else None for i in range(len(rest.positions))]


def _position(data: LineData, rest: Any, i: int) -> Numbers:
    rope = Rope(data, rest.states[i], data.stations(i))
    out: Numbers = {"position": i + 1}
    for car in data.cars:
        name = car["name"]
        saddle = data.saddle(car, i)
        forces: dict[str, float | None] = dict.fromkeys(("tension_behind", "tension_ahead"))
        if car["hauled"]:
            forces["haul"] = None
        if saddle is None:
            k = rope.index(name)
            depth = float(rope.points[k, 1])
            N = np.linalg.norm([rope.behind[k], rope.ahead[k]], axis=1)
            values = {"tension_behind": N[0], "tension_ahead": N[1], "haul": rope.haul[k]}
            forces = {key: float(values[key]) for key in forces}
        else:
            depth = _on_shoe(data, rest, i, car, saddle)
        out |= {f"x:{name}": data.x(car, i), f"depth:{name}": depth, f"on:{name}": saddle and saddle["name"]}
        out |= {f"{key}:{name}": value for key, value in forces.items()}
        if data.ground.size and data.ground[0, 0] <= data.x(car, i) <= data.ground[-1, 0]:
            height = float(np.interp(data.x(car, i), *data.ground.T)) - depth - car.get("below", 0.0)
            out[f"clearance_car:{name} over {GROUND}"] = height
    for j, c in enumerate(data.contacts):
        out |= _at_contact(data, rest, rope, i, j, c)
    for a, b in itertools.pairwise(data.contacts):
        out[f"sag:{a['name']} to {b['name']}"] = _sag(rope, rope.index(a["name"]), rope.index(b["name"]))
    out["tension_max"] = rope.tension_max
    out["tension_min"] = rope.tension_min()
    if data.breaking_load is not None:
        out["safety_factor"] = data.breaking_load / rope.tension_max
    for o in data.obstacles:
        out[f"clearance_rope:{o['name']}"] = o["top"] - float(rope.at(np.array([o["at"]]))[0][0])
    if (height := _over_ground(data, rope)) is not None:
        out["clearance_rope:ground"] = height
    return out


def _on_shoe(data: LineData, rest: Any, i: int, car: dict[str, Any], saddle: dict[str, Any]) -> float:
    """Depth of a car on a shoe: cubics from the ends, on the car's path, to the saddle.

    A cubic leaves the end along its chord, and passes the saddle with the mean slope of both chords.
    """
    name = car["name"]
    x = data.x(car, i)
    ropes = [_at_shoe_end(data, i, name, e, x) for e, x in zip((-1.0, 1.0), rest.shoe_ends[i, name], strict=True)]
    left, right = (rope.points[rope.index(name)] for rope in ropes)
    top = np.array(saddle["at"])
    slopes = [float((top - left)[1] / (top - left)[0]), float((right - top)[1] / (right - top)[0])]
    end, slope = (left, slopes[0]) if x <= top[0] else (right, slopes[1])
    d = float(top[0] - end[0])
    w = (x - float(end[0])) / d  # 0 at the end, 1 at the saddle
    bent = 0.5 * (sum(slopes) - 2.0 * slope) * d * (w**3 - w**2)
    return float(end[1] + slope * d * w + bent)


def _at_contact(data: LineData, rest: Any, rope: Rope, i: int, j: int, c: dict[str, Any]) -> Numbers:
    name = c["name"]
    k = rope.index(c["name"])
    sides = [rope.behind[k], rope.ahead[k]]
    out: Numbers = {f"tension:{name}": float(np.nanmax(np.linalg.norm(sides, axis=1)))}
    if c["kind"] == "saddle":
        across, down = rope.ahead[k] - rope.behind[k]
        carried = sum(car["mass"] for car in data.cars if data.saddle(car, i) is c) * data.gravity
        for word, weight in (("pressure", 0.0), ("load", carried)):
            out[f"{word}:{name}"] = math.hypot(across, down + weight)
            out[f"{word}_down:{name}"] = float(down + weight)
        out[f"direction:{name}"] = 90.0 - math.degrees(math.atan2(down, across))
        out[f"rope_over:{name}"] = float(rest.empty.s[j] - rope.s[k])
    elif c["kind"] == "counterweight":
        taken = float(np.ptp(rope.s) - np.ptp(rest.empty.s))
        out[f"rise:{name}"] = data.heat * taken * (1.0 + c["tension"] / data.EA)
    elif c["kind"] == "spring":
        out[f"shift:{name}"] = float(np.linalg.norm(rope.points[k] - c["at"]))
    return out


def _sag(rope: Rope, first: int, last: int) -> float:
    chord = rope.points[[first, last]].T

    def above_chord(x: Array, y: Array) -> Array:
        return np.interp(x, *chord) - y

    return -rope.smallest(above_chord, first, last)


def _over_ground(data: LineData, rope: Rope) -> float | None:
    """Smallest height of the rope over the ground; None where there is no ground below it."""
    if not data.ground.size:
        return None
    x, depth = data.ground.T
    low = max(x[0], rope.points[0, 0])
    high = min(x[-1], rope.points[-1, 0])
    if low > high:
        return None

    def height(x_rope: Array, y: Array) -> Array:
        free = np.interp(x_rope, x, depth) - y
        return np.where((x_rope >= low) & (x_rope <= high), free, math.inf)

    corners = np.concatenate([x[(x >= low) & (x <= high)], [low, high]])
    at_corners = np.interp(corners, x, depth) - rope.at(corners)[0]
    return min(rope.smallest(height), float(at_corners.min()))


def extremes(toml: str, rows: Sequence[Numbers | None]) -> dict[str, tuple[float, float]]:
    """Smallest and largest value of each number over all positions; of cars also where they pass between two."""
    data = LineData(toml)
    values: dict[str, list[float]] = {}
    for name, value in ((name, value) for row in rows if row for name, value in row.items()):
        if isinstance(value, float) and not name.startswith("x:"):
            values.setdefault(name, []).append(value)
    tops = {o["name"]: np.array([[o["at"], o["top"]]]) for o in data.obstacles} | {GROUND: data.ground}
    for car, (name, points) in itertools.product(data.cars, tops.items()):
        track = [(r[f"x:{car['name']}"], r[f"depth:{car['name']}"]) for r in rows if r]
        for one, two in itertools.pairwise([*track, track[-1]]):
            (x0, y0), (x1, y1) = sorted([one, two])
            for x, top in points[(points[:, 0] >= x0) & (points[:, 0] <= x1)]:
                depth = float(np.interp(x, [x0, x1], [y0, y1]))
                key = f"clearance_car:{car['name']} over {name}"
                values.setdefault(key, []).append(float(top) - depth - car.get("below", 0.0))
    return {name: (min(x), max(x)) for name, x in values.items()}


class _Gaps:
    """Largest gap between printed and recomputed values, over what is allowed, by file and kind of number."""

    def __init__(self) -> None:
        self.worst: dict[str, tuple[float, str]] = {}

    def note(self, law: str, where: str, printed: Any, right: Any, allowed: float = 0.0) -> None:
        """Compare two numbers within `allowed`, or two words."""
        gap = 0.0 if printed == right else math.inf
        if isinstance(printed, float) and isinstance(right, float) and allowed > 0.0:
            gap = abs(printed - right) / allowed
        gap = gap if math.isfinite(gap) else math.inf
        self.worst[law] = max(self.worst.get(law, (0.0, where)), (gap, where), key=lambda x: x[0])

    def rows(self) -> Iterator[Agreement]:
        for law, (gap, where) in self.worst.items():
            known = min(gap, 1e300)  # what is not there at all is no unknown
            yield Agreement(
                "printed", known, Bound("law", (Part("catenaries", 1.0, "allowed"),)), where, law=law, unit="-"
            )


def printed(toml: str, rest: Any, folder: Path, page: str, words: Mapping[str, Mapping[str, str]]) -> list[Agreement]:
    """Check all that is printed of a line: its files in `folder`, and its page.

    A gap counts in parts of what is allowed: rounding, of a design number its bar, of the page half its last digit.
    words : how the page calls each kind of number.
    """
    data = LineData(toml)
    gaps = _Gaps()
    rows = numbers(toml, rest)
    reach = data.contacts[-1]["at"][0]
    tension = max(row["tension_max"] for row in rows if row)
    pressures = [row[name] for row in rows if row for name in row if name.startswith("pressure:")]

    def rounding(name: str) -> float:
        kind = re.sub("_(min|max)$", "", name.partition(":")[0])
        scales = {"safety_factor": 1.0, "direction": math.degrees(tension / max(min(pressures, default=1.0), 1.0))}
        return ROUNDING * float(reach if kind in LENGTHS else scales.get(kind, tension))

    _positions(gaps, rows, _table(folder / "positions.csv"), rounding)
    _profile(gaps, data, rest, folder)
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    refused = [i + 1 for i in range(len(rows)) if rows[i] is None]
    gaps.note("summary.json", "refused", [x["position"] for x in summary["refused"]], refused)
    gaps.note("summary.json", "positions", summary["positions"], len(rows))
    length = float(np.ptp(rest.empty.s))
    gaps.note("summary.json", "empty_length", summary["empty_length"], length, ROUNDING * length)
    known = extremes(toml, rows)
    _design(gaps, data, rows, summary["design"], known, rounding)
    _outcome(gaps, data, summary, known, len(refused))
    _page(gaps, page, summary, words)
    return list(gaps.rows())


def _table(file: Path) -> list[dict[str, str]]:
    with file.open(encoding="utf-8", newline="") as opened:
        return list(csv.DictReader(opened))


def _number(cell: str | None) -> float | None:
    try:
        return float(cell or "")
    except ValueError:
        return None


def _positions(
    gaps: _Gaps, rows: Sequence[Numbers | None], table: list[dict[str, str]], rounding: Callable[[str], float]
) -> None:
    gaps.note("positions.csv", "rows", len(table), len(rows))
    for i, (line, row) in enumerate(zip(table, rows, strict=False)):
        right = row or {"position": i + 1}
        for name in {**line, **right}:
            kind, _, of = name.partition(":")
            where = f"{of or 'the line'}, position {i + 1}"
            wanted = right.get(name)
            cell = line.get(name)
            if isinstance(wanted, float):
                gaps.note(f"positions.csv, {kind}", where, _number(cell), wanted, rounding(name))
            else:
                gaps.note(f"positions.csv, {kind}", where, cell or "", "" if wanted is None else str(wanted))


def _profile(gaps: _Gaps, data: LineData, rest: Any, folder: Path) -> None:
    table = _table(folder / "profile.csv")
    drawn = json.loads((folder / "ropes.json").read_text(encoding="utf-8"))
    x = np.array([float(line["x"]) for line in table])
    ropes = {i: Rope(data, state, data.stations(i)) for i, state in rest.states.items()}
    curves = {i: rope.at(x) for i, rope in ropes.items()}
    y, T = (np.array([curve[part] for curve in curves.values()]) for part in (0, 1))  # (positions, m)
    empty = Rope(data, rest.empty, data.stations(None), empty=True).at(x)[0]
    columns = {
        "x": x, "y_rest": empty, "y_highest": y.min(axis=0), "y_lowest": y.max(axis=0),
        "tension_max": T.max(axis=0), "tension_min": T.min(axis=0),
    }  # fmt: skip
    for name, right in columns.items():
        allowed = ROUNDING * float(T.max() if "tension" in name else np.ptp(x))
        for k, value in enumerate(right.tolist()):
            where = f"x = {x[k]:.6g} m"
            gaps.note(f"profile.csv, {name}", where, _number(table[k].get(name)), value, allowed)
            gaps.note("ropes.json", where, drawn["profile"][name][k], value, allowed)
    for position, depths in drawn["depths"].items():
        for k, value in enumerate(curves[int(position) - 1][0].tolist()):
            gaps.note("ropes.json", f"position {position}", depths[k], value, ROUNDING * float(np.ptp(x)))


def _design(
    gaps: _Gaps, data: LineData, rows: Sequence[Numbers | None], design: Sequence[dict[str, Any]],
    known: Mapping[str, tuple[float, float]], rounding: Callable[[str], float],
) -> None:  # fmt: skip
    printed: set[str] = set()
    for d in design:
        kind, _, of = d["quantity"].partition(":")
        side = kind.endswith("_max")
        name = kind if kind in known and not of else re.sub("_(min|max)$", "", kind) + (f":{of}" if of else "")
        printed.add(name)
        allowed = rounding(name) + (d["bar"] or 0.0)
        right = known[name][side] if name in known else None
        gaps.note("design", d["quantity"], d["value"], right, allowed)
        at = {car["name"]: data.x(car, d["position"] - 1) for car in data.cars}
        gaps.note("design, positions of cars", d["quantity"], d["at"], at)
        row = rows[d["position"] - 1] or {}
        if name in row and not name.startswith("clearance_car"):
            gaps.note("design, value there", d["quantity"], d["value"], row[name], allowed)
    for name in known:
        gaps.note("design", name, name in printed, True)


def _outcome(
    gaps: _Gaps, data: LineData, summary: dict[str, Any], known: Mapping[str, tuple[float, float]], refused: int
) -> None:
    """The outcome names a rope beyond its breaking load first, then everything that is hit."""
    text = summary["outcome"]
    hit = {
        name.partition(":")[2].split(" over ")[-1] for name, (low, _) in known.items() if "clear" in name and low < 0
    }
    broken = data.breaking_load is not None and known["tension_max"][1] > data.breaking_load
    kind = "breaks" if broken else "collides" if hit else "incomplete" if refused else "carries"
    gaps.note("outcome", "kind", summary["outcome_kind"], kind)
    gaps.note("outcome", "breaking load", "breaking load" in text.split(";")[0], broken)
    for name in hit:
        gaps.note("outcome", name, f"{name.removeprefix('the ')} by " in text or "more" in text, True)
    kilonewton = re.search(r"(\d+\.\d) kN", text)
    if kilonewton:
        gaps.note("outcome", "tension", float(kilonewton[1]), known["tension_max"][1] / 1e3, 0.06)
    depth = max((-low for name, (low, _) in known.items() if "clear" in name), default=0.0)
    if hit:
        by = [float(x) for x in re.findall(r" by (\d+\.\d\d) m", text)]
        gaps.note("outcome", "depth of a collision", max(by, default=math.inf), depth, 0.006)


def _page(gaps: _Gaps, page: str, summary: dict[str, Any], words: Mapping[str, Mapping[str, str]]) -> None:
    """Every design number stands in the page's table, with its unit, to half its last digit, with the cars then."""
    text = html.unescape(page).replace("\u202f", " ").replace("−", "-")
    gaps.note("page", "outcome", summary["outcome"] in text, True)
    cells = re.findall(r'data-label="(quantity|largest|smallest)[^"]*"><div>(.*?)</div>', text, re.DOTALL)
    table: dict[str, dict[str, str]] = {}
    quantity = ""
    for label, cell in cells:
        quantity = cell if label == "quantity" else quantity
        table.setdefault(quantity, {})[label] = cell
    for d in summary["design"]:
        kind, _, of = d["quantity"].partition(":")
        column = "smallest" if kind.endswith("_min") else "largest"
        bare = kind if kind in words and not of else re.sub("_(min|max)$", "", kind)
        row = table.get(words[bare]["words"].format(of), {})
        cell = row.get("largest" if row.get("smallest") == "the same" else column, "")
        parts = re.fullmatch(r"(-?\d+\.(\d+)) ?([a-zA-Z°]*)(?: \((.*)\))?", cell)
        where = d["quantity"]
        if parts is None:
            gaps.note("page", where, cell, "a number")
            continue
        factor = UNITS.get(parts[3], math.nan)
        gaps.note("page", where, float(parts[1]) * factor, d["value"], 0.51 * factor * 10.0 ** -len(parts[2]))
        cars = ", ".join(f"{name} {x:.0f}" for name, x in d["at"].items())
        gaps.note("page, cars", where, parts[4] or cars, cars)
