"""A line at rest over anchors, springs, saddles and a counterweight, with cars: numbers known beforehand.

s counts from the left end of the empty line.  Errors: over the reach, forces over the largest tension.

Source: Irvine (1981) in closed form; tests of SEILAPLAN; Code_Aster V6.02.100
Validity: frictionless saddles, statics
Accuracy: the digits of the numbers, 1e-9; 1.2 percent of SEILAPLAN's tensions, 6e-4 of Code_Aster's sag
Group: A line at rest
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cablefem.scene.line import Line, LineRest
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
Told = tuple[int, str, str, float]  # position, station, quantity, value


def _three(ahead: float = 400376.5890) -> list[Told]:
    return [
        (0, "left", "ahead", 395166.3080), (0, "grip", "s", 180.0), (0, "grip", "y", 0.737332),
        (0, "grip", "behind", 395101.3921), (0, "grip", "ahead", 397670.5028), (0, "first", "s", 401.039137),
        (0, "first", "behind", 400376.5890), (0, "first", "ahead", ahead), (0, "hauled", "s", 620.0),
        (0, "hauled", "y", -9.579431), (0, "hauled", "haul", -775.88172), (0, "second", "s", 821.100312),
        (0, "second", "ahead", 399496.2040), (0, "right", "behind", 395974.6087),
    ]  # fmt: skip


def _weighed() -> list[Told]:
    return [
        (0, "weight", "s", 618.284099), (0, "left", "ahead", 475797.4438), (0, "grip", "y", -38.424243),
        (0, "grip", "behind", 479179.1553), (0, "grip", "ahead", 490181.3837),
    ]  # fmt: skip


def _skyline(*tensions: float) -> list[Told]:
    """Tensions with the load in each field."""
    return [(i, "carriage", "ahead", tension) for i, tension in enumerate(tensions)]


def _tramway(sign: float = 1.0) -> list[Told]:
    """The empty rope is 1295.985263 m long; -s of the weight is the rope taken in."""
    return [
        (0, "weight", "s", -sign * 10.817098), (0, "car", "y", -148.607581), (0, "car", "ahead", 396588.7073),
        (0, "car", "haul", 22261.47088), (0, "right", "behind", 433576.5376),
    ]  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class AtRest(Case):
    line: Line
    told: Sequence[Told]
    digits: float = DIGITS
    methods: tuple[str, ...] | None = METHODS

    def ladder(self, solvers: Solvers, method: str) -> list[Rung]:
        if method == "elements":
            return [Rung({"elements": n}, n) for n in (2, 4)]
        return [Rung({"more": n}, n + 1) for n in (0, 1)]

    def ask(self, solvers: Solvers, method: str, rung: Rung) -> LineRest:
        return solvers.line(self.line, method, **rung.settings)

    def off(self, answer: LineRest) -> Any:
        return self._errors(answer)

    def gap(self, coarse: LineRest, fine: LineRest) -> float:
        return self.digits + float(np.abs(self._errors(coarse) - self._errors(fine)).max())

    def _errors(self, answer: LineRest) -> np.ndarray:
        found = []
        for i, name, what, value in self.told:
            state: Any = answer.positions[i]
            k = [p.name for p in state.case.stations].index(name)
            lengths = {
                "s": state.s[k],
                "y": state.place[k, 1],
                "middle": state.middle[min(k, len(state.middle) - 1), 1],
            }
            forces = {"behind": state.tensions[k, 0], "ahead": state.tensions[k, 1], "haul": state.haul[k]}
            scale = np.ptp(state.place[:, 0]) if what in lengths else np.nanmax(state.tensions)
            found.append(({**lengths, **forces}[what] - value) / scale)
        return np.array(found)


def cases() -> list[Case]:
    three, weighed, tramway, aster = (Line.from_toml(text) for text in (THREE, WEIGHED, TRAMWAY, ASTER))
    skyline = Line.load("skyline")
    forgotten = weighed.replace({"contact.weight.tension": 5e5 - 150.0 * 9.0 * 9.81})
    return [
        AtRest(name="three spans, a gripping and a hauled car", line=three, told=_three()),
        AtRest(name="counterweight 150 m up, a gripping car", line=weighed, told=_weighed()),
        AtRest(name="tramway of one span, counterweight, a hauled car", line=tramway, told=_tramway()),
        AtRest(name="skyline, load in each field", line=skyline, digits=1e-7,
               told=_skyline(110438.79, 119370.18, 132122.47, 122143.86, 107195.94, 84077.84)),
        AtRest(name="skyline, as SEILAPLAN prints it", line=skyline, digits=0.012,
               told=_skyline(109.9e3, 119.6e3, 131.1e3, 121.5e3, 106.0e3, 83.5e3)),
        AtRest(name="rope over two pulleys, as Code_Aster prints it", line=aster, digits=6e-4,
               told=[(0, "left", "middle", 13.930), (0, "one", "middle", 13.930)]),
        AtRest(name="a saddle with tensions 1 percent apart", line=three, told=_three(404380.0), expected="disagree"),
        AtRest(name="a counterweight that falls where it must rise", line=tramway, told=_tramway(-1.0),
               expected="disagree"),
        AtRest(name="weight of the rope forgotten at the pulley", line=forgotten, told=_weighed(), expected="disagree"),
    ]  # fmt: skip
