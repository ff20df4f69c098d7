"""Cases in which solvers are compared with exact answers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.polynomial.chebyshev import chebint, chebpts2, chebvander
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from cablefem.scene import Cable, ConstantAcceleration, Groups, Mass, Motion, Scene, Supports

Array = NDArray[np.float64]

WINDOW = (0.02, 0.8)  # s_o/l in which paths are compared
BEST = ("following-p2", "fourier-kink")
RIDERS = BEST  # methods with cars that roll


@dataclass(frozen=True, slots=True, kw_only=True)
class Oracle:
    title: str
    source: str = ""
    validity: str = ""
    group: str = ""  # heading in tables
    cases: Callable[[], Iterable[Case]] = tuple


def refuse_unless(domain: str, *conditions: Any) -> None:
    """Refuse arguments outside the validity."""
    if not all(map(np.all, conditions)):
        raise ValueError(f"needed: {domain}")


def chebyshev_points_and_integrals(degree: int) -> tuple[Array, Array]:
    """Chebyshev points on [-1, 1], and the matrix from values there to integrals from -1 to each of them."""
    x = chebpts2(degree + 1)
    coefficients: Any = np.linalg.inv(chebvander(x, degree))
    integrals: Any = chebvander(x, degree + 1) @ chebint(coefficients, lbnd=-1.0)
    return x, integrals


@dataclass(frozen=True, slots=True)
class Rung:
    """Settings of one run, and the size whose powers errors follow."""

    settings: dict[str, Any]
    size: float


@dataclass(frozen=True, slots=True)
class Path:
    """v of the load over time; nan where the run broke."""

    t: Array
    s_o: Array
    v: Array


Solvers = Any  # what a case asks of the solvers: `validation.commands.oracles.study`
Defect = Callable[[Solvers, str, dict[str, Any]], Any]  # of solvers, method and settings


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A comparison, how fast its errors must fall, and the expected verdict."""

    name: str
    because: str = ""
    methods: tuple[str, ...] | None = BEST  # None: all
    expected: str = "agree"
    finer: float = 1.0  # resolution, for light masses
    order: float | None = None  # least order, or power of the parameter
    refined: str = "resolution"  # or the parameter of a limit

    def ladder(self, solvers: Solvers, method: str) -> list[Rung]:
        return solvers.rungs(method, finer=self.finer)

    def expected_order(self, solvers: Solvers, method: str) -> tuple[float | None, str]:
        return self.order, self.because

    def expected_verdict(self, solvers: Solvers, method: str) -> str:
        return self.expected

    def compute_answer(self, solvers: Solvers, method: str, rung: Rung) -> Any:
        raise NotImplementedError

    def relative_errors(self, answer: Any) -> Any:
        """Relative errors of an answer, in any shape; by default the answer itself."""
        return answer

    def largest_and_rms_error(self, answer: Any) -> tuple[float, float]:
        """The largest and the rms error."""
        off = np.abs(self.relative_errors(answer))
        return float(off.max()), float(np.sqrt(np.mean(off**2)))

    def relative_distance(self, coarse: Any, fine: Any) -> float | None:
        """Rms distance of two answers, the finer one's error bar."""
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossing(Case):
    groups: Groups
    exact: Callable[[Array], Array]  # v(t) of the load
    load: str = "mass"
    model: str = "straight"  # a string without sag, or a model of the solvers
    scene: str = ""  # built-in scene, instead
    start_position: float = 0.0  # s_o at t = 0; no echo before `until`
    until: float = WINDOW[1]
    max_order: float = math.inf  # limit of all orders
    orders: Mapping[str, float] = field(default_factory=dict)  # exceptions, by method

    @property
    def run_arguments(self) -> dict[str, Any]:
        on_cable = self.start_position > 0.0
        return {"model": self.model, "load": self.load, "until": self.until, "starts_on_cable": on_cable}

    def expected_order(self, solvers: Solvers, method: str) -> tuple[float | None, str]:
        p, because = solvers.theoretical_order(method)
        if p is not None:
            p = self.orders.get(method, min(p, self.max_order))
        return p, self.because or because

    def expected_verdict(self, solvers: Solvers, method: str) -> str:
        return "disagree" if solvers.theoretical_order(method)[0] is None else self.expected

    def compute_answer(self, solvers: Solvers, method: str, rung: Rung) -> Path:
        return solvers.mass_path(self, method, **rung.settings)

    @property
    def largest_exact_displacement(self) -> float:
        motion = self.groups.motion
        assert motion is not None
        t = np.linspace(0.0, motion.end_time, 2001)
        t = t[motion.position(t) <= self.until]
        return float(np.abs(self.exact(t)).max())

    def relative_errors(self, answer: Path) -> Array:
        return self._relative_displacement_errors(answer, self.exact)

    def relative_distance(self, coarse: Path, fine: Path) -> float:
        if fine.t.size < 5 or not (np.isfinite(fine.v).all() and np.isfinite(coarse.v).all()):
            return math.nan
        distance = self._relative_displacement_errors(coarse, CubicSpline(fine.t, fine.v))
        return float(np.sqrt(np.mean(distance**2)))

    def _relative_displacement_errors(self, path: Path, exact: Callable[[Array], Array]) -> Array:
        inside = (path.s_o >= max(WINDOW[0], self.start_position)) & (path.s_o <= self.until)
        error = path.v[inside] - exact(path.t[inside])
        return error / self.largest_exact_displacement


@dataclass(frozen=True, slots=True, kw_only=True)
class Modes(Case):
    groups: Groups
    model: str
    exact: Array
    methods: tuple[str, ...] | None = ("P2 elements", "sines", "wavelets")

    def expected_order(self, solvers: Solvers, method: str) -> tuple[float | None, str]:
        return solvers.theoretical_order(method) if self.order is None else (self.order, self.because)

    def compute_answer(self, solvers: Solvers, method: str, rung: Rung) -> Array:
        solve = solvers.damped_frequencies if self.groups.damping else solvers.frequencies
        return solve(method, self.groups, self.model, self.exact.size, **rung.settings)

    def relative_errors(self, answer: Array) -> Any:
        return np.abs(answer / self.exact - 1.0).max()

    def relative_distance(self, coarse: Array, fine: Array) -> float:
        return float(np.abs(coarse / fine - 1.0).max()) + 1e-10  # rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class Law(Case):
    """A law of all runs."""

    defect: Defect  # of runs with these settings

    def compute_answer(self, solvers: Solvers, method: str, rung: Rung) -> Any:
        return self.defect(solvers, method, rung.settings)


def defect_of_ride(scene: Scene, defect: Callable[[Any], Any]) -> Defect:
    """A defect of the response to a scene, as `Law` takes it."""
    return lambda solvers, method, settings: defect(solvers.run_scene(scene, method, **settings))


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit(Case):
    """A limit of the equations: the deviation falls with a parameter."""

    values: tuple[float, ...]
    deviation: Callable[[Solvers, str, float], Any]

    def ladder(self, solvers: Solvers, method: str) -> list[Rung]:
        rising = self.values[-1] > self.values[0]
        return [Rung({self.refined: x}, x if rising else 1.0 / x) for x in self.values]

    def compute_answer(self, solvers: Solvers, method: str, rung: Rung) -> Any:
        return self.deviation(solvers, method, rung.settings[self.refined])


# --- cables and travels; all numbers differ, so that no factor can hide

MU = 0.7
SIGMA = 0.31
BARE = Groups(mu=0.0, alpha=844.416, sigma=0.1688832, c=0.0844416, chord_cos=1.0, chord_sin=0.0, motion=None)


def level_string_groups(motion: Motion, mu: float = MU, sigma: float = SIGMA) -> Groups:
    """A level cable that is almost a taut string: c = sigma/2."""
    return Groups(mu=mu, alpha=323.0, sigma=sigma, c=0.5 * sigma, chord_cos=1.0, chord_sin=0.0, motion=motion)


def scene_in_units_of_cable(
    gravity: float, EA: float, mass: float, drive: Any, travel: Any = None, *,
    span: float = 1.0, drop: float = 0.0, **length_or_tension: float,
) -> Scene:  # fmt: skip
    """Scene with rho = 1; length_or_tension : `length` or another key of [cable], H = 1 without it."""
    hangs_by = length_or_tension or {"horizontal_tension": 1.0}
    supports = Supports(span=span, drop=drop)
    cable = Cable(mass_per_length=1.0, EA=EA, **hangs_by)
    return Scene(gravity=gravity, cable=cable, supports=supports, mass=Mass(mass=mass), travel=travel, drive=drive)


def travel_from_inside_string(s_o: float, V: float, a: float) -> Motion:
    """Travel from inside the string to its end."""
    return ConstantAcceleration(acceleration=a, initial_speed=V).motion(1.0 - s_o, s_o)
