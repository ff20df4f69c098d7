"""The side view of a page against the stored path and fields."""

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from validation.core.readback.files import car_points_at_frames, path_csv_columns
from validation.core.readback.stored import Faults, Row, Run, StoredResults
from validation.core.readback.texts import contents_of_tags
from validation.core.scene_data import Array, conversion_factor_or_nan, series_faults
from validation.core.stored_files import damaged_files_are_faults, read_csv_columns

PACKED = 65535  # steps between the extremes of a packed series


def side_view_faults(view: dict[str, Any], stored: StoredResults) -> Faults:
    """Faults of the path, the labels of speed, the scene and the moving ropes of a side view."""
    run = stored.runs[0]
    path = path_csv_columns(run)
    points = np.stack([path["x"], path["y"]], axis=1)  # (n, 2)
    reach = float(np.ptp(path["x"])) or 1.0
    drawn_path = view["paths"][0]
    drawn = np.array([drawn_path["x"], drawn_path["y"]]).T  # (m, 2)
    distances, _ = cKDTree(points).query(drawn)
    ends = np.linalg.norm(drawn[[0, -1]] - points[[0, -1]], axis=1)
    six_digits = 1e-5  # of a number: more than it is rounded by
    allowed = six_digits * np.hypot(*drawn.T).max()
    if max(*distances, *ends) > allowed:
        yield f"the path is {max(distances):.3g} m off path.csv"
    for label in view["speeds"]:
        yield from _speed_label_faults(label, points, path["speed"], 0.01 * reach)
    yield from _drawn_scene_faults(view, run["scene"])
    for cable in view["cables"]:
        yield from _moving_rope_faults(cable, view, stored)


def _drawn_scene_faults(view: dict[str, Any], scene: Row) -> Faults:
    """Faults of supports, obstacles, ground and car of a side view against the scene's TOML."""
    supports = scene["supports"]
    obstacles = [{"name": x["name"], "x": x["at"], "top": x["top"]} for x in scene.get("obstacle", [])]
    expected = {
        "span": supports["span"],
        "drop": supports.get("drop", 0.0),
        "obstacles": obstacles,
        "ground": scene.get("ground", []),
    }
    if view["paths"][0]["below"] != scene["mass"].get("below", 0.0):
        yield "below is not the scene's"
    for name, value in expected.items():
        if view[name] != value:
            yield f"{name} is not the scene's"


def _speed_label_faults(label: dict[str, Any], points: Array, speed: Array, near: float) -> Faults:
    """A label lies between two steps; of the speeds of the car at steps near it, within `near` [m], one is its text.

    A car that rolls back passes it twice.
    """
    steps = np.diff(points, axis=0)  # (n - 1, 2)
    to_label = [label["x"], label["y"]] - points[:-1]
    squares = np.sum(steps**2, axis=1)
    products = np.sum(to_label * steps, axis=1)
    share = np.divide(products, squares, out=np.zeros_like(squares), where=squares > 0.0)  # of each step, passed
    foot = share.clip(0.0, 1.0)[:, None] * steps
    distances = np.hypot(*(to_label - foot).T)
    is_near = distances <= distances.min() + near
    between = 3.6 * np.stack([speed[:-1], speed[1:]])[:, is_near]  # (2, k)
    shown = float(label["text"].removesuffix(" km/h"))
    fits = (between.min(axis=0) - 0.51 <= shown) & (shown <= between.max(axis=0) + 0.51)
    if not fits.any():
        yield f"{label['text']} where the car has {between.mean():.1f} km/h"


# columns that a side view shows beside the car: column of path.csv and its SI unit
BESIDE = {"speed": ("speed", "m/s"), "press on the rope": ("F_contact", "N"), "haul or thrust": ("F_haul", "N")}


def _moving_rope_faults(cable: dict[str, Any], view: dict[str, Any], stored: StoredResults) -> Faults:
    """Faults of the frames of a rope and its car."""
    drawn = cable["touching"][0]
    run = stored.runs[stored.methods.index(drawn["name"])]
    stations = np.abs(run["fields.s"][:, None] - np.array(view["s"])).argmin(axis=0)  # (m,)
    yield from _packed_series_faults("t", cable["t"], run["fields.t"])
    for name in ("u", "v", "T"):
        yield from _packed_series_faults(name, cable[name], run[f"fields.{name}"][:, stations])
    of_car = _drawn_series_of_car(run)
    of_points = 1e-4 * max(np.ptp(run["fields.x"]), np.ptp(run["fields.y"]))
    for name, values in of_car.items():
        yield from _packed_series_faults(name, drawn[name], values, of_points if name in ("x", "y") else 0.0)
    yield from _readout_faults(drawn, _series_beside_car(run, of_car))
    if conversion_factor_or_nan(view["unitName"], "N") != view["unit"]:
        yield f"forces are in {view['unitName']} but divided by {view['unit']}"


def _readout_faults(drawn: dict[str, Any], known: dict[str, tuple[Array, str]]) -> Faults:
    """Faults of series that are shown beside a car as "NAME [UNIT]";  known : series (k,) and SI units by name."""
    for beside in drawn["readout"]:
        name, unit = _readout_name_and_unit(beside)
        values, si = known[name]
        yield from _packed_series_faults(name, beside["data"], values / conversion_factor_or_nan(unit, si))


def _readout_name_and_unit(beside: dict[str, Any]) -> tuple[str, str]:
    name, _, unit = beside["name"].rstrip("]").partition(" [")
    return name, unit


def _drawn_series_of_car(run: Run) -> dict[str, Array]:
    """Position, point and both tensions (k,) of the car at the frames; where one side is unknown, the other's."""
    x, y = car_points_at_frames(run).T
    behind = run["fields.T_behind"]
    ahead = run["fields.T_ahead"]
    return {
        "s": run["fields.s_o"],
        "x": x,
        "y": y,
        "behind": np.where(np.isnan(behind), ahead, behind),
        "ahead": np.where(np.isnan(ahead), behind, ahead),
    }


def _series_beside_car(run: Run, of_car: dict[str, Array]) -> dict[str, tuple[Array, str]]:
    """Series (k,) that are shown beside the car, and their SI units, by name; `of_car` of `_drawn_series_of_car`."""
    path = path_csv_columns(run)
    series = {f"tension {side}": (of_car[side], "N") for side in ("behind", "ahead")}
    series["deflection"] = run["fields.mass_v"], "m"
    for name, (column, si) in BESIDE.items():
        series[name] = np.asarray(np.interp(run["fields.t"], path["t"], path[column])), si
    return series


def _packed_series_faults(name: str, part: dict[str, Any], values: Array, rounding: float = 0.0) -> Faults:
    """Faults of a packed series of values (k, ...) at frames; a frame at rest may come first."""
    shown = _unpack_series(part)
    allowed = _packing_rounding(part) + rounding
    yield from series_faults(name, shown[-values.size :], values.ravel(), 1.0, allowed)
    if shown.size not in (values.size, values.size // len(values) * (len(values) + 1)):
        yield f"{name} has other frames than are stored"


def _packing_rounding(part: dict[str, Any]) -> float:
    """Largest rounding of a packed series, in its own unit."""
    return float((part["high"] - part["low"]) / PACKED + 1e-12 * abs(part["high"]))


def _unpack_series(part: dict[str, Any]) -> Array:
    """Values (n,) of a packed series."""
    steps = np.frombuffer(base64.b64decode(part["data"]), "<u2")
    return part["low"] + (part["high"] - part["low"]) / PACKED * steps


@damaged_files_are_faults
def rope_csv_and_side_view_faults(html_text: str, folder: Path, motion: Any) -> Faults:
    """Faults of rope.csv, and of the side view of a line in motion; motion : a `cablefem.motion.LineMotion`."""
    rope = read_csv_columns(folder / "rope.csv")
    steps = np.searchsorted(motion.t, np.unique(rope["t"]) - 1e-9 * motion.t[-1])  # that are written and drawn
    stations = np.searchsorted(motion.s, np.unique(rope["s"]) - 1e-9 * motion.s[-1])
    at = np.ix_(steps, stations)
    T = motion.tension[at]  # (n, m)
    x, y = np.moveaxis(motion.points[at], 2, 0)
    t = np.broadcast_to(motion.t[steps, None], T.shape)
    series = {"t": t, "s": np.broadcast_to(motion.s[stations], T.shape), "x": x, "y": y, "T": T}
    for name, values in series.items():
        for fault in series_faults(name, rope[name], values.ravel()):
            yield f"rope.csv: {fault}"
    if not np.allclose(rope["t"][[0, -1]], motion.t[[0, -1]], rtol=1e-9, atol=0.0):
        yield "rope.csv ends before the run does"
    for data in contents_of_tags('script type="application/json"', html_text):
        cable = json.loads(data)["cables"][0]
        for fault in _drawn_rope_faults(cable, series):
            yield f"side view: {fault}"
        for car in motion.cars:
            drawn = next(x for x in cable["touching"] if x["name"] == car.name)
            path = read_csv_columns(folder / f"path-{car.name}.csv")
            for fault in _drawn_car_faults(drawn, car, steps, path):
                yield f"side view: {car.name}: {fault}"


def _drawn_rope_faults(cable: dict[str, Any], series: dict[str, Array]) -> Faults:
    """Faults of the packed rope of a line in motion."""
    on_rope = np.isfinite(series["T"]).ravel()
    for name, column in (("u", "x"), ("v", "y"), ("T", "T")):
        shown = _unpack_series(cable[name])[on_rope]
        yield from series_faults(name, shown, series[column].ravel()[on_rope], 1.0, _packing_rounding(cable[name]))
    yield from _packed_series_faults("t", cable["t"], series["t"][:, 0])


def _drawn_car_faults(drawn: dict[str, Any], car: Any, steps: NDArray[np.intp], path: dict[str, Array]) -> Faults:
    """Faults of a packed car, drawn at these steps; path : columns of its path.csv."""
    x, y = car.point.T
    known = {"s": car.s, "x": x, "y": y, "behind": car.tension_behind, "ahead": car.tension_ahead}
    if car.turning is not None:
        known["turn"] = car.turning.angle
        if drawn["body"] != ("wheels" if car.turning.wheels else "hangs"):
            yield "another body is drawn"
    for name, values in known.items():
        yield from _packed_series_faults(name, drawn[name], values[steps])
    columns = BESIDE | {"deflection": ("v", "m"), "swing": ("swing", "deg"), "pitch": ("pitch", "deg")}
    columns |= {f"tension {side}": (f"T_{side}", "N") for side in ("behind", "ahead")}
    columns |= {f"{side} wheel": (f"wheel_{side}", "N") for side in ("rear", "front")}
    shown = {}
    for beside in drawn["readout"]:
        name = _readout_name_and_unit(beside)[0]
        column, si = columns[name]
        shown[name] = path[column][steps], si
    yield from _readout_faults(drawn, shown)
