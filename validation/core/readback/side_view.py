"""The side view of a page against the stored path and fields."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from validation.core.readback.files import car_positions, extent_of_rope, path_columns, series_faults
from validation.core.readback.stored import Faults, StoredResults
from validation.core.readback.texts import contents_of_tags
from validation.core.scene_data import ROUNDING, Array, read_columns, si_factor

PACKED = 65535  # steps between the extremes of a packed series


def side_view_faults(view: dict[str, Any], of: StoredResults) -> Faults:
    run = of.stored_run(0)
    path = path_columns(run)
    points = np.stack([path["x"], path["y"]], axis=1)  # (n, 2)
    reach = float(np.ptp(path["x"])) or 1.0
    track = view["paths"][0]
    drawn = np.array([track["x"], track["y"]]).T  # (m, 2)
    distances, _ = cKDTree(points).query(drawn)
    ends = np.linalg.norm(drawn[[0, -1]] - points[[0, -1]], axis=1)
    six_digits = 1e-5  # of a number: more than it is rounded by
    if max(*distances, *ends) > six_digits * np.hypot(*drawn.T).max():
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
    """A mark lies between two steps. A car that rolls back passes it twice: one of the speeds near it is its text."""
    steps = np.diff(points, axis=0)  # (n - 1, 2)
    to_mark = [mark["x"], mark["y"]] - points[:-1]
    squares = np.sum(steps**2, axis=1)
    along = np.divide(np.sum(to_mark * steps, axis=1), squares, out=np.zeros_like(squares), where=squares > 0.0)
    distances = np.hypot(*(to_mark - along.clip(0.0, 1.0)[:, None] * steps).T)
    between = 3.6 * np.stack([speed[:-1], speed[1:]])[:, distances <= distances.min() + near]  # (2, k)
    shown = float(mark["text"].removesuffix(" km/h"))
    if not np.any((between.min(axis=0) - 0.51 <= shown) & (shown <= between.max(axis=0) + 0.51)):
        yield f"{mark['text']} where the car has {between.mean():.1f} km/h"


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
        rounding = 1e-4 * extent_of_rope(run) if name in ("x", "y") else 0.0
        yield from _packed_faults(name, series[name], values, rounding)
        if _unpacked(series[name]).size not in (values.size, values.size // t.size * (t.size + 1)):
            yield f"{name} has other frames than are stored"


def _packed_faults(name: str, part: dict[str, Any], values: Array, rounding: float = 0.0) -> Faults:
    """Faults of a packed series that ends with these values."""
    allowed = _packing_step(part) + rounding
    yield from series_faults(name, _unpacked(part)[-values.size :], values.ravel(), 1.0, allowed)


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
    for data in contents_of_tags('script type="application/json"', html_text):
        view = json.loads(data)
        cable = view["cables"][0]
        here = np.isfinite(columns["T"])
        for name, column in (("u", "x"), ("v", "y"), ("T", "T")):
            shown = _unpacked(cable[name]).reshape(shape)
            yield from series_faults(
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
