"""The line from the side, to scale, with the rope in motion; data included."""

import base64
import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from cablefem.response import Array, Response
from cablefem.scene import Scene
from cablefem.scene.line import Line
from validation.core.answers import profile_columns
from validation.page.page import render_template
from validation.page.plot import BLUE, VERMILLION, colour_map_bytes

STATIONS = 101  # of the moving rope, at most, without the mass


def side_view_of_runs(
    scene: Scene, runs: Sequence[Response], *, range_T: tuple[float, float], third_party: Any = None
) -> Markup:
    """The side view of one or two runs; its section needs side_view.js among its scripts.

    range_T : tensions [N] at the ends of the colour scale;  third_party : a third party's path.
    """
    r = runs[0]
    s = r.fields.s[:: _station_stride(r)]
    X = scene.catenary
    unit = force_unit(range_T[1])
    data: dict[str, Any] = {
        "span": scene.supports.span,
        "drop": scene.supports.drop,
        "s": six_digits(s),
        "x": six_digits(X.x(s)),
        "y": six_digits(X.y(s)),
        "rest": [six_digits(X.x(s)), six_digits(X.y(s))],
        "static": six_digits(X.tension(s)),
        **_still_parts_of_side_view(scene, r),
        "weights": [],
        "cables": [
            _packed_rope_frames(scene, run, color, *unit) for run, color in zip(runs, (BLUE, VERMILLION), strict=False)
        ],
        "party": None if third_party is None else _packed_third_party_path(scene, third_party),
    }
    return side_view_player(data, range_T, " and ".join(run.method for run in runs))


def force_unit(largest: float) -> tuple[float, str]:
    """Newtons in the unit of a side view, and its name."""
    return (1e3, "kN") if largest >= 2e3 else (1.0, "N")


def side_view_player(data: dict[str, Any], range_T: tuple[float, float], names: str) -> Markup:
    """The side view of packed data; names : of what moves."""
    unit, name = force_unit(range_T[1])
    data = data | {"T": list(range_T), "unit": unit, "unitName": name}
    data["colors"] = [f"#{bytes(c).hex()}" for c in colour_map_bytes(48)]
    # "<" could end the script
    text = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return render_template("side_view.html", data=Markup(text), names=names)


def _station_stride(r: Response) -> int:
    return max(1, -(-(r.fields.s.size - 1) // (STATIONS - 1)))


def _still_parts_of_side_view(scene: Scene, r: Response) -> dict[str, Any]:
    """The parts that do not move: envelope, path of the car, brake, obstacles, ground, speeds at five positions."""
    p = profile_columns(r)
    ahead = np.flatnonzero(np.diff(np.maximum.accumulate(r.s_o), prepend=-1.0) > 0.0)  # first arrivals
    positions = np.linspace(r.s_o[0], r.s_o.max(), 7)[1:-1]
    times = np.interp(positions, r.s_o[ahead], r.t[ahead])
    speeds = []
    for t in times:
        x, y, v = (float(np.interp(t, r.t, values)) for values in (r.x, r.y, r.speed))
        speeds.append({"x": x, "y": y, "text": f"{3.6 * v:.0f} km/h"})
    X = scene.catenary
    return {
        "envelope": [six_digits(p[name]) for name in ("x", "y_highest", "y_lowest")],
        "contacts": [{"x": float(X.x(s)), "y": float(X.y(s)), "kind": "anchor"} for s in (0.0, scene.length)],
        "paths": [packed_car_path(r.x, r.y, _car_depth_below_rope(scene))],
        "speeds": speeds,
        "brakes": [{"x": float(X.x(b.position)), "y": float(X.y(b.position))} for b in scene.drive.brake],
        **obstacles_and_ground(scene),
    }


def obstacles_and_ground(scene: Scene | Line) -> dict[str, Any]:
    """Obstacles and ground."""
    return {
        "obstacles": [{"name": o.name, "x": o.at, "top": o.top} for o in scene.obstacle],
        "ground": [list(point) for point in scene.ground],
    }


def packed_car_path(x: Array, y: Array, below: float) -> dict[str, Any]:
    """The path of a car whose lowest part is `below` [m] the rope."""
    at = at_most_300_indices(x.size)
    return {"x": six_digits(x[at]), "y": six_digits(y[at]), "below": below}


def _packed_third_party_path(scene: Scene, third_party: Any) -> dict[str, Any]:
    at = at_most_300_indices(third_party.t.size)
    x = scene.catenary.x(third_party.s_o) if third_party.x is None else third_party.x
    return {"name": third_party.method, "x": six_digits(x[at]), "y": six_digits(third_party.y[at])}


def _packed_rope_frames(scene: Scene, r: Response, color: str, unit: float, unit_name: str) -> dict[str, Any]:
    """Frames of one rope, from shortly after the start: a gripped mass enters a rope at rest."""
    f = r.fields
    stride = _station_stride(r)
    X = scene.catenary
    T = X.tension(r.s_o[:1])
    start = {"s_o": r.s_o[0], "T": X.tension(f.s[::stride]), "T_behind": T, "T_ahead": T}  # all else is zero
    late = f.t[0] > 0.0

    def frames(name: str) -> Array:
        """A field at the drawn stations, with the rope at rest as its first frame."""
        values = getattr(f, name)
        if values.ndim == 2:
            values = values[:, ::stride]
        if not late:
            return values
        first = np.broadcast_to(start.get(name, 0.0), values[:1].shape)
        return np.concatenate([first, values])

    t = np.append(0.0, f.t) if late else f.t
    sides = [frames("T_behind"), frames("T_ahead")]
    behind, ahead = (np.where(np.isnan(x), other, x) for x, other in (sides, sides[::-1]))
    s_o = frames("s_o")
    readout = [
        ("deflection [m]", 2, frames("mass_v")),
        (f"tension behind [{unit_name}]", 1, behind / unit),
        (f"tension ahead [{unit_name}]", 1, ahead / unit),
        ("speed [km/h]", 1, 3.6 * np.interp(t, r.t, r.speed)),
        (f"press on the rope [{unit_name}]", 2, np.interp(t, r.t, r.F_contact) / unit),
        (f"haul or thrust [{unit_name}]", 2, np.interp(t, r.t, r.F_haul) / unit),
    ]
    car = {
        "s": s_o,
        "x": X.x(s_o) + frames("mass_u"),
        "y": X.y(s_o) + frames("mass_v"),
        "behind": behind,
        "ahead": ahead,
    }
    return {name: pack_array_as_uint16(frames(name)) for name in ("u", "v", "T")} | {
        "t": pack_array_as_uint16(t),
        "touching": [packed_rope_body(car, readout, name=r.method, color=color, below=_car_depth_below_rope(scene))],
        "slack": None if r.slack_onset is None else r.slack_onset * r.length,
    }


def _car_depth_below_rope(scene: Scene) -> float:
    return 0.0 if scene.mass is None else scene.mass.below


def packed_rope_body(
    series: dict[str, Array], readout: Sequence[tuple[str, int, Array]] = (), **how: Any
) -> dict[str, Any]:  # fmt: skip
    """What touches the rope, packed: s, x, y, tensions behind and ahead, (n,) each.

    readout : name, digits and series of numbers to show, of a car.  how : its name, color, body and `below`.
    """
    numbers = [
        {"name": name, "digits": digits, "data": pack_array_as_uint16(values)}
        for name, digits, values in readout
        if np.isfinite(values).all()
    ]
    return {name: pack_array_as_uint16(values) for name, values in series.items()} | {"readout": numbers} | how


def pack_array_as_uint16(x: Array) -> dict[str, Any]:
    """An array as 16-bit integers between its extremes, in base64."""
    low = float(x.min())
    high = float(x.max())
    steps = np.round((x - low) / ((high - low) or 1.0) * 65535.0).astype("<u2")
    return {"low": low, "high": high, "data": base64.b64encode(steps.tobytes()).decode("ascii")}


def at_most_300_indices(n: int) -> Any:
    """Indices of 300 of n points at most."""
    return np.unique(np.linspace(0, n - 1, 300).round().astype(int))


def six_digits(x: Array) -> list[float]:
    """Values to six digits."""
    return [float(f"{value:.6g}") for value in x]
