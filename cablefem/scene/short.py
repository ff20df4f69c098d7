"""The line in a file: several contacts, or one span whose car has two wheels or a cabin that swings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import tomli_w

from cablefem.scene.cable import SHAPES
from cablefem.scene.described import parse_toml, scene_text_and_name
from cablefem.scene.errors import SceneError
from cablefem.scene.line import Line
from cablefem.scene.scene import Scene


def load_line_or_none(name_or_path: str | Path) -> Line | None:
    """The line of that name or TOML file; None for a scene of one span, or where it cannot be read."""
    try:
        text, name = scene_text_and_name(name_or_path)
        data = parse_toml(text)
    except SceneError:
        return None
    folder = Path(name_or_path).parent
    if "contact" in data:
        return Line.from_toml(text, name=name, folder=folder)
    mass = data.get("mass")
    mass = mass if isinstance(mass, dict) else {}
    wheels = mass.get("wheels", {})
    point = isinstance(wheels, dict) and wheels.get("model") == "point" and not wheels.get("base")
    if "hanger" in mass or ("wheels" in mass and not point):
        return Line.from_toml(tomli_w.dumps(line_tables_of_scene(data)), name=name, folder=folder)
    return None


def load_scene_or_line(name_or_path: str | Path) -> Scene | Line:
    """The scene of one span, or the line, of that name or TOML file."""
    return load_line_or_none(name_or_path) or Scene.load(name_or_path)


def line_tables_of_scene(data: dict[str, Any]) -> dict[str, Any]:
    """Tables of the line of two anchors and one car; SceneError where the cable does not hang.

    Its rope is the same by unstretched length: a strain of it is 1 + T/EA of one at rest, with the mean T.
    """
    described = {key: data[key] for key in ("name", "gravity", "cable", "supports") if key in data}
    scene = Scene(**described)
    at_rest = scene.reference_catenary
    shorter = 1.0 - at_rest.mean_tension / scene.cable.EA
    rope = {key: value for key, value in data["cable"].items() if key not in SHAPES}
    rope |= {
        "mass_per_length": scene.cable.mass_per_length / shorter,
        "EA": scene.cable.EA * shorter,
        "length": at_rest.length * shorter,
    }
    ends = {"left": [0.0, 0.0], "right": [scene.supports.span, scene.supports.drop]}
    contacts = [{"name": end, "kind": "anchor", "at": at} for end, at in ends.items()]
    car = {"name": "car", **data["mass"], **{key: data[key] for key in ("travel", "drive") if key in data}}
    rest = {key: value for key, value in data.items() if key not in ("cable", "supports", "mass", "travel", "drive")}
    return {**rest, "cable": rope, "contact": contacts, "car": [car]}
