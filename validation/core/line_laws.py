"""Laws of a line at rest, and a second computation of its printed numbers, from TOML, states and files alone.

Of a piece of unstretched length S with the force (H, P) at its left end, P1 = P - q S, a = 1 + a_T dT:

    x = a [H S/EA + (H/q) (asinh(P/H) - asinh(P1/H))],   y = a [(P S - q S^2/2)/EA + (N - N1)/q]

(Irvine, Cable Structures, 1981).  Defects are over the reach of the line or over its largest tension.
"""

import itertools
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cablefem.response import Array
from validation.core.agreement import Agreement, Bound, BoundPart
from validation.core.readback import limit_faults, limit_table_faults
from validation.core.readback.texts import plain_text, rows_of_each_table
from validation.core.scene_data import (
    DOWN,
    ROUNDING,
    HangingRope,
    LineData,
    conversion_factor_or_nan,
    obstacle_and_ground_profiles,
)
from validation.core.stored_files import DamagedFileError, read_csv_columns, read_csv_rows, read_json

LOWEST = -1e-6  # [m] least clearance of what touches
ANGLES = ("knee", "knee_empty", "direction")
MOST_CARS_NAMED = 4  # beside a number on the page
LENGTHS = ("x", "depth", "rope_over", "rise", "shift", "sag", "clearance_rope", "clearance_car")
PositionNumbers = dict[str, Any]  # by name: a value, a word or None


class Station(NamedTuple):
    """A contact or a car on the rope, as the TOML has it."""

    name: str
    kind: str  # of a contact; or "grips", "hauled"
    x: float
    y: float  # nan of a car
    data: Mapping[str, Any]
    weight: float = 0.0  # [N] of a car


# a state of rest as a solver gives it, with n stations: s (n,) [m] and points (n, 2) [m], the forces behind and ahead
# (n, 2) [N] and haul (n,) [N], nan where there is none
StateAtRest = Any
# `empty`, the state of a line without cars, `positions`, `states` by position from 0, and `shoe_ends`: two states by
# position and car on a shoe
StatesAtRest = Any


class LineAtRest(LineData):
    """A line and its cars at rest, by its TOML; positions of all cars together are counted from 0."""

    def __init__(self, toml: str) -> None:
        super().__init__(toml)
        data = self.data
        cable = data["cable"]
        self.cars: list[dict[str, Any]] = data.get("car", [])
        self.profiles = obstacle_and_ground_profiles(data)
        self.breaking_load: float | None = cable.get("breaking_load")
        self.q_empty = self.empty_mass_per_length * self.gravity
        self.q = self.mass_per_length * self.gravity

    def x_of_car(self, car: dict[str, Any], position: int) -> float:
        """x [m] of a car, which may have one for all positions."""
        at = np.atleast_1d(car["at"])
        return float(at[position if at.size > 1 else 0])

    def saddle_under_car(self, car: dict[str, Any], position: int) -> dict[str, Any] | None:
        """The saddle on whose shoe a car rests at a position; None of a car on the rope."""
        x = self.x_of_car(car, position)
        for contact in self.contacts:
            if abs(x - contact["at"][0]) <= contact.get("shoe", -1.0):
                return contact
        return None

    def contact_stations(self) -> list[Station]:
        """Stations of the empty line, in order of x."""
        stations = []
        for contact in self.contacts:
            x, y = contact["at"]
            stations.append(Station(contact["name"], contact["kind"], x, y, contact))
        return sorted(stations, key=lambda station: station.x)

    def stations_at_position(self, i: int, cars_on_rope_at_x: Mapping[str, float] | None = None) -> list[Station]:
        """Stations with the cars at position i; cars_on_rope_at_x : of cars that a shoe does not carry."""
        on_rope = cars_on_rope_at_x or {}
        stations = self.contact_stations()
        for car in self.cars:
            if car["name"] in on_rope:
                stations.append(self._station_of_car(car, on_rope[car["name"]]))
            elif self.saddle_under_car(car, i) is None:
                stations.append(self._station_of_car(car, self.x_of_car(car, i)))
        return sorted(stations, key=lambda station: station.x)

    def _station_of_car(self, car: dict[str, Any], x: float) -> Station:
        kind = "hauled" if car["hauled"] else "grips"
        return Station(car["name"], kind, x, math.nan, car, car["mass"] * self.gravity)


class RopeAtRest:
    """A state of rest with n stations, and catenaries between them."""

    def __init__(self, data: LineAtRest, state: StateAtRest, stations: list[Station], empty: bool = False) -> None:
        self.stations = stations
        self.EA = data.EA
        self.q = data.q_empty if empty else data.q
        self.heat = 1.0 if empty else data.heat
        self.s = state.s
        self.points = state.points
        self.behind = state.behind
        self.ahead = state.ahead
        self.haul = state.haul
        self.reach = float(np.ptp([station.x for station in stations]))
        self.tensions = np.linalg.norm([self.behind, self.ahead], axis=2)  # (2, n), nan outside
        self.tension_max = float(np.nanmax(self.tensions))

    def station_index(self, name: str) -> int:
        return [station.name for station in self.stations].index(name)

    def points_and_tension_at_s(self, s: Array) -> tuple[Array, Array, Array]:
        """x, y [m] and tension [N] at s (m,) [m]."""
        k = np.searchsorted(self.s[1:-1], s, side="right")  # pieces of these points
        H, P = self.ahead[k].T
        rope = HangingRope.at_lengths(s - self.s[k], H, P, self.q, self.EA)
        return self.points[k, 0] + self.heat * rope.x, self.points[k, 1] + self.heat * rope.y, rope.tension

    def depth_and_tension_at_x(self, x: Array) -> tuple[Array, Array]:
        """Depth [m] and tension [N] at x (m,) [m], by bisection and three steps of Newton's method."""
        k = np.searchsorted(self.points[1:-1, 0], x, side="right")  # pieces over x
        low = self.s[k]
        high = self.s[k + 1]
        for _ in range(12):
            middle = 0.5 * (low + high)
            short = self.points_and_tension_at_s(middle)[0] < x
            low = np.where(short, middle, low)
            high = np.where(short, high, middle)
        s = 0.5 * (low + high)
        for _ in range(3):
            x_s, _, N = self.points_and_tension_at_s(s)
            dx_ds = self.heat * self.ahead[k, 0] * (1.0 / N + 1.0 / self.EA)
            s = s - (x_s - x) / dx_ds
        _, y, N = self.points_and_tension_at_s(s)
        return y, N

    def points_closest_to_slope(self, slope: float) -> Array:
        """Points x, y (n - 1, 2) where each piece has a slope dy/dx, or where it comes closest to that."""
        H, P = self.ahead[:-1].T
        from_begin = np.clip((P - slope * H) / self.q, 0.0, np.diff(self.s))
        s = np.minimum(self.s[:-1] + from_begin, self.ends_of_pieces)
        x, y, _ = self.points_and_tension_at_s(s)
        return np.column_stack([x, y])

    @property
    def ends_of_pieces(self) -> Array:
        """s (n - 1,) just before the ends of pieces, where the next one does not begin."""
        return np.nextafter(self.s[1:], -math.inf)

    @property
    def tension_min(self) -> float:
        """Smallest tension [N]: distance of the origin from the lines that the force follows along the pieces."""
        start = self.ahead[:-1]  # (n - 1, 2)
        change = self.behind[1:] - start
        share = -np.sum(start * change, axis=1) / np.sum(change**2, axis=1)
        nearest = start + np.clip(share, 0.0, 1.0)[:, None] * change
        return float(np.linalg.norm(nearest, axis=1).min())


def _empty_rope(data: LineAtRest, rest: StatesAtRest) -> RopeAtRest:
    return RopeAtRest(data, rest.empty, data.contact_stations(), empty=True)


def _rope_at_position(data: LineAtRest, rest: StatesAtRest, i: int) -> RopeAtRest:
    return RopeAtRest(data, rest.states[i], data.stations_at_position(i))


def _ropes_of_all_states(data: LineAtRest, rest: StatesAtRest) -> Iterator[tuple[str, RopeAtRest]]:
    """All states of a line, with their names: empty, by position, with a car at an end of a shoe."""
    yield "empty", _empty_rope(data, rest)
    for i in rest.states:
        yield f"position {i + 1}", _rope_at_position(data, rest, i)
    for i, name in rest.shoe_ends:
        for rope in _ropes_at_shoe_ends(data, rest, i, name):
            yield f"position {i + 1}, {name} at an end of the shoe", rope


def _ropes_at_shoe_ends(data: LineAtRest, rest: StatesAtRest, position: int, car_name: str) -> list[RopeAtRest]:
    """Both states with a car at an end of the shoe that carries it."""
    car = next(car for car in data.cars if car["name"] == car_name)
    saddle = data.saddle_under_car(car, position)
    assert saddle is not None
    middle = saddle["at"][0]
    ropes = []
    for side, state in zip((-1.0, 1.0), rest.shoe_ends[position, car_name], strict=True):
        stations = data.stations_at_position(position, {car_name: middle + side * saddle["shoe"]})
        ropes.append(RopeAtRest(data, state, stations))
    return ropes


class LargestGaps:
    """Largest gap of each law, and where."""

    def __init__(self) -> None:
        self.largest: dict[str, tuple[float, str]] = {}

    def note_gap(self, law: str, where: str, gap: float) -> None:
        """Keep the gap of a law if it is the largest so far; nan counts as very large."""
        gap = min(gap, 1e300) if gap == gap else 1e300  # what is not there at all is a finite gap
        if gap >= self.largest.get(law, (0.0, ""))[0]:
            self.largest[law] = gap, where

    def note_difference(self, law: str, where: str, printed: Any, expected: Any, allowed: float = 0.0) -> None:
        """Note the gap of two numbers over what is allowed; of other things that are not equal an infinite one."""
        gap = 0.0 if printed == expected else math.inf
        if isinstance(printed, float) and isinstance(expected, float) and allowed > 0.0:
            gap = abs(printed - expected) / allowed
        self.note_gap(law, where, gap)

    def rows(self, quantity: str, allowed: BoundPart) -> Iterator[Agreement]:
        """One row for each law."""
        for law, (gap, where) in self.largest.items():
            yield Agreement(quantity, gap, Bound("law", (allowed,)), where, law=law, unit="-")


# --- laws -----------------------------------------------------------------------------------------------------------


def statics_law_rows(toml: str, rest: StatesAtRest) -> Iterator[Agreement]:
    """One row for each law of statics: its largest defect over all states of a line."""
    data = LineAtRest(toml)
    gaps = LargestGaps()
    empty_length = float(np.ptp(rest.empty.s))
    for where, rope in _ropes_of_all_states(data, rest):
        defects = [*_defects_of_pieces(data, rope, empty_length), *_defects_of_stations(rope)]
        prescribed = data.data["cable"].get("tension")
        if where == "empty" and prescribed is not None:
            tension = float(np.nanmax(rope.tensions[:, rope.station_index(prescribed["at"])]))
            defects.append(("tension of the empty line", (tension - prescribed["value"]) / rope.tension_max))
        for law, defect in defects:
            gaps.note_gap(law, where, float(np.max(np.abs(defect), initial=0.0)))
    return gaps.rows("laws_si", BoundPart("catenaries", ROUNDING, "rounding"))


def _defects_of_pieces(data: LineAtRest, rope: RopeAtRest, empty_length: float) -> Iterator[tuple[str, Any]]:
    """Laws of the pieces between stations, and of the rope's length, with their defects."""
    S = np.diff(rope.s)
    weight = rope.q * S[:, None] * DOWN  # (n - 1, 2)
    yield "weight of each piece", (rope.behind[1:] - rope.ahead[:-1] + weight) / rope.tension_max
    x, y, _ = rope.points_and_tension_at_s(rope.ends_of_pieces)
    yield "shape and stretch", (np.column_stack([x, y]) - rope.points[1:]) / rope.reach
    if not any(c["kind"] == "counterweight" for c in data.contacts):
        length = data.data["cable"].get("length", empty_length)
        yield "unstretched length", (np.ptp(rope.s) - length) / length


def _defects_of_stations(rope: RopeAtRest) -> Iterator[tuple[str, Any]]:
    """Laws of contacts and cars, and of all forces together, with their defects."""
    T = rope.tension_max
    weight = rope.q * np.ptp(rope.s) * DOWN
    total = rope.behind[-1] - rope.ahead[0] + weight
    force = np.zeros_like(rope.ahead)  # of the rope on inner stations (n, 2)
    force[1:-1] = rope.ahead[1:-1] - rope.behind[1:-1]
    for k, station in enumerate(rope.stations):
        N = rope.tensions[:, k]
        data = station.data
        off = rope.points[k] - [station.x, station.y]
        if station.weight:
            load = station.weight * DOWN
            if station.kind == "hauled":
                mean = rope.ahead[k] + rope.behind[k]
                load = load + rope.haul[k] * mean / np.linalg.norm(mean)
            yield "balance of cars", (force[k] + load) / T
            total = total + load
            off = off[:1]
        else:
            total = total - force[k]
        if station.kind == "spring":
            of_rope = rope.ahead[k] if k == 0 else -rope.behind[k]
            yield "force of springs", (of_rope - np.array(data["stiffness"]) * off) / T
        else:
            yield "points of contacts and cars", off / rope.reach
        if station.kind == "counterweight":
            yield "tension at the counterweight", (np.nanmax(N) - data["tension"]) / T
        if station.kind in ("saddle", "hauled"):
            yield "tension past saddles and hauled cars", (N[1] - N[0]) / T
        if station.kind == "saddle":
            yield "saddles press down", min(force[k, 1], 0.0) / T
    yield "rope, loads and reactions", total / T


# --- numbers --------------------------------------------------------------------------------------------------------


def numbers_by_position(data: LineAtRest, rest: StatesAtRest) -> list[PositionNumbers | None]:
    """The numbers of each position, named as in positions.csv; None without rest."""
    numbers: list[PositionNumbers | None] = [None] * len(rest.positions)
    for i in rest.states:
        numbers[i] = _numbers_at_position(data, rest, i)
    return numbers


def _numbers_at_position(data: LineAtRest, rest: StatesAtRest, position: int) -> PositionNumbers:
    rope = _rope_at_position(data, rest, position)
    row: PositionNumbers = {"position": position + 1}
    for car in data.cars:
        row |= _numbers_at_car(data, rest, rope, position, car)
    for j, contact in enumerate(data.contacts):
        numbers = _numbers_at_contact(data, rest.empty, rope, position, j)
        row |= {f"{kind}:{contact['name']}": x for kind, x in numbers.items()}
    for a, b in itertools.pairwise(data.contacts):
        stations = rope.station_index(a["name"]), rope.station_index(b["name"])
        row[f"sag:{a['name']} to {b['name']}"] = _largest_sag(rope, *stations)
    row["tension_max"] = rope.tension_max
    row["tension_min"] = rope.tension_min
    if data.breaking_load is not None:
        row["safety_factor"] = data.breaking_load / rope.tension_max
    for name, profile in data.profiles.items():
        height = _min_height_of_rope(rope, profile)
        if height is not None:
            row[f"clearance_rope:{name}"] = height
    return row


def _numbers_at_car(
    data: LineAtRest, rest: StatesAtRest, rope: RopeAtRest, position: int, car: dict[str, Any]
) -> PositionNumbers:
    """x, depth, clearance and saddle of a car; on the rope its tensions, and the haul of a hauled car."""
    name = car["name"]
    x = data.x_of_car(car, position)
    saddle = data.saddle_under_car(car, position)
    row: PositionNumbers = {f"x:{name}": x, f"on:{name}": None}
    behind = ahead = haul = None
    if saddle is None:
        k = rope.station_index(name)
        depth = float(rope.points[k, 1])
        behind, ahead = rope.tensions[:, k].tolist()
        haul = float(rope.haul[k])
    else:
        at_ends = _ropes_at_shoe_ends(data, rest, position, name)
        left, right = (rope.points[rope.station_index(name)] for rope in at_ends)
        depth = _car_depth_on_shoe(left, right, x, np.array(saddle["at"]))
        row[f"on:{name}"] = saddle["name"]
    row[f"tension_behind:{name}"] = behind
    row[f"tension_ahead:{name}"] = ahead
    if car["hauled"]:
        row[f"haul:{name}"] = haul
    row[f"depth:{name}"] = depth
    for of, profile in data.profiles.items():
        if profile[0, 0] <= x <= profile[-1, 0]:
            height = float(np.interp(x, *profile.T)) - depth
            row[f"clearance_car:{name} over {of}"] = height - car.get("below", 0.0)
    return row


def _car_depth_on_shoe(left: Array, right: Array, x: float, top: Array) -> float:
    """Depth of a car at x on a shoe: cubics from its ends (2,), on the car's path, to the saddle's top (2,).

    A cubic leaves the end along its chord, and passes the saddle with the mean slope of both chords.
    """
    slope_left, slope_right = (float(dy / dx) for dx, dy in (top - left, top - right))
    on_left = x <= top[0]
    end = left if on_left else right
    slope = slope_left if on_left else slope_right
    d = float(top[0] - end[0])
    w = (x - float(end[0])) / d  # 0 at the end, 1 at the saddle
    bend = 0.5 * (slope_left + slope_right - 2.0 * slope) * d
    return float(end[1] + slope * d * w + bend * (w**3 - w**2))


def _numbers_at_contact(
    data: LineAtRest, empty: StateAtRest, rope: RopeAtRest, position: int, j: int
) -> PositionNumbers:
    """Numbers of contact j by kind: tension, and what saddle, counterweight or spring do."""
    contact = data.contacts[j]
    k = rope.station_index(contact["name"])
    row: PositionNumbers = {"tension": float(np.nanmax(rope.tensions[:, k]))}
    if contact["kind"] == "saddle":
        on_shoe = [car for car in data.cars if data.saddle_under_car(car, position) is contact]
        car_weight = sum(car["mass"] for car in on_shoe) * data.gravity
        row |= _numbers_at_saddle(rope.behind[k], rope.ahead[k], car_weight)
        row["knee_empty"] = _degrees_of_bend(empty.behind[j], empty.ahead[j])
        row["rope_over"] = float(empty.s[j] - rope.s[k])
    elif contact["kind"] == "counterweight":
        taken = float(np.ptp(rope.s) - np.ptp(empty.s))
        row["rise"] = data.heat * taken * (1.0 + contact["tension"] / data.EA)
    elif contact["kind"] == "spring":
        row["shift"] = float(np.linalg.norm(rope.points[k] - contact["at"]))
    return row


def _numbers_at_saddle(behind: Array, ahead: Array, car_weight: float) -> PositionNumbers:
    """Pressure of the rope on a saddle by its forces (2,) behind and ahead, load with the cars on the shoe, bend."""
    across, down = ahead - behind
    numbers: PositionNumbers = {"knee": _degrees_of_bend(behind, ahead)}
    numbers["direction"] = 90.0 - math.degrees(math.atan2(down, across))
    for kind, weight in (("pressure", 0.0), ("load", car_weight)):
        numbers[kind] = math.hypot(across, down + weight)
        numbers[f"{kind}_down"] = float(down + weight)
    return numbers


def _degrees_of_bend(behind: Array, ahead: Array) -> float:
    """Angle [deg] between two forces (2,), positive where the rope bends down."""
    cross = float(behind[0] * ahead[1] - behind[1] * ahead[0])
    return math.degrees(math.atan2(cross, float(behind @ ahead)))


def _largest_sag(rope: RopeAtRest, first: int, last: int) -> float:
    """Largest depth [m] below the chord of two stations by index: there the rope is parallel to it."""
    (x0, y0), (x1, y1) = rope.points[[first, last]]
    slope = (y1 - y0) / (x1 - x0)
    x, y = rope.points_closest_to_slope(slope)[first:last].T
    return float(np.max(y - y0 - slope * (x - x0)))


def _min_height_of_rope(rope: RopeAtRest, profile: Array) -> float | None:
    """Smallest height [m] of the rope over an obstacle or ground (n, 2); None where there is none below it.

    It is at a corner of the ground, at a station, or where the rope is parallel to the ground.
    """
    x, depth = profile.T
    if len(profile) == 1:  # between the supports, but perhaps not between rope ends that springs shift
        return float(depth[0] - rope.depth_and_tension_at_x(x)[0][0])
    corners = np.concatenate([x, rope.points[:, 0]])
    points = [np.column_stack([corners, rope.depth_and_tension_at_x(corners)[0]])]
    for slope in np.diff(depth) / np.diff(x):
        points.append(rope.points_closest_to_slope(slope))
    x_rope, y = np.concatenate(points).T
    begin = max(x[0], rope.points[0, 0])
    end = min(x[-1], rope.points[-1, 0])
    within = (x_rope >= begin) & (x_rope <= end)
    heights = np.interp(x_rope[within], x, depth) - y[within]
    return float(heights.min()) if heights.size else None


def extremes_of_numbers(rows: Sequence[PositionNumbers | None]) -> dict[str, tuple[float, float]]:
    """Smallest and largest value of each number over all positions."""
    values: dict[str, list[float]] = {}
    for row in filter(None, rows):
        for name, value in row.items():
            if isinstance(value, float) and not name.startswith("x:"):
                values.setdefault(name, []).append(value)
    return {name: (min(x), max(x)) for name, x in values.items() if x}


# --- what is printed ------------------------------------------------------------------------------------------------


def printed_number_rows(
    toml: str, rest: StatesAtRest, folder: Path, page: str, words: Mapping[str, Mapping[str, str]]
) -> list[Agreement]:
    """Rows of all that is printed of a line, compared with a second computation: its files in `folder`, and its page.

    A gap counts in parts of what is allowed: rounding, of a design number its bar, of the page half its last digit.
    words : how the page calls each kind of number.
    """
    printed = _PrintedLine(toml, rest, folder, page)
    notes: list[Callable[[], None]] = [printed.note_summary, printed.note_positions, printed.note_profile]
    notes += [printed.note_design, printed.note_outcome, partial(printed.note_page, words), printed.note_limits]
    for note in notes:
        try:
            note()
        except DamagedFileError as damage:
            printed.gaps.note_gap(damage.file.name, str(damage), math.inf)
    return list(printed.gaps.rows("printed", BoundPart("catenaries", 1.0, "allowed")))


def _kind_without_extreme(name: str) -> str:
    """The kind of a number before the colon, without _min or _max."""
    return re.sub("_(min|max)$", "", name.partition(":")[0])


def _float_or_none(cell: str | None) -> float | None:
    try:
        return float(cell or "")
    except ValueError:
        return None


def _extreme_tensions(ropes: Sequence[RopeAtRest], x: Array) -> dict[str, Array]:
    """Columns (m,) of profile.csv at x: at a car that grips the tension jumps, and both of its values count."""
    near = 1e-9 * float(np.ptp(x))
    sides = [np.clip(x + offset, x[0], x[-1]) for offset in (-near, near)]
    tensions = [rope.depth_and_tension_at_x(side)[1] for rope in ropes for side in sides]
    return {"tension_max": np.max(tensions, axis=0), "tension_min": np.min(tensions, axis=0)}


class _PrintedLine:
    """What the files of a line at rest say, a second computation of it, and the gaps between both."""

    def __init__(self, toml: str, rest: StatesAtRest, folder: Path, page: str) -> None:
        self.data = LineAtRest(toml)
        self.rest = rest
        self.folder = folder
        self.page = page
        self.summary = read_json(folder / "summary.json")
        self.gaps = LargestGaps()
        self.rows = numbers_by_position(self.data, rest)
        self.extremes = extremes_of_numbers(self.rows)
        self.tension_max = self.extremes["tension_max"][1]

    @cached_property
    def _scales_by_kind(self) -> dict[str, float]:
        """Scales of the kinds of numbers that are not forces."""
        reach = self.data.contacts[-1]["at"][0]
        pressures = [low for name, (low, _) in self.extremes.items() if name.startswith("pressure:")]
        angle = math.degrees(self.tension_max / max(min(pressures, default=1.0), 1.0))
        return dict.fromkeys(LENGTHS, reach) | dict.fromkeys(ANGLES, angle) | {"safety_factor": 1.0}

    def _allowed_rounding(self, name: str) -> float:
        """The rounding that is allowed to a number by its name."""
        return ROUNDING * float(self._scales_by_kind.get(_kind_without_extreme(name), self.tension_max))

    def note_summary(self) -> None:
        """Note the gaps of the positions, and of the length, in summary.json."""
        refused = [i + 1 for i, row in enumerate(self.rows) if row is None]
        printed = [x["position"] for x in self.summary["refused"]]
        length = float(np.ptp(self.rest.empty.s))
        self.gaps.note_difference("summary.json", "refused", printed, refused)
        self.gaps.note_difference("summary.json", "positions", self.summary["positions"], len(self.rows))
        printed_length = self.summary["empty_length"]
        self.gaps.note_difference("summary.json", "empty_length", printed_length, length, ROUNDING * length)

    def note_limits(self) -> None:
        """Note each fault of the limits, and of their table on the page."""
        for fault in limit_faults(self.summary["limits"], self.data.data, self.summary["design"], ()):
            self.gaps.note_gap("limits", fault, math.inf)
        for fault in limit_table_faults(self.page, self.summary["limits"]):
            self.gaps.note_gap("page, limits", fault, math.inf)

    def note_positions(self) -> None:
        """Note the gaps of all cells of positions.csv."""
        table = read_csv_rows(self.folder / "positions.csv")
        self.gaps.note_difference("positions.csv", "rows", len(table), len(self.rows))
        for i, (cells, row) in enumerate(zip(table, self.rows, strict=False)):
            numbers: PositionNumbers = row or {"position": i + 1}
            for name in {**cells, **numbers}:
                kind, _, subject = name.partition(":")
                where = f"{subject or 'the line'}, position {i + 1}"
                expected = numbers.get(name)
                cell: Any = cells[name]
                if isinstance(expected, float):
                    cell = _float_or_none(cell)
                else:
                    expected = "" if expected is None else str(expected)
                self.gaps.note_difference(f"positions.csv, {kind}", where, cell, expected, self._allowed_rounding(name))

    def note_profile(self) -> None:
        """Note the gaps of profile.csv, and of the profile and the ropes drawn by ropes.json."""
        table = read_csv_columns(self.folder / "profile.csv")
        drawn = read_json(self.folder / "ropes.json")
        x = table["x"]
        ropes = {i: _rope_at_position(self.data, self.rest, i) for i in self.rest.states}
        depths = {i: rope.depth_and_tension_at_x(x)[0] for i, rope in ropes.items()}
        columns = {"x": x}
        columns["y_highest"] = np.min([*depths.values()], axis=0)
        columns["y_lowest"] = np.max([*depths.values()], axis=0)
        columns |= _extreme_tensions(list(ropes.values()), x)
        columns["y_rest"] = _empty_rope(self.data, self.rest).depth_and_tension_at_x(x)[0]
        lengths_allowed = ROUNDING * float(np.ptp(x))
        tensions_allowed = ROUNDING * float(columns["tension_max"].max())
        for name, expected in columns.items():
            allowed = tensions_allowed if "tension" in name else lengths_allowed
            self._note_column(f"profile.csv, {name}", x, table.get(name), expected, allowed)
            self._note_column("ropes.json", x, np.array(drawn["profile"][name], float), expected, allowed)
        for position, drawn_depths in drawn["depths"].items():
            self._note_column(
                "ropes.json", x, np.array(drawn_depths, float), depths[int(position) - 1], lengths_allowed
            )

    def _note_column(self, law: str, x: Array, written: Array | None, expected: Array, allowed: float) -> None:
        """Note the largest gap of a written column (n,) over x to the expected one; of a missing one a large one."""
        off = np.full(expected.shape, math.nan)
        if written is not None and written.shape == expected.shape:
            off = np.abs(written - expected)
        k = int(np.argmax(off))  # of nan, too
        self.gaps.note_gap(law, f"x = {x[k]:.6g} m", float(off[k]) / allowed)

    def note_design(self) -> None:
        """Note the gaps of design numbers: value, positions of the cars then, value there; and missing ones."""
        gaps = self.gaps
        known = self.extremes
        names = set()
        for number in self.summary["design"]:
            quantity = number["quantity"]
            kind, colon, subject = quantity.partition(":")
            name = quantity if quantity in known else _kind_without_extreme(quantity) + colon + subject
            names.add(name)
            allowed = self._allowed_rounding(name) + (number["bar"] or 0.0)
            expected = known[name][kind.endswith("_max")] if name in known else None
            gaps.note_difference("design", quantity, number["value"], expected, allowed)
            i = number["position"] - 1
            at = {car["name"]: self.data.x_of_car(car, i) for car in self.data.cars}
            gaps.note_difference("design, positions of cars", quantity, number["at"], at)
            row = self.rows[i] or {}
            if name in row:
                gaps.note_difference("design, value there", quantity, number["value"], row[name], allowed)
        for name in known:
            gaps.note_difference("design", name, name in names, True)

    def note_outcome(self) -> None:
        """Note unless the outcome names a rope beyond its breaking load first, then everything that is hit."""
        gaps = self.gaps
        text = self.summary["outcome"]
        tension = self.tension_max
        lowest = {name: low for name, (low, _) in self.extremes.items() if name.startswith("clearance")}
        hit = {name.partition(":")[2].split(" over ")[-1] for name, low in lowest.items() if low < LOWEST}
        broken = self.data.breaking_load is not None and tension > self.data.breaking_load
        kinds = {"breaks": broken, "collides": hit, "incomplete": self.summary["refused"], "carries": True}
        kind = next(kind for kind, holds in kinds.items() if holds)
        gaps.note_difference("outcome", "kind", self.summary["outcome_kind"], kind)
        gaps.note_difference("outcome", "breaking load", "breaking load" in text.split(";")[0], broken)
        for name in hit:
            named = f"{name} by " in text or "more" in text
            gaps.note_difference("outcome", name, named, True)
        kilonewtons = re.search(r"(\d+\.\d) kN", text)
        if kilonewtons is not None:
            gaps.note_difference("outcome", "tension", float(kilonewtons[1]), tension / 1e3, 0.06)
        if hit:
            depths = [float(x) for x in re.findall(r" by (\d+\.\d\d) m", text)]
            deepest = max(depths, default=math.inf)
            gaps.note_difference("outcome", "depth of a collision", deepest, -min(lowest.values()), 0.006)

    def note_page(self, words: Mapping[str, Mapping[str, str]]) -> None:
        """Note unless the table of the page shows each design number to half its last digit, with the cars then."""
        shown = plain_text(self.summary["outcome"]) in plain_text(self.page)
        self.gaps.note_difference("page", "outcome", shown, True)
        tables = [rows for rows in rows_of_each_table(self.page) if rows and rows[0][0] == "quantity"]
        texts = {quantity: extremes for quantity, *extremes in itertools.chain(*tables)}
        for number in self.summary["design"]:
            kind, _, subject = number["quantity"].partition(":")
            name = kind if kind in words and not subject else _kind_without_extreme(kind)
            largest, smallest = texts.get(words[name]["words"].format(subject), ["", ""])
            in_smallest = kind.endswith("_min") and smallest != "the same"
            self._note_shown_number(number, smallest if in_smallest else largest)

    def _note_shown_number(self, number: dict[str, Any], text: str) -> None:
        """Note the gap of a design number to its text in the page's table, and whether the cars are named with it."""
        gaps = self.gaps
        where = number["quantity"]
        parts = re.fullmatch(r"(-?\d+\.(\d+)) ?([a-zA-Z°]*)(?: \((.*)\))?", text)
        if parts is None:
            gaps.note_gap("page", where, math.inf)
            return
        value, decimals, unit, at = parts.groups()
        factor = conversion_factor_or_nan(unit, number["unit"])
        last_digit = factor * 10.0 ** -len(decimals)
        gaps.note_difference("page", where, float(value) * factor, number["value"], 0.51 * last_digit)
        cars = ", ".join(f"{name} {x:.0f}" for name, x in number["at"].items())
        if len(number["at"]) > MOST_CARS_NAMED:
            cars = f"position {number['position']}"
        gaps.note_difference("page, cars", where, at or cars, cars)
