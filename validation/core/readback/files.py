"""Files of a run against its stored fields."""

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from validation.core.readback.limits import limit_faults
from validation.core.readback.stored import Faults, Run, StoredResults
from validation.core.readback.verification import verification_faults
from validation.core.scene_data import ROUNDING, Array, max_depth_at, series_faults
from validation.core.stored_files import damaged_files_are_faults, read_csv_columns, read_json


@damaged_files_are_faults
def file_limit_and_verification_faults(stored: StoredResults) -> Faults:
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
    "summary.json": _summary_json_faults,
    "response.npz": None,  # the stored fields themselves
    # animations: the stored fields in another format
    "response.xdmf": None,
    "response.h5": None,
    "mass.xdmf": None,
}
