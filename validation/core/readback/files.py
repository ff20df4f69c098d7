"""Files of a run against its stored fields."""

import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from scipy.interpolate import CubicSpline

from validation.core.readback.limits import limit_faults
from validation.core.readback.stored import Faults, Run, StoredResults
from validation.core.readback.verification import verification_faults
from validation.core.scene_data import ROUNDING, Array, max_depth_at, series_faults
from validation.core.stored_files import damaged_files_are_faults, read_csv_columns, read_json

SINGLE_PRECISION = 1e-6  # relative


@damaged_files_are_faults
def faults_of_stored_results(stored: StoredResults) -> Faults:
    """Faults of the files of each method, and of the stored limits and verification."""
    scene = stored.runs[0]["scene"]
    for fault in limit_faults(stored.limits, scene, stored.design, stored.shown_events):
        yield f"limits: {fault}"
    for fault in verification_faults(stored):
        yield f"verification: {fault}"
    for method, run in zip(stored.methods, stored.runs, strict=True):
        for name, reader in FILES.items():
            file = stored.folder / method / name
            if reader is not None and file.exists():
                for fault in reader(file, run):
                    yield f"{file}: {fault}"


def _csv_faults(columns_of_run: Callable[[Run], dict[str, Array]], file: Path, run: Run) -> Faults:
    """Faults of the columns of a CSV."""
    columns = read_csv_columns(file)
    expected = columns_of_run(run)
    for name in columns.keys() ^ expected.keys():
        yield f"column {name} has no second computation or is not there"
    for name in columns.keys() & expected.keys():
        yield from series_faults(name, columns[name], expected[name], ROUNDING)


def path_csv_columns(run: Run) -> dict[str, Array]:
    """Columns of path.csv from the stored arrays (n,)."""
    stored = ("t", "s_o", "x", "y", "u", "v", "T_behind", "T_ahead", "F_haul")
    path = {name: run[name] for name in stored}
    path["speed"] = np.sqrt(np.sum(run["velocity"] ** 2, axis=1))
    tangent = run["slope_behind"] + run["slope_ahead"]  # (n, 2)
    contact = run["contact"]  # (n, 2)
    across = tangent[:, 0] * contact[:, 1] - tangent[:, 1] * contact[:, 0]
    path["F_contact"] = across / np.sqrt(np.sum(tangent**2, axis=1))
    return path


def _tension_csv_columns(run: Run) -> dict[str, Array]:
    """Columns of tension.csv, rows of each frame: all stations, then the car's two sides."""
    frames, stations = run["fields.T"].shape
    s = np.tile(run["fields.s"], (frames, 1))
    s_o = run["fields.s_o"]
    T = [run["fields.T"], run["fields.T_behind"], run["fields.T_ahead"]]
    return {
        "t": np.repeat(run["fields.t"], stations + 2),
        "s": np.column_stack([s, s_o, s_o]).ravel(),
        "T": np.column_stack(T).ravel(),
    }


def _profile_csv_columns(run: Run) -> dict[str, Array]:
    """Envelopes of depth and tension over x: from all valid frames, and of the car's path between them."""
    until = time_of_slack_or_slow_waves(run)
    x_rest = run["fields.x"]
    y_rest = run["fields.y"]
    count = 201  # of profile.csv
    x = np.linspace(x_rest[0], x_rest[-1], count)
    depths = [np.interp(x, x_rest, y_rest)]
    tensions = [np.interp(x, x_rest, run["fields.T_static"])]
    car = car_points_at_frames(run)
    T_car = np.fmax(run["fields.T_behind"], run["fields.T_ahead"])
    for k in np.flatnonzero(run["fields.t"] <= until):
        i = int(np.searchsorted(run["fields.s"], run["fields.s_o"][k], side="right"))
        x_rope = np.insert(x_rest + run["fields.u"][k], i, car[k, 0])
        y_rope = np.insert(y_rest + run["fields.v"][k], i, car[k, 1])
        T = np.insert(run["fields.T"][k], i, T_car[k])
        depths.append(np.interp(x, x_rope, y_rope))
        tensions.append(np.interp(x, x_rope, T))
    valid = run["t"] <= until
    depth_of_path = max_depth_at(x, run["x"][valid], run["y"][valid])
    return {
        "x": x,
        "y_rest": depths[0],
        "y_highest": np.min(depths, axis=0),
        "y_lowest": np.maximum(np.max(depths, axis=0), depth_of_path),
        "tension_max": np.max(tensions, axis=0),
        "tension_min": np.min(tensions, axis=0),
    }


def time_of_slack_or_slow_waves(run: Run) -> float:
    """Time [s] of the slack onset, or since when waves are slower than the mass; infinite without both."""
    length = run["rest"]["length"]
    onset = run["rest"]["slack_onset"]
    until = math.inf
    if onset is not None:
        until = float(run["t"][np.argmin(np.abs(run["s_o"] - onset * length))])
    for flag in run["rest"]["flags"]:
        if flag["kind"] == "slow waves":
            until = min(until, float(np.interp(flag["numbers"]["since"] * length, run["s_o"], run["t"])))
    return until


def car_points_at_frames(run: Run) -> Array:
    """Points (k, 2) [m] of the car at the frames: on the rope at rest, moved by the mass's displacement.

    The rope between two stations is a cubic: a chord of h cuts off h^2/8 times the curvature of a deep rope.
    """
    rest = np.stack([run["fields.x"], run["fields.y"]], axis=1)
    rest_curve = CubicSpline(run["fields.s"], rest)
    displacement = np.stack([run["fields.mass_u"], run["fields.mass_v"]], axis=1)
    return rest_curve(run["fields.s_o"]) + displacement


def larger_extent_at_rest(run: Run) -> float:
    """The larger [m] of width and height of the rope at rest."""
    return float(max(np.ptp(run["fields.x"]), np.ptp(run["fields.y"])))


def _rope_animation_faults(file: Path, run: Run) -> Faults:
    """Points, velocity and tension of the rope in some frames; the car's two ends come last."""
    extent = larger_extent_at_rest(run)
    for k, frame in _read_some_animation_frames(file, run):
        rope = _points_with_y_up(run["fields.x"] + run["fields.u"][k], run["fields.y"] + run["fields.v"][k])
        rates = [run["fields.du"][k], run["fields.dv"][k]]
        s_ends = run["fields.s_o"][[k, k]]
        at_car = [np.interp(s_ends, run["fields.s"], rate) for rate in rates]
        velocity = np.concatenate([_points_with_y_up(*rates), _points_with_y_up(*at_car)])
        T = [*run["fields.T"][k], run["fields.T_behind"][k], run["fields.T_ahead"][k]]
        moved = frame["points"] + frame["displacement"]  # (m + 2, 3)
        yield from series_faults(f"rope in frame {k}", moved[:-2], rope, SINGLE_PRECISION, extent)
        yield from _car_point_faults(k, moved[-1], run)
        yield from series_faults(f"velocity in frame {k}", frame["velocity"], velocity, SINGLE_PRECISION)
        yield from series_faults(f"tension in frame {k}", frame["tension"], np.array(T), SINGLE_PRECISION)


def _mass_animation_faults(file: Path, run: Run) -> Faults:
    """Point of the car and tension on its two sides in some frames."""
    for k, frame in _read_some_animation_frames(file, run):
        yield from _car_point_faults(k, frame["points"] + frame["displacement"], run)
        for side in ("behind", "ahead"):
            T = run[f"fields.T_{side}"][k : k + 1]
            yield from series_faults(f"tension {side} in frame {k}", frame[f"tension_{side}"], T, SINGLE_PRECISION)


def _car_point_faults(frame: int, point: Array, run: Run) -> Faults:
    expected = _points_with_y_up(*car_points_at_frames(run)[frame])
    yield from series_faults(f"car in frame {frame}", point, expected, 1e-4, larger_extent_at_rest(run))


def _read_some_animation_frames(file: Path, run: Run) -> Iterator[tuple[int, dict[str, Array]]]:
    """Numbers and arrays of some frames of an animation; ValueError if it has other times than the stored frames."""
    grids: list[Any] = [x for x in ElementTree.parse(file).iter("Grid") if x.get("GridType") == "Uniform"]
    times = np.array([float(grid.find("Time").get("Value")) for grid in grids])
    if not np.array_equal(times, run["fields.t"]):
        raise ValueError(f"{file}: frames at other times than were computed")
    count = 5  # of an animation that are read
    frames = np.linspace(0, len(grids) - 1, count).round()
    for k in np.unique(frames.astype(int)).tolist():
        parts = [part for part in grids[k] if part.tag != "Topology" and part.find("DataItem") is not None]
        yield k, {part.get("Name") or "points": _read_xdmf_item(part.find("DataItem"), file) for part in parts}


def _read_xdmf_item(item: Any, file: Path) -> Array:
    """Values of an item of XDMF: in the file, or in the HDF5 beside it."""
    import h5py  # seldom needed

    text = item.text.strip()
    if item.get("Format") != "HDF":
        return np.array(text.split(), dtype=float)
    with h5py.File(file.with_suffix(".h5")) as data:
        return np.array(data[text.partition(":")[2]], dtype=float)


def _points_with_y_up(x: Array, depth: Array) -> Array:
    """Points (..., 3) of an animation, in which y points up and z is zero."""
    return np.stack([x, -depth, 0.0 * x], axis=-1)


def _summary_json_faults(file: Path, run: Run) -> Faults:
    """Numbers of summary.json that follow from the path; all others are as they are stored."""
    written = read_json(file)
    rest = run["rest"]
    if abs(written["reached"] - run["s_o"][-1] / rest["length"]) > ROUNDING:
        yield "reached is not where the path ends"
    if written["max_deflection"] not in run["v"]:
        yield "max_deflection is no v of the path"
    for name in written.keys() & rest.keys() - {"flags"}:
        if written[name] != rest[name]:
            yield f"{name} is not as stored"
    stored = rest.keys() | rest["work"].keys()
    for name in written.keys() - stored - COMPUTED:
        yield f"key {name} has no second computation"


# keys of summary.json that are not stored as they are: this reader and `recomputed` compute them a second time
COMPUTED = {"reached", "max_deflection", "path_scale", "outcome", "outcome_kind", "flag_kinds", "limits"}
FILES: dict[str, Callable[[Path, Run], Faults] | None] = {
    "path.csv": partial(_csv_faults, path_csv_columns),
    "tension.csv": partial(_csv_faults, _tension_csv_columns),
    "profile.csv": partial(_csv_faults, _profile_csv_columns),
    "response.xdmf": _rope_animation_faults,
    "mass.xdmf": _mass_animation_faults,
    "summary.json": _summary_json_faults,
    "response.h5": None,  # by response.xdmf
    "response.npz": None,  # the stored fields themselves
}
