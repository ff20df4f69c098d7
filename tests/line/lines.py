"""Lines of the tests, as a user writes them."""

import tomllib
from typing import Any

from cablefem.scene.line import Line


def contact(name: str, kind: str, x: float, depth: float, **more: Any) -> dict[str, Any]:
    return {"name": name, "kind": kind, "at": [x, depth], **more}


def car(name: str, mass: float, at: Any, *, hauled: bool = True, **more: Any) -> dict[str, Any]:
    return {"name": name, "mass": mass, "hauled": hauled, "at": at, **more}


def line(rope: dict[str, Any], *parts: dict[str, Any], **more: Any) -> Line:
    """A line of these contacts and cars."""
    contacts, cars = [p for p in parts if "kind" in p], [p for p in parts if "mass" in p]
    return Line(cable=rope, contact=contacts, car=cars, **more)


THREE = (
    {"mass_per_length": 9.0, "EA": 1.4e8, "length": 1024.5},
    contact("left", "anchor", 0.0, 0.0),
    contact("first", "saddle", 400.0, -30.0, shoe=5.0),
    contact("second", "saddle", 820.0, -20.0, shoe=5.0),
    contact("right", "anchor", 1020.0, 20.0),
    car("grip", 4000.0, 180.494286, hauled=False),
    car("hauled", 4000.0, 618.612609),
)
WEIGHED = (
    {"mass_per_length": 9.0, "EA": 1.5e8},
    contact("left", "anchor", 0.0, 0.0),
    contact("weight", "counterweight", 600.0, -150.0, tension=5e5),
    car("grip", 5000.0, 247.812647, hauled=False),
)
SPRUNG = (
    WEIGHED[0],
    contact("left", "spring", 0.0, 0.0, stiffness=[2e6, 5e6]),
    WEIGHED[2],
    car("grip", 5000.0, 248.0442155, hauled=False),
)
TRAMWAY = (
    {"mass_per_length": 11.4, "EA": 2.1e8},
    contact("weight", "counterweight", 0.0, 0.0, tension=3.8e5),
    contact("right", "anchor", 1200.0, -480.0),
    car("car", 6000.0, 640.052271),
)
ASTER = (
    {"mass_per_length": 30.0 / 9.81, "EA": 5e7, "length": 220.0},
    contact("left", "anchor", 0.0, 0.0),
    contact("one", "saddle", 100.0, 0.0),
    contact("two", "saddle", 200.0, 0.0),
    contact("right", "anchor", 210.0, 0.0),
)


def line_with_tables(given: tuple, text: str) -> Line:
    """The line with the tables of a TOML text put in its rope."""
    rope, *parts = given
    return line({**rope, **tomllib.loads(text)}, *parts)
