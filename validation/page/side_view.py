"""The line from the side, to scale, with the rope in motion; data included."""

import base64
import json
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup

from cablefem.response import Array, Response
from cablefem.scene import Scene
from cablefem.scene.line import Line
from validation.core.answers import profile_columns
from validation.page.page import Content, render_template
from validation.page.plot import BLUE, VERMILLION, SeriesByName, colour_map_bytes

STATIONS = 101  # of the moving rope, at most, without the mass
BODIES = {"swing": "hangs", "pitch": "wheels"}  # what turns, by its angle
FORCES = {
    "F_contact": "press on the rope",
    "F_haul": "haul or thrust",
    "wheel_rear": "rear wheel",
    "wheel_front": "front wheel",
}


class ForceUnit(NamedTuple):
    newtons: float
    name: str


def side_view_of_runs(
    scene: Scene, runs: Sequence[Response], *, range_T: tuple[float, float], third_party: Any = None
) -> Markup:
    """The side view of one or two runs; its section needs side_view.js among its scripts.

    range_T : tensions [N] at the ends of the colour scale;  third_party : a third party's path.
    """
    r = runs[0]
    X = scene.catenary
    s = r.fields.s[:: _station_stride(r)]
    x = six_digits(X.x(s))
    y = six_digits(X.y(s))
    unit = force_unit(range_T[1])
    data: Content = {"span": scene.supports.span, "drop": scene.supports.drop}
    data |= {"s": six_digits(s), "x": x, "y": y, "rest": [x, y], "static": six_digits(X.tension(s))}
    data |= _still_parts_of_side_view(scene, r)
    data["weights"] = []
    data["cables"] = [
        _packed_rope_frames(scene, run, color, unit) for run, color in zip(runs, (BLUE, VERMILLION), strict=False)
    ]
    data["party"] = None if third_party is None else _sparse_third_party_path(scene, third_party)
    return side_view_player(data, range_T, " and ".join(run.method for run in runs))


def force_unit(largest: float) -> ForceUnit:
    """Unit of forces up to `largest` [N]."""
    return ForceUnit(1e3, "kN") if largest >= 2e3 else ForceUnit(1.0, "N")


def side_view_player(data: Content, range_T: tuple[float, float], moving_names: str) -> Markup:
    """The side view of data in the form that side_view.js reads."""
    unit = force_unit(range_T[1])
    data = data | {"T": list(range_T), "unit": unit.newtons, "unitName": unit.name}
    data["colors"] = [f"#{bytes(c).hex()}" for c in colour_map_bytes(48)]
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    text = text.replace("<", "\\u003c")  # could end the script
    return render_template("side_view.html", data=Markup(text), names=moving_names)


def _station_stride(r: Response) -> int:
    return max(1, -(-(r.fields.s.size - 1) // (STATIONS - 1)))


def _still_parts_of_side_view(scene: Scene, r: Response) -> Content:
    """The parts that do not move: envelope, path of the car, brake, obstacles, ground, speeds at five positions."""
    X = scene.catenary

    def point(s: float) -> Content:
        return {"x": float(X.x(s)), "y": float(X.y(s))}

    parts: Content = {"envelope": rope_envelope(profile_columns(r))}
    parts["contacts"] = [point(s) | {"kind": "anchor"} for s in (0.0, scene.length)]
    parts["paths"] = [sparse_car_path(r.x, r.y, _car_depth_below_rope(scene))]
    parts["speeds"] = _speeds_at_five_positions(r)
    parts["brakes"] = [point(brake.position) for brake in scene.drive.brake]
    return parts | obstacles_and_ground(scene)


def rope_envelope(profile: SeriesByName) -> list[list[float]]:
    """x, and smallest and largest depth of the rope there, from the columns of profile.csv."""
    return [six_digits(profile[name]) for name in ("x", "y_highest", "y_lowest")]


def _speeds_at_five_positions(r: Response) -> list[Content]:
    """Points of the path and the speeds there, when the car first arrives."""
    farthest = np.maximum.accumulate(r.s_o)
    ahead = np.flatnonzero(np.diff(farthest, prepend=-1.0) > 0.0)  # first arrivals
    positions = np.linspace(r.s_o[0], r.s_o.max(), 7)[1:-1]
    speeds = []
    for t in np.interp(positions, r.s_o[ahead], r.t[ahead]):
        x = float(np.interp(t, r.t, r.x))
        y = float(np.interp(t, r.t, r.y))
        kmh = 3.6 * float(np.interp(t, r.t, r.speed))
        speeds.append({"x": x, "y": y, "text": f"{kmh:.0f} km/h"})
    return speeds


def obstacles_and_ground(scene: Scene | Line) -> Content:
    obstacles = [{"name": o.name, "x": o.at, "top": o.top} for o in scene.obstacle]
    return {"obstacles": obstacles, "ground": [list(point) for point in scene.ground]}


def sparse_car_path(x: Array, y: Array, below: float) -> Content:
    """At most 300 points of the path of a car whose lowest part is `below` [m] the rope."""
    at = at_most_300_indices(x.size)
    return {"x": six_digits(x[at]), "y": six_digits(y[at]), "below": below}


def _sparse_third_party_path(scene: Scene, third_party: Any) -> Content:
    at = at_most_300_indices(third_party.t.size)
    x = third_party.x
    if x is None:
        x = scene.catenary.x(third_party.s_o)
    return {"name": third_party.method, "x": six_digits(x[at]), "y": six_digits(third_party.y[at])}


def _packed_rope_frames(scene: Scene, r: Response, color: str, unit: ForceUnit) -> Content:
    """Rope and car of one run over time."""
    X = scene.catenary
    frames = _frames_from_start(scene, r)
    t = frames["t"]
    s_o = frames["s_o"]
    behind = frames["T_behind"]
    ahead = frames["T_ahead"]
    car = {"s_o": s_o, "v": frames["mass_v"]}
    car["x"] = X.x(s_o) + frames["mass_u"]
    car["y"] = X.y(s_o) + frames["mass_v"]
    car["T_behind"] = np.where(np.isnan(behind), ahead, behind)
    car["T_ahead"] = np.where(np.isnan(ahead), behind, ahead)
    for name in ("speed", "F_contact", "F_haul"):
        car[name] = np.interp(t, r.t, getattr(r, name))
    rope: Content = packed_series({name: frames[name] for name in ("u", "v", "T", "t")})
    rope["touching"] = [packed_car(car, unit, name=r.method, color=color, below=_car_depth_below_rope(scene))]
    rope["slack"] = None if r.slack_onset is None else r.slack_onset * r.length
    return rope


def _frames_from_start(scene: Scene, r: Response) -> SeriesByName:
    """Fields at the drawn stations; a gripped mass enters a rope at rest, which is then the first frame."""
    f = r.fields
    stride = _station_stride(r)
    frames = {name: getattr(f, name)[:, ::stride] for name in ("u", "v", "T")}
    frames |= {name: getattr(f, name) for name in ("t", "s_o", "mass_u", "mass_v", "T_behind", "T_ahead")}
    if f.t[0] <= 0.0:
        return frames
    X = scene.catenary
    at_car = X.tension(r.s_o[:1])
    start = {"s_o": r.s_o[0], "T": X.tension(f.s[::stride]), "T_behind": at_car, "T_ahead": at_car}
    for name, values in frames.items():
        first = np.broadcast_to(start.get(name, 0.0), values[:1].shape)  # all else is zero
        frames[name] = np.concatenate([first, values])
    return frames


def _car_depth_below_rope(scene: Scene) -> float:
    return 0.0 if scene.mass is None else scene.mass.below


def packed_car(car: SeriesByName, unit: ForceUnit, **look: Any) -> Content:
    """A car for the side view.

    car : columns of its path.csv at the frames; look : its name, color and `below`.
    """
    columns = {"s": "s_o", "x": "x", "y": "y", "behind": "T_behind", "ahead": "T_ahead"}
    series = {name: car[column] for name, column in columns.items()}
    for angle, body in BODIES.items():
        if angle in car:
            series["turn"] = np.radians(car[angle])
            look["body"] = body
    return packed_series(series) | {"readout": _packed_readout(car, unit)} | look


def _packed_readout(car: SeriesByName, unit: ForceUnit) -> list[Content]:
    """The numbers that the side view shows of a car, where they are known at all times."""
    numbers = [  # name, digits, values
        ("deflection [m]", 2, car["v"]),
        (f"tension behind [{unit.name}]", 1, car["T_behind"] / unit.newtons),
        (f"tension ahead [{unit.name}]", 1, car["T_ahead"] / unit.newtons),
        ("speed [km/h]", 1, 3.6 * car["speed"]),
    ]
    for name, words in FORCES.items():
        if name in car:
            numbers.append((f"{words} [{unit.name}]", 2, car[name] / unit.newtons))
    numbers += [(f"{angle} [deg]", 1, car[angle]) for angle in BODIES if angle in car]
    return [
        {"name": name, "digits": digits, "data": pack_array_as_uint16(values)}
        for name, digits, values in numbers
        if np.isfinite(values).all()
    ]


def packed_series(series: SeriesByName) -> Content:
    return {name: pack_array_as_uint16(values) for name, values in series.items()}


def pack_array_as_uint16(x: Array) -> Content:
    """An array as 16-bit integers between its extremes, in base64."""
    low = float(x.min())
    high = float(x.max())
    fraction = (x - low) / ((high - low) or 1.0)
    steps = np.round(fraction * 65535.0).astype("<u2")
    return {"low": low, "high": high, "data": base64.b64encode(steps.tobytes()).decode("ascii")}


def at_most_300_indices(n: int) -> Any:
    """Indices of 300 of n points at most, evenly spread, with both ends."""
    return np.unique(np.linspace(0, n - 1, 300).round().astype(int))


def six_digits(x: Array) -> list[float]:
    """Values to six digits."""
    return [float(f"{value:.6g}") for value in x]
