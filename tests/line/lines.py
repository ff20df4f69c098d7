"""Lines of the tests, as a user writes them, and the equations of a rope at rest, integrated as they stand."""

import tomllib
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from cablefem.scene.line import Line, LineState


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


def changed(given: tuple, text: str) -> Line:
    """The line with the tables of a TOML text put in its rope."""
    rope, *parts = given
    return line({**rope, **tomllib.loads(text)}, *parts)


def defects(state: LineState) -> dict[str, float]:
    """What is missing from each law, lengths over the reach and forces over the largest tension.

    Between stations r' = a (1 + N/EA) t with n = N t falling by q is integrated by an explicit Runge-Kutta rule.
    """
    case, n = state.case, len(state.s)
    T, reach = float(np.nanmax(state.tensions)), float(np.ptp(state.place[:, 0]))
    found = {"rope": 0.0, "weight": 0.0, "saddle": 0.0, "counterweight": 0.0, "spring": 0.0, "car": 0.0}

    def note(law: str, defect: Any) -> None:
        found[law] = max(found[law], float(np.max(np.abs(defect))))

    for k in range(n - 1):
        pull = state.ahead[k]

        def slope(s: float, _: Any, pull=pull) -> Any:
            here = pull - [0.0, case.weight * s]
            return case.heat * (1.0 / np.linalg.norm(here) + 1.0 / case.EA) * here

        S = state.s[k + 1] - state.s[k]
        end = solve_ivp(slope, (0.0, S), state.place[k], "DOP853", rtol=1e-12, atol=1e-10).y[:, -1]
        note("rope", (end - state.place[k + 1]) / reach)
        note("weight", (state.behind[k + 1] - pull + [0.0, case.weight * S]) / T)
    for k, p in enumerate(case.stations):
        ahead, behind = np.nan_to_num(state.ahead[k]), np.nan_to_num(state.behind[k])
        jump, N = ahead - behind, [np.linalg.norm(x) for x in (behind, ahead)]
        if p.kind == "saddle":
            note("saddle", (N[1] - N[0]) / T)
        elif p.kind == "counterweight":
            note("counterweight", (max(N) - p.force) / T)
        elif p.kind == "spring":
            note("spring", (jump - np.array(p.stiffness) * (state.place[k] - [p.x, p.y])) / T)
        elif p.is_car:
            tau = (ahead + behind) / np.linalg.norm(ahead + behind)
            F = state.haul[k] if p.kind == "hauled" else 0.0
            note("car", (jump + [0.0, p.force] + F * tau) / T)
            if p.kind == "hauled":
                note("car", (N[1] - N[0]) / T)
    return found
