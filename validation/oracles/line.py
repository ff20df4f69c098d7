"""A line at rest over anchors, springs, saddles and a counterweight, with cars: numbers known beforehand.

s counts from the left end of the empty line.  Errors: over the reach, forces over the largest tension.

Source: Irvine (1981) in closed form; tests of SEILAPLAN; Code_Aster V6.02.100
Validity: frictionless saddles, statics
Accuracy: the digits of the numbers, 1e-9; 1.2 percent of SEILAPLAN's tensions, 6e-4 of Code_Aster's sag
Group: A line at rest
"""

import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from cablefem.scene.line import Line, LineRest, LineState, NoLineAtRest
from validation.oracles.case import Case, Rung, Solvers

METHODS = ("catenaries", "elements")
DIGITS = 3e-9  # of the numbers

THREE = """
    cable = {mass_per_length = 9.0, EA = 1.4e8, length = 1024.5}
    contact = [{name = "left", kind = "anchor", at = [0, 0]}, {name = "first", kind = "saddle", at = [400, -30]},
        {name = "second", kind = "saddle", at = [820, -20]}, {name = "right", kind = "anchor", at = [1020, 20]}]
    car = [{name = "grip", mass = 4000, hauled = false, at = 180.494286},
        {name = "hauled", mass = 4000, hauled = true, at = 618.612609}]
"""
WEIGHED = """
    cable = {mass_per_length = 9.0, EA = 1.5e8}
    contact = [{name = "left", kind = "anchor", at = [0, 0]},
        {name = "weight", kind = "counterweight", at = [600, -150], tension = 5e5}]
    car = [{name = "grip", mass = 5000, hauled = false, at = 247.812647}]
"""
TRAMWAY = """
    cable = {mass_per_length = 11.4, EA = 2.1e8}
    contact = [{name = "weight", kind = "counterweight", at = [0, 0], tension = 3.8e5},
        {name = "right", kind = "anchor", at = [1200, -480]}]
    car = [{name = "car", mass = 6000, hauled = true, at = 640.052271}]
"""
ASTER = """
    gravity = 10.0
    cable = {mass_per_length = 3.0, EA = 5e7, length = 220.0}
    contact = [{name = "left", kind = "anchor", at = [0, 0]}, {name = "one", kind = "saddle", at = [100, 0]},
        {name = "two", kind = "saddle", at = [200, 0]}, {name = "right", kind = "anchor", at = [210, 0]}]
"""
# by station and quantity, of the lines above
NUMBERS = """
[three]
"left ahead" = 395166.3080
"grip s" = 180.0
"grip y" = 0.737332
"grip behind" = 395101.3921
"grip ahead" = 397670.5028
"first s" = 401.039137
"first behind" = 400376.5890
"first ahead" = 400376.5890
"hauled s" = 620.0
"hauled y" = -9.579431
"hauled haul" = -775.88172
"second s" = 821.100312
"second ahead" = 399496.2040
"right behind" = 395974.6087
[weighed]
"weight s" = 618.284099
"left ahead" = 475797.4438
"grip y" = -38.424243
"grip behind" = 479179.1553
"grip ahead" = 490181.3837
[tramway]  # the empty rope is 1295.985263 m long; -s of the weight is the rope taken in
"weight s" = -10.817098
"car y" = -148.607581
"car ahead" = 396588.7073
"car haul" = 22261.47088
"right behind" = 433576.5376
"""
Numbers = Sequence[dict[str, float]]  # one table for each position of the cars


def _carriage_tension_tables(*tensions: float) -> Numbers:
    """Tensions with the load in each field."""
    return [{"carriage ahead": tension} for tension in tensions]


@dataclass(frozen=True, slots=True, kw_only=True)
class AtRest(Case):
    line: Line
    numbers: Numbers
    digits: float = DIGITS
    methods: tuple[str, ...] | None = METHODS

    def ladder(self, solvers: Solvers, method: str) -> list[Rung]:
        if method == "elements":
            return [Rung({"elements": n}, n) for n in (2, 4)]
        return [Rung({"extra_newton_steps": n}, n + 1) for n in (0, 1)]

    def compute_answer(self, solvers: Solvers, method: str, rung: Rung) -> LineRest:
        return solvers.line_at_rest(self.line, method, **rung.settings)

    def relative_distance(self, coarse: LineRest, fine: LineRest) -> float:
        gaps = self.relative_errors(coarse) - self.relative_errors(fine)
        return self.digits + float(np.abs(gaps).max())

    def relative_errors(self, answer: LineRest) -> np.ndarray:
        errors = []
        for state, numbers in zip(answer.positions, self.numbers, strict=True):
            if isinstance(state, NoLineAtRest):  # each of these lines has one
                raise state
            errors += [_relative_error(state, name, exact) for name, exact in numbers.items()]
        return np.array(errors)


def _relative_error(state: LineState, name: str, exact: float) -> float:
    """Error of a number, over the reach or the largest tension; name : its station and quantity."""
    station, quantity = name.split()
    k = state.station_index(station)
    lengths = {"s": state.s, "y": state.points[:, 1], "middle": np.append(state.middle[:, 1], np.nan)}
    if quantity in lengths:
        reach = np.ptp(state.points[:, 0])
        return float((lengths[quantity][k] - exact) / reach)
    behind, ahead = state.station_tensions.T
    forces = {"behind": behind, "ahead": ahead, "haul": state.haul}
    return float((forces[quantity][k] - exact) / np.nanmax(state.station_tensions))


def cases() -> Iterator[Case]:
    """Comparisons with the solvers, wrong ones among them."""
    numbers = tomllib.loads(NUMBERS)
    three = Line.from_toml(THREE)
    in_three = numbers["three"]
    yield AtRest(name="three spans, a gripping and a hauled car", line=three, numbers=[in_three])
    weighed = Line.from_toml(WEIGHED)
    in_weighed = numbers["weighed"]
    yield AtRest(name="counterweight 150 m up, a gripping car", line=weighed, numbers=[in_weighed])
    tramway = Line.from_toml(TRAMWAY)
    in_tramway = numbers["tramway"]
    yield AtRest(name="tramway of one span, counterweight, a hauled car", line=tramway, numbers=[in_tramway])

    skyline = Line.load("skyline")
    ours = _carriage_tension_tables(110438.79, 119370.18, 132122.47, 122143.86, 107195.94, 84077.84)
    yield AtRest(name="skyline, load in each field", line=skyline, digits=1e-7, numbers=ours)
    theirs = _carriage_tension_tables(109.9e3, 119.6e3, 131.1e3, 121.5e3, 106.0e3, 83.5e3)
    yield AtRest(name="skyline, as SEILAPLAN prints it", line=skyline, digits=0.012, numbers=theirs)
    aster = Line.from_toml(ASTER)
    sag = {"left middle": 13.930, "one middle": 13.930}
    yield AtRest(name="rope over two pulleys, as Code_Aster prints it", line=aster, digits=6e-4, numbers=[sag])

    wrong = partial(AtRest, expected="disagree")
    unequal = in_three | {"first ahead": 404380.0}
    yield wrong(name="a saddle with tensions 1 percent apart", line=three, numbers=[unequal])
    falling = in_tramway | {"weight s": 10.817098}
    yield wrong(name="a counterweight that falls where it must rise", line=tramway, numbers=[falling])
    forgotten = weighed.replace({"contact.weight.tension": 5e5 - 150.0 * 9.0 * 9.81})
    yield wrong(name="weight of the rope forgotten at the pulley", line=forgotten, numbers=[in_weighed])
