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
EIGHT_SPANS = (
    {"mass_per_length": 8.73, "EA": 8.2e7, "tension": {"at": "7", "value": 99.1e3}},
    contact("0", "anchor", 0.0, 0.0),
    contact("1", "saddle", 146.7, -46.42, shoe=1.0),
    contact("2", "saddle", 334.1, -102.7, shoe=3.0),
    contact("3", "saddle", 697.1, -202.0, shoe=2.0),
    contact("4", "saddle", 1054.5, -287.3, shoe=2.0),
    contact("5", "saddle", 1702.7, -410.2, shoe=4.0),
    contact("6", "saddle", 1792.8, -424.1, shoe=5.0),
    contact("7", "saddle", 2179.9, -474.7, shoe=5.0),
    contact("8", "anchor", 2588.3, -512.3),
    car("car", 1251.0, 156.5),
)
STEEP_AND_LIGHT = (
    {"mass_per_length": 0.5366, "EA": 5.209e6, "tension": {"at": "top", "value": 4722.0}},
    contact("top", "anchor", 0.0, 0.0),
    contact("foot", "anchor", 566.5, 393.6),
    car("first", 35.0, 42.21, hauled=False),
    car("second", 35.0, 48.40),
)
FOUR_CARS = (
    {"mass_per_length": 13.26, "EA": 1.548e8},
    contact("0", "anchor", 0.0, 0.0),
    contact("1", "saddle", 254.5, 129.1, shoe=2.5),
    contact("2", "saddle", 841.6, 511.7, shoe=1.6),
    contact("3", "counterweight", 1145.8, 756.5, tension=167.9e3),
    car("0c", 421.0, 187.36, below=2.0),
    car("1c", 1604.0, 526.37, below=2.0),
    car("2c", 1686.0, 712.96, below=2.0),
    car("3c", 2209.0, 805.46, below=2.0),
)
NEAR_THE_END = (
    {"mass_per_length": 4.943, "EA": 7.757e7},
    contact("0", "anchor", 0.0, 0.0),
    contact("1", "saddle", 687.3, -292.9, shoe=4.3),
    contact("2", "saddle", 1049.8, -396.4, shoe=5.8),
    contact("3", "counterweight", 1358.2, -456.7, tension=229.3e3),
    car("car", 898.0, [1356.0 + 0.05 * k for k in range(44)]),
)


def line_with_tables(given: tuple, text: str) -> Line:
    """The line with the tables of a TOML text put in its rope."""
    rope, *parts = given
    return line({**rope, **tomllib.loads(text)}, *parts)
