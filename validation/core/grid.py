"""Grids of scenes from `--set` values.

mass.mass=60              one value
mass.mass=40,60,80        several: a grid
drive.wind=-8:0:5         from, to, count
car.up.at=[50,60]         one value that is a list
mass.mass=+1%             relative to the scene's
"""

import itertools
import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np


def parse_key_and_values(pair: str) -> tuple[str, list[Any]]:
    """Key and values of KEY=VALUES; ValueError says what is wrong."""
    key, given, text = (part.strip() for part in pair.partition("="))
    if not (key and given and text):
        raise ValueError(f"--set must be KEY=VALUE, got {pair!r}")
    if text.count(":") == 2 or re.fullmatch(r"[-+.\de]+:[-+.\de]+", text):
        return key, _parse_range(key, text)
    try:
        return key, tomllib.loads(f"x = [{text}]")["x"]
    except tomllib.TOMLDecodeError:  # names without quotes
        return key, [_toml_value_or_text(part.strip()) for part in text.split(",")]


def _parse_range(key: str, text: str) -> list[float]:
    """The values of FROM:TO:COUNT, both ends included."""
    try:
        low, high, count = text.split(":")
        ends = float(low), float(high)
        values = int(count)
    except ValueError:
        values = 0
    most = 1000  # values of one range; more are a step given for a count
    if not (2 <= values <= most and np.isfinite(ends).all()):
        raise ValueError(
            f"--set {key} = {text}: a range must be FROM:TO:COUNT, COUNT (of values, no step) a whole number "
            f"from 2 to {most}"
        )
    return np.linspace(*ends, values).tolist()


def _toml_value_or_text(text: str) -> Any:
    """The TOML value, or the text itself: names need no quotes."""
    try:
        return tomllib.loads(f"x = {text}")["x"]
    except tomllib.TOMLDecodeError:
        return text


def grid_points(pairs: Sequence[str], cases: Sequence[str] = ()) -> list[dict[str, Any]]:
    """All points of a grid, values by key; the last key changes fastest.  ValueError for a key given twice.

    cases : names of load cases, the first axis.  A value given twice is one point.
    """
    axes = [parse_key_and_values(pair) for pair in pairs]
    if cases:
        axes.insert(0, ("case", [name.strip() for name in ",".join(cases).split(",")]))
    keys = [key for key, _ in axes]
    if twice := {key for key in keys if keys.count(key) > 1}:
        raise ValueError(f"--set {sorted(twice)[0]}: given twice; several values go in one, separated by commas")
    values_by_axis = [_without_repeats(values) for _, values in axes]
    count = math.prod(map(len, values_by_axis))
    most = 10_000  # larger ones are sweeps
    if count > most:
        raise ValueError(f"--set makes {count} points; must be at most {most} (larger grids: cablefem sweep)")
    return [dict(zip(keys, row, strict=True)) for row in itertools.product(*values_by_axis)]


def _without_repeats(values: Sequence[Any]) -> list[Any]:
    typed = [(isinstance(x, bool), x) for x in values]  # True is 1
    return [x for i, x in enumerate(values) if typed[i] not in typed[:i]]


def split_scene_and_method_settings(point: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Split a point into settings of the scene (dotted keys, and a few others) and of the method."""
    scene: dict[str, Any] = {}
    method: dict[str, Any] = {}
    for key, value in point.items():
        settings = scene if "." in key or key in ("gravity", "ground", "title") else method
        settings[key] = value
    return scene, method
