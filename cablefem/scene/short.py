"""The line in a file: several contacts, or one span whose car has two wheels or a cabin that swings."""

from __future__ import annotations

import copy
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Self

from pydantic import PrivateAttr

from cablefem.scene.cable import SHAPES
from cablefem.scene.described import parse_toml, refuse_changes_without_keys, scene_text_and_name, set_dotted_key
from cablefem.scene.errors import SceneError
from cablefem.scene.line import Line
from cablefem.scene.scene import Scene
from cablefem.scene.surroundings import replace_ground_file_by_points

CABLE_AT_REST = ("name", "gravity", "cable", "supports")  # keys of a scene that say how its cable hangs


class LineOfOneSpan(Line):
    """The line of two anchors and one car that the tables of one span describe; it takes their keys, too."""

    takes_keys_of: ClassVar = (Scene,)
    _span_tables: dict[str, Any] = PrivateAttr()

    @classmethod
    def from_span_tables(cls, tables: dict[str, Any]) -> Self:
        """The line of [supports], [mass], [travel] and [drive]; SceneError with all faults, in their keys."""
        try:
            line = cls(**line_tables_of_scene(tables))
        except SceneError as error:
            raise SceneError([_in_keys_of_span(fault) for fault in error.faults]) from None
        line._span_tables = tables
        return line

    def fault_in_own_keys(self, fault: str) -> str:
        return _in_keys_of_span(fault)

    def replace(self, changes: Mapping[str, Any]) -> Line:  # type: ignore[override]
        """As of a line; keys of the span are taken as of a scene, keys of [[contact]] and [[car]] as of any line."""
        refuse_changes_without_keys(changes)
        of_line = {key: value for key, value in changes.items() if _first_name(key) in ("contact", "car")}
        of_span = {key: value for key, value in changes.items() if key not in of_line}
        if of_line and not of_span:
            return Line(**self._toml_tables()).replace(changes)
        line = type(self).from_span_tables(self._changed_span_tables(of_span))
        return line.replace(of_line) if of_line else line

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Line:  # type: ignore[override]
        """A plain line where fields are replaced: the tables of the span no longer describe it."""
        return Line(**self._toml_tables()).model_copy(update=update, deep=deep) if update else self

    def _changed_span_tables(self, changes: Mapping[str, Any]) -> dict[str, Any]:
        """A copy of the tables of the span with new values; those of the cable at rest are changed as of a scene."""
        tables = copy.deepcopy(self._span_tables)
        at_rest = {key: value for key, value in changes.items() if _first_name(key) in CABLE_AT_REST}
        for key, value in changes.items():
            if key not in at_rest:
                set_dotted_key(tables, key, value)
        if at_rest:
            hanging = Scene(**{key: tables[key] for key in CABLE_AT_REST if key in tables}).replace(at_rest)
            described = parse_toml(hanging.to_toml())
            tables |= {key: described[key] for key in CABLE_AT_REST}
        replace_ground_file_by_points(tables, Path())
        return tables


def _first_name(key: str) -> str:
    """The first name of a dotted key."""
    return key.partition(".")[0]


def _in_keys_of_span(fault: str) -> str:
    """A fault of the car of a line, in the keys of one span."""
    fault = re.sub(r"\bcar(\[0\]|\.car)\.(travel|drive)\b", r"\2", fault)
    fault = fault.replace(" on a line", " with wheels or a hanger")
    return re.sub(r"\bcar(\[0\]|\.car)\.", "mass.", fault)


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
        replace_ground_file_by_points(data, folder)
        return LineOfOneSpan.from_span_tables({"name": name, **data})
    return None


def load_scene_or_line(name_or_path: str | Path) -> Scene | Line:
    """The scene of one span, or the line, of that name or TOML file."""
    return load_line_or_none(name_or_path) or Scene.load(name_or_path)


def line_tables_of_scene(data: dict[str, Any]) -> dict[str, Any]:
    """Tables of the line of two anchors and one car; SceneError where the cable does not hang.

    Its rope is the same by unstretched length: a strain of it is 1 + T/EA of one at rest, with the mean T.
    """
    scene = Scene(**{key: data[key] for key in CABLE_AT_REST if key in data})
    at_rest = scene.reference_catenary
    shorter = 1.0 - at_rest.mean_tension / scene.cable.EA
    rope = {key: value for key, value in data["cable"].items() if key not in SHAPES}
    rope["mass_per_length"] = scene.cable.mass_per_length / shorter
    rope["EA"] = scene.cable.EA * shorter
    rope["length"] = at_rest.length * shorter
    left = {"name": "left", "kind": "anchor", "at": [0.0, 0.0]}
    right = {"name": "right", "kind": "anchor", "at": [scene.supports.span, scene.supports.drop]}
    car = {"name": "car", **data["mass"]}
    car |= {key: data[key] for key in ("travel", "drive") if key in data}
    rest = {key: value for key, value in data.items() if key not in ("cable", "supports", "mass", "travel", "drive")}
    return {**rest, "cable": rope, "contact": [left, right], "car": [car]}
