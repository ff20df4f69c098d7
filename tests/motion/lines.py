"""Lines in motion of the tests, and how they are run."""

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np

from cablefem.motion import LineMotion
from cablefem.newmark import Newton, State, System, integrate, integrate_blocks, scheme, step_times_by_phase
from cablefem.scene.contacts import Car, Contact, Elastic, MovingLine
from cablefem.scene.drive import Drive
from cablefem.scene.motion import rest_motion
from validation.commands.check.motion import law_rows


@dataclass(frozen=True)
class Smooth:
    """From rest at `begin` to `speed` within `ramp`, v = speed S(t/ramp), S = x^3 (10 - 15 x + 6 x^2)."""

    begin: float
    speed: float
    ramp: float = 8.0
    end: float = 1e3

    @property
    def phases(self) -> tuple[tuple[float, float], ...]:
        return (0.0, self.ramp), (self.ramp, self.end)

    def position_with_rates(self, t: float, phase: int) -> tuple[float, float, float]:
        x = 1.0 if phase else t / self.ramp
        way = self.ramp * (2.5 * x**4 - 3.0 * x**5 + x**6) + (t - self.ramp if phase else 0.0)
        share = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        return self.begin + self.speed * way, self.speed * share, self.speed * 30.0 * (x * (1.0 - x)) ** 2 / self.ramp

    def positions_with_rates(self, t: np.ndarray, phase: int) -> np.ndarray:
        return np.array(np.broadcast_arrays(*self.position_with_rates(t, phase)))


def anchor(name: str, x: float, y: float) -> Contact:
    return Contact(name=name, kind="anchor", point=(x, y))


def saddle(name: str, x: float, y: float) -> Contact:
    return Contact(name=name, kind="saddle", point=(x, y))


def weight(x: float, y: float, force: float) -> Contact:
    return Contact(name="weight", kind="counterweight", point=(x, y), force=force)


def spring(x: float, y: float) -> Contact:
    return Contact(name="spring", kind="spring", point=(x, y), stiffness=(2e6, 5e6))


def car(name: str, mass: float, travel: Any, mode: str = "grip", along: Any = "s", **drive: Any) -> Car:
    """A car with a travel, or standing at a number."""
    travel = rest_motion(travel, 1e3) if isinstance(travel, float) else travel
    return Car(name=name, mass=mass, travel=travel, drive=Drive(mode=mode, **drive), along=along)


def line(rope: dict[str, float], *contacts: Any, t_end: float = 10.0, gravity: float = 9.81) -> MovingLine:
    return MovingLine(rope=Elastic(**rope), contacts=contacts, t_end=t_end, gravity=gravity)


ROPE = {"mass_per_length": 9.0, "EA": 1.5e8}
LEFT, RIGHT = anchor("left", 0.0, 0.0), weight(600.0, -150.0, 5e5)
WEIGHED = line(ROPE, LEFT, car("grip", 5000.0, 250.0), RIGHT)
SPRUNG = line(ROPE, spring(0.0, 0.0), car("grip", 5000.0, 250.0), RIGHT)
THREE = line(
    {"mass_per_length": 9.0, "EA": 1.4e8, "length": 1024.5}, LEFT, car("grip", 4000.0, 180.0),
    saddle("first", 400.0, -30.0), car("hauled", 4000.0, 620.0, "haul"), saddle("second", 820.0, -20.0),
    anchor("right", 1020.0, 20.0),
)  # fmt: skip
TRAMWAY = {"mass_per_length": 11.4, "EA": 2.1e8, "length": 1300.0}
BESIDE_TRAMWAY = weight(0.0, 0.0, 3.8e5), anchor("right", 1200.0, -480.0)
ALONG_S = line(TRAMWAY, BESIDE_TRAMWAY[0], car("car", 6000.0, 650.0, "haul"), BESIDE_TRAMWAY[1])
IN_X = line(TRAMWAY, BESIDE_TRAMWAY[0], car("car", 6000.0, 640.052271, "haul", "x"), BESIDE_TRAMWAY[1])
# damped: a saddle over which rope runs, a spring, a counterweight, and cars driven in three manners
ALL = line(
    {"mass_per_length": 9.0, "EA": 1.5e8, "damping": 0.3}, spring(0.0, 0.0), car("up", 3000.0, Smooth(100.0, 6.0)),
    saddle("tower", 500.0, -90.0), car("down", 2500.0, Smooth(880.0, -5.0), "haul", mu_r=0.01, k=0.5),
    car("next", 2000.0, Smooth(930.0, -3.0), "haul", "x", k=0.4, wind=3.0), weight(1100.0, -150.0, 4e5), t_end=14.0,
)  # fmt: skip


def states_by_radau(system: System, steps: int, start: State | None = None) -> list[State]:
    """All states by Radau, to the end."""
    times = step_times_by_phase(system, steps)
    times[-1] = np.append(times[-1], system.phases[-1][1])
    return list(itertools.chain.from_iterable(integrate_blocks(system, scheme("radau"), times, start=start)))


def last_of_equal_steps(system: System, start: State, dt: float, count: int) -> State:
    """The state after so many exact steps by Radau."""
    times: Any = {start.phase: start.t + dt * np.arange(count + 1)}
    states = integrate(system, scheme("radau"), times, newton=Newton(tol=1e-9), start=start)
    return list(itertools.islice(states, count))[-1]


def run_and_observe(system: Any, steps: int, s: Any = (0.0,)) -> LineMotion:
    return system.observe(states_by_radau(system, steps), np.asarray(s, dtype=float))


# A car on two wheels and one with a cabin, both in motion.
BODIES = """
[cable]
mass_per_length = 6.0
EA = 9e7
length = 402.0
[[contact]]
name = "left"
kind = "anchor"
at = [0.0, 0.0]
[[contact]]
name = "right"
kind = "anchor"
at = [400.0, -20.0]
[[car]]
name = "sled"
mass = 500.0
wheels = {base = 2.0, inertia = 400.0, below = 0.5}
[car.drive]
mode = "free"
start = 60.0
drag_area = 0.5
thrust = {times = [0.0, 9.0], forces = [5e3, 5e3], angle = 5.0}
brake = [{from = 61.0, force = 1e3, wheel = "rear"}]
end = {time = 2.0}
[[car]]
name = "cabin"
mass = 900.0
hanger = {mass = 700.0, length = 3.0, gyration = 1.0, damping = 0.05}
drive = {mode = "haul"}
travel = {kind = "trapezoid", top_speed = 3.0, acceleration = 3.0, deceleration = 3.0, from = 300.0, to = 303.0}
"""
# A car that runs over a tower.
OVER = """
[cable]
mass_per_length = 6.0
EA = 9e7
length = 300.8
[[contact]]
name = "left"
kind = "anchor"
at = [0.0, 0.0]
[[contact]]
name = "tower"
kind = "saddle"
at = [150.0, -12.0]
shoe = 5.0
[[contact]]
name = "right"
kind = "anchor"
at = [300.0, 0.0]
[[car]]
name = "car"
mass = 1200.0
drive = {mode = "haul", drag_area = 2.0}
travel = {kind = "trapezoid", top_speed = 6.0, acceleration = 3.0, deceleration = 3.0, from = 130.0, to = 170.0}
"""


def broken_laws(line_toml, ladder):
    """Names of the laws that the runs do not keep on a line."""
    rows = law_rows(line_toml, [ladder], ladder.finest.end_time)
    return {row.law.rpartition(",")[0] for row in rows if row.verdict.value == "disagree"}
