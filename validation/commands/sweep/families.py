"""Random realistic scenes by families, all numbers drawn uniformly.

The first three are a gripped car on a locked rope, a hauled one, and a rider on a thin rope.
The others are harder: `wide` families.
"""

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from cablefem.scene import Scene
from cablefem.scene.line import Line

Draw = Callable[[float, float], float]
Tables = dict[str, Any]


def _transverse_wave_speed(tables: Tables) -> float:
    cable = tables["cable"]
    return math.sqrt(cable["horizontal_tension"] / cable["mass_per_length"])


def _ropeway_tables(draw: Draw) -> Tables:
    """Cable, supports and mass of a ropeway.

    A full locked rope: 0.87 of its circle is metal, 8450 kg/m^3 with filling, 160 GPa.
    """
    span = draw(200.0, 1500.0)
    diameter = draw(0.025, 0.055)
    area = 0.87 * math.pi * diameter**2 / 4.0
    H = area * draw(200e6, 400e6)
    cable = {"mass_per_length": 8450.0 * area, "EA": 160e9 * area, "horizontal_tension": H}
    supports = {"span": span, "drop": span * draw(-0.6, 0.6)}
    return {"cable": cable, "supports": supports, "mass": {"mass": H * draw(0.02, 0.2) / 9.81}}


def gripped_car(draw: Draw) -> Scene:
    """A car that grips a locked rope, at 0.1 to 0.5 of the wave speed."""
    x = _ropeway_tables(draw)
    speed = draw(0.1, 0.5) * _transverse_wave_speed(x)
    travel = {"kind": "constant_speed", "speed": speed}
    if draw(0.0, 1.0) > 0.5:
        travel = {"kind": "accelerate_cruise_brake", "top_speed": speed}
    return Scene(**x | {"travel": travel}, name="gripped")


def hauled_car(draw: Draw) -> Scene:
    """A car that rolls on a locked rope and is hauled at 4 to 12 m/s."""
    x = _ropeway_tables(draw)
    travel = {"kind": "accelerate_cruise_brake", "top_speed": draw(4.0, 12.0)}
    x |= {"travel": travel, "drive": {"mode": "haul", "rolling_friction": draw(0.0, 0.02)}}
    return Scene(**x, name="hauled")


def free_rider(draw: Draw) -> Scene:
    """A rider on a thin rope, with a brake at 0.93 of the span.

    A stranded rope of diameter d [mm]: 0.0045 d^2 kg/m, 56 d^2 kN.
    """
    span = draw(60.0, 600.0)
    d = draw(10.0, 20.0)
    supports = {"span": span, "drop": span * draw(0.03, 0.12)}
    cable = {"mass_per_length": 0.0045 * d**2, "EA": 56e3 * d**2, "sag": span * draw(0.012, 0.03)}
    mass = {"mass": draw(40.0, 120.0)}
    drive: Tables = {"mode": "free", "rolling_friction": draw(0.005, 0.03), "drag_area": draw(0.3, 0.8)}
    drive["brake"] = [{"from": 0.93 * span, "force": draw(200.0, 600.0)}]
    x: Tables = {"cable": cable, "supports": supports, "mass": mass, "drive": drive}
    return Scene(**x, name="free")


def rider_on_fibre_rope(draw: Draw) -> Scene:
    """A heavy rider on a light fibre rope, 5 to 300 times as heavy as it.

    A braided rope of diameter d [mm]: 0.00075 d^2 kg/m, 4 to 25 d^2 kN.
    """
    span = draw(30.0, 200.0)
    d = draw(5.0, 14.0)
    supports = {"span": span, "drop": span * draw(0.03, 0.15)}
    length = math.hypot(span, supports["drop"]) * draw(1.01, 1.05)
    cable = {"mass_per_length": 0.00075 * d**2, "EA": draw(4e3, 25e3) * d**2, "length": length}
    mass = {"mass": draw(60.0, 150.0)}
    drive = {"mode": "free", "rolling_friction": draw(0.01, 0.04), "start": length * draw(0.05, 0.2)}
    x: Tables = {"cable": cable, "supports": supports, "mass": mass, "drive": drive}
    return Scene(**x, name="fibre")


def car_on_slack_rope(draw: Draw) -> Scene:
    """A car that grips a slack locked rope, at 0.05 to 0.2 of the wave speed."""
    x = _ropeway_tables(draw)
    cable = x["cable"]
    span = x["supports"]["span"]
    cable["sag"] = span * draw(0.06, 0.15)
    del cable["horizontal_tension"]
    H = 9.81 * cable["mass_per_length"] * span**2 / (8.0 * cable["sag"])
    x["mass"] = {"mass": H * draw(0.05, 0.3) / 9.81}
    x["travel"] = {"kind": "constant_speed", "speed": draw(0.05, 0.2) * math.sqrt(H / cable["mass_per_length"])}
    return Scene(**x, name="slack")


def hauled_car_on_steep_rope(draw: Draw) -> Scene:
    """A car that is hauled up or down 45 to 60 degrees."""
    x = _ropeway_tables(draw)
    supports = x["supports"]
    supports["drop"] = math.copysign(draw(1.0, 1.7), draw(-1.0, 1.0)) * supports["span"]
    x["travel"] = {"kind": "accelerate_cruise_brake", "top_speed": draw(3.0, 8.0)}
    x["drive"] = {"mode": "haul", "rolling_friction": draw(0.0, 0.05), "drag_area": draw(0.0, 15.0)}
    return Scene(**x, name="steep")


def car_on_iced_rope(draw: Draw) -> Scene:
    """A car that grips a damped locked rope with up to a third of its weight in ice."""
    x = _ropeway_tables(draw)
    cable = x["cable"]
    cable["ice"] = draw(0.02, 0.3) * cable["mass_per_length"]
    cable["damping"] = draw(0.002, 0.05)
    speed = draw(0.1, 0.4) * _transverse_wave_speed(x)
    x["travel"] = {"kind": "accelerate_cruise_brake", "top_speed": speed}
    return Scene(**x, name="iced")


def hauled_car_stopping(draw: Draw) -> Scene:
    """A hauled car that makes an emergency stop of 0.5 to 2 m/s2 at 0.2 to 0.7 of the distance."""
    x = _ropeway_tables(draw)
    speed = draw(4.0, 12.0)
    distance = math.hypot(x["supports"]["span"], x["supports"]["drop"])
    stop = {"time": draw(0.2, 0.7) * distance / speed, "deceleration": draw(0.5, 2.0)}
    x["travel"] = {"kind": "accelerate_cruise_brake", "top_speed": speed, "stop": stop}
    x["drive"] = {"mode": "haul", "rolling_friction": draw(0.0, 0.02)}
    return Scene(**x, name="stopped")


def rider_against_wind(draw: Draw) -> Scene:
    """A rider as in `free_rider`, damped and against the wind, 80 to 200 kg."""
    rider = free_rider(draw).variant(name="windy")
    changes = {"cable.damping": draw(0.001, 0.03), "mass.mass": draw(80.0, 200.0), "drive.wind": draw(-8.0, 4.0)}
    return rider.replace(changes)


def line_over_saddles(draw: Draw) -> Line:
    """A locked rope over one or two saddles with a car in the first span, and at times another in the last one.

    Cars grip or are hauled.  One end is an anchor, the other too or a counterweight.
    """
    cable = _ropeway_tables(draw)["cable"]
    T = cable.pop("horizontal_tension")
    points = [(0.0, 0.0)]
    slope = draw(-0.35, 0.25)
    for _ in range(2 + int(draw(0.0, 2.0))):
        span = draw(150.0, 500.0)
        x, y = points[-1]
        points.append((x + span, y + span * slope))
        slope += draw(0.0, 0.1)  # down: the saddle is a crest
    contacts: list[Tables] = []
    for i, point in enumerate(points):
        contacts.append({"name": f"contact{i}", "kind": "saddle", "at": point})
    for end in (contacts[0], contacts[-1]):
        end["kind"] = "anchor"
    if draw(0.0, 1.0) < 0.5:
        cable["tension"] = {"at": "contact0", "value": T}
    else:
        contacts[-1 if draw(0.0, 1.0) < 0.5 else 0] |= {"kind": "counterweight", "tension": T}
    contact_x = [point[0] for point in points]
    contact_s = [0.0]
    for a, b in itertools.pairwise(points):
        contact_s.append(contact_s[-1] + math.dist(a, b))
    cars = [_random_car_table(draw, "first", T, contact_x[:2], contact_s[:2])]
    if draw(0.0, 1.0) < 0.5:
        cars.append(_random_car_table(draw, "second", T, contact_x[-2:], contact_s[-2:]))
    tables: Tables = {"cable": cable, "contact": contacts, "car": cars}
    return Line(name="spans", **tables)


def _random_car_table(draw: Draw, name: str, rope_tension: float, x: list[float], s: list[float]) -> Tables:
    """A car that goes 0.3 to 0.6 of the way between two contacts, either way: in x if it is hauled, else in s.

    x, s : of both contacts, s along the chords.
    """
    hauled = draw(0.0, 1.0) < 0.5
    low, high = x if hauled else s
    shares = draw(0.15, 0.35), draw(0.65, 0.85)
    first, last = (low + share * (high - low) for share in shares)
    if draw(0.0, 1.0) >= 0.5:
        first, last = last, first
    acceleration = draw(0.3, 0.8)
    reached = math.sqrt(0.9 * acceleration * abs(last - first))
    travel = {"kind": "trapezoid", "top_speed": min(draw(3.0, 8.0), reached), "from": first, "to": last}
    travel |= {"acceleration": acceleration, "deceleration": acceleration}
    car: Tables = {"name": name, "mass": rope_tension * draw(0.02, 0.1) / 9.81, "travel": travel}
    if hauled:
        car["drive"] = {"mode": "haul", "rolling_friction": draw(0.0, 0.02)}
    return car


def moving_line_and_fault_key(seed: int, case_number: int) -> tuple[Line, str | None]:
    """A case of lines in motion, as `scene_and_fault_key`."""
    index = case_number if case_number < SOUND else case_number - SOUND
    rng = np.random.default_rng([seed, index])
    line = line_over_saddles(lambda low, high: float(rng.uniform(low, high)))
    if case_number < SOUND:
        return line, None
    weights = [f"contact.{c.name}.tension" for c in line.contact if c.kind == "counterweight"]
    keys = ["car.first.mass", "cable.EA", "cable.mass_per_length", "car.first.travel.top_speed"]
    keys.append(weights[0] if weights else "cable.tension.value")
    return line, keys[index % len(keys)]


Family = Callable[[Draw], Scene]
FAMILIES: tuple[Family, ...] = (gripped_car, hauled_car, free_rider)
SETS = {
    "ropeway": FAMILIES,
    "wide": (
        *FAMILIES,
        rider_on_fibre_rope,
        car_on_slack_rope,
        hauled_car_on_steep_rope,
        car_on_iced_rope,
        hauled_car_stopping,
        rider_against_wind,
    ),
}


def realistic_scene(seed: int, index: int, families: tuple[Family, ...]) -> Scene:
    """A random scene of the families in turn."""
    rng = np.random.default_rng([seed, index])
    return families[index % len(families)](lambda low, high: float(rng.uniform(low, high)))


SOUND = 60  # cases without a fault
FAULTS = ("mass.mass", "cable.EA", "cable.mass_per_length")  # and the speed of a travel


def scene_and_fault_key(seed: int, case_number: int, families_name: str = "ropeway") -> tuple[Scene | Line, str | None]:
    """The scene of a case of the study `power`, and the key that is 1 percent larger in the second solver.

    The first SOUND cases have no fault: None.
    families_name : a key of SETS, or "lines" in motion; "wide" has faults in friction, drag, brake and drop, too.
    """
    if families_name == "lines":
        return moving_line_and_fault_key(seed, case_number)
    families = SETS[families_name]
    if case_number < SOUND:
        return realistic_scene(seed, case_number, families), None
    index = case_number - SOUND
    scene = realistic_scene(seed, index, families)
    drive = scene.drive
    keys = list(FAULTS)
    if drive.mode != "free":
        keys.append("travel.top_speed" if "top_speed" in scene.to_toml() else "travel.speed")
    if families_name == "wide":
        wide: Tables = {"drive.rolling_friction": drive.rolling_friction, "drive.drag_area": drive.drag_area}
        wide |= {"drive.brake.0.force": drive.brake, "supports.drop": scene.supports.drop}
        keys += [key for key, value in wide.items() if value]
    return scene, keys[index // len(families) % len(keys)]
