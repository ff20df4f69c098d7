"""What an exact answer says of itself, and the cases in which solvers are held against it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from cablefem.scene import Cable, Groups, Mass, Scene, Supports
from cablefem.scene.line import Line, LineRest
from cablefem.scene.motion import Motion, Piece

Array = NDArray[np.float64]
Error = tuple[float, float]  # the largest and the rms one, relative

WINDOW = (0.02, 0.8)  # s_o/l in which paths are compared
BEST = ("following-p2", "fourier-kink")  # one method of each wing
RIDERS = BEST  # methods whose cars roll


@dataclass(frozen=True, slots=True, kw_only=True)
class Oracle:
    """One exact answer, named as its file."""

    title: str
    source: str = ""
    validity: str = ""
    group: str = ""  # heading under which tables list it
    unreached: str = ""  # why no solver can be held against it
    cases: Callable[[], Sequence[Case]] = tuple  # made when asked for


def positive(**numbers: float) -> None:
    """Raise ValueError unless all are finite and > 0."""
    for name, value in numbers.items():
        if not (math.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} must be finite and > 0, got {value!r}")


def largest_and_rms(error: Array) -> Error:
    """Return the largest and the rms value of an error (n,)."""
    return float(np.abs(error).max()), float(np.sqrt(np.mean(error**2)))


@dataclass(frozen=True, slots=True)
class Rung:
    """Settings of one run, and the count that its errors fall with."""

    settings: dict[str, Any]
    size: float


@dataclass(frozen=True, slots=True)
class Path:
    """v of the load over time; nan where the run broke."""

    t: Array
    s_o: Array
    v: Array


class Solvers(Protocol):
    """What a case may ask for; the caller brings it along."""

    def names(self, kind: str) -> Sequence[str]:
        """Return all methods (kind "path") or all bases of frequencies ("modes")."""

    def order(self, name: str) -> tuple[float | None, str]:
        """Return the order of the path of a mass with that method, None where it is wrong, and why."""

    def ladder(self, name: str, *, finer: float = 1.0) -> list[Rung]:
        """Return its settings from coarse to fine, steps in balance with the resolution."""

    def path(self, crossing: Crossing, name: str, **settings: Any) -> Path:
        """Run a crossing; dimensionless."""

    def modes(self, name: str, groups: Groups, model: str, count: int, **settings: Any) -> Array:
        """Return the first frequencies of the bare cable."""

    def response(self, scene: str, name: str, **settings: Any) -> Any:
        """Run a built-in scene up to the end of the window; SI."""

    def ride(self, scene: Scene, name: str, **settings: Any) -> Any:
        """Run a scene to its end; SI."""

    def hold(self, groups: Groups, name: str, start: float, **settings: Any) -> float:
        """Return the force along the cable that holds a car of free travel at its start, over H."""

    def line(self, line: Line, name: str, **settings: Any) -> LineRest:
        """Solve a line at rest, by catenaries or by elements."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """What is moving on what; how fast errors must fall, and why; the verdict that it must have."""

    name: str
    because: str = ""
    methods: tuple[str, ...] | None = BEST  # None: every one
    expected: str = "agree"
    finer: float = 1.0  # a light mass moves in a layer as short as its mass ratio: ladders begin so much finer
    falls: float | None = None  # with this order, or power of the parameter (of its inverse where values fall)

    kind = "path"
    refined = "resolution"

    def of(self, solvers: Solvers) -> Sequence[str]:
        """Return the methods to be held against it."""
        return solvers.names(self.kind) if self.methods is None else self.methods

    def ladder(self, solvers: Solvers, method: str) -> list[Rung]:
        return solvers.ladder(method, finer=self.finer)

    def order(self, solvers: Solvers, method: str) -> tuple[float | None, str]:
        """Return the least order with which errors must fall, None where none is asked for, and why."""
        return self.falls, self.because

    def must(self, solvers: Solvers, method: str) -> str:
        return self.expected

    def ask(self, solvers: Solvers, method: str, rung: Rung) -> Any:
        """Run the solver."""
        raise NotImplementedError

    def error(self, answer: Any) -> Error:
        """Return the distance of a solver's answer from the exact one."""
        raise NotImplementedError

    def gap(self, coarse: Any, fine: Any) -> float | None:
        """Return the rms distance of two answers, for the finer one's bar; None where every rung is a new question."""
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossing(Case):
    """Something moving over a cable, and its exact path."""

    groups: Groups
    travel: Callable[[Array], Array]  # xi(t) of the exact answer; a test holds it against the solver's
    exact: Callable[[Array], Array]  # v of the load at times t
    load: str = "mass"
    model: str = "straight"  # a string without sag, or one of the solvers' models
    scene: str = ""  # run this one through scene, run and response instead
    begins: float = 0.0  # s_o at t = 0; the string rests then, and no wave has come back before `until`
    until: float = WINDOW[1]
    at_most: float = math.inf  # no higher order for any method
    orders: Mapping[str, float] = field(default_factory=dict)  # where that is not the whole truth

    @property
    def window(self) -> tuple[float, float]:
        return max(WINDOW[0], self.begins), self.until

    @property
    def motion(self) -> Motion:
        assert self.groups.motion is not None
        return self.groups.motion

    @property
    def how(self) -> dict[str, Any]:
        return {"model": self.model, "load": self.load, "until": self.until, "begun": self.begins > 0.0}

    def order(self, solvers: Solvers, method: str) -> tuple[float | None, str]:
        p, because = solvers.order(method)
        return (p if p is None else self.orders.get(method, min(p, self.at_most))), self.because or because

    def must(self, solvers: Solvers, method: str) -> str:
        return "disagree" if solvers.order(method)[0] is None else self.expected

    def ask(self, solvers: Solvers, method: str, rung: Rung) -> Path:
        return solvers.path(self, method, **rung.settings)

    @property
    def size(self) -> float:
        """The largest exact deflection in the window."""
        t = np.linspace(0.0, self.motion.phases[-1][1], 2001)
        return float(np.abs(self.exact(t[self.motion.position(t) <= self.until])).max())

    def error(self, answer: Path) -> Error:
        return self._distance(answer, self.exact)

    def gap(self, coarse: Path, fine: Path) -> float:
        if fine.t.size < 5 or not (np.isfinite(fine.v).all() and np.isfinite(coarse.v).all()):
            return math.nan
        return self._distance(coarse, CubicSpline(fine.t, fine.v))[1]

    def _distance(self, path: Path, v: Callable[[Array], Array]) -> Error:
        inside = (path.s_o >= self.window[0]) & (path.s_o <= self.window[1])
        return largest_and_rms((path.v[inside] - v(path.t[inside])) / self.size)


@dataclass(frozen=True, slots=True, kw_only=True)
class Modes(Case):
    """Frequencies of the bare cable."""

    groups: Groups
    model: str
    exact: Array
    methods: tuple[str, ...] | None = None

    kind = "modes"

    def order(self, solvers: Solvers, method: str) -> tuple[float | None, str]:
        return solvers.order(method)

    def ask(self, solvers: Solvers, method: str, rung: Rung) -> Array:
        return solvers.modes(method, self.groups, self.model, self.exact.size, **rung.settings)

    def error(self, answer: Array) -> Error:
        worst = float(np.abs(answer / self.exact - 1.0).max())
        return worst, worst

    def gap(self, coarse: Array, fine: Array) -> float:
        # dense eigenvalue solvers lose the ratio of the stiffest axial to the lowest mode: 1e-10
        return float(np.abs(coarse / fine - 1.0).max()) + 1e-10


@dataclass(frozen=True, slots=True, kw_only=True)
class Law(Case):
    """A law that holds exactly in every run of a scene: its defect must vanish with the resolution."""

    scene: str | Scene  # built in, up to the end of the window; or a scene of its own, to its end
    defect: Callable[[Any], Error]

    def ask(self, solvers: Solvers, method: str, rung: Rung) -> Any:
        if isinstance(self.scene, Scene):
            return solvers.ride(self.scene, method, **rung.settings)
        return solvers.response(self.scene, method, **rung.settings)

    def error(self, answer: Any) -> Error:
        return self.defect(answer)


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit(Case):
    """A limit of the equations: the deviation from it must fall with a parameter."""

    parameter: str
    values: tuple[float, ...]
    deviation: Callable[[Solvers, str, float], Error]

    @property
    def refined(self) -> str:  # type: ignore[override]
        return self.parameter

    def ladder(self, solvers: Solvers, method: str) -> list[Rung]:
        rising = self.values[-1] > self.values[0]
        return [Rung({self.parameter: x}, x if rising else 1.0 / x) for x in self.values]

    def ask(self, solvers: Solvers, method: str, rung: Rung) -> Error:
        return self.deviation(solvers, method, rung.settings[self.parameter])

    def error(self, answer: Error) -> Error:
        return answer


# --- cables and travels of the cases: numbers differ from one and from each other so that no factor can hide

MU, SIGMA = 0.7, 0.31
BARE = Groups(mu=0.0, alpha=844.416, sigma=0.1688832, c=0.0844416, chord_cos=1.0, chord_sin=0.0, motion=None)


def level(motion: Motion, mu: float = MU, sigma: float = SIGMA) -> Groups:
    return Groups(mu=mu, alpha=323.0, sigma=sigma, c=0.5 * sigma, chord_cos=1.0, chord_sin=0.0, motion=motion)


def hung(gravity: float, EA: float, mass: float, drive: dict[str, Any], travel: Any = None, **hangs: float) -> Scene:
    """Return a scene with a cable of rho = 1; span 1, drop 0 and H = 1 unless `hangs` says otherwise."""
    supports = Supports(span=hangs.pop("span", 1.0), drop=hangs.pop("drop", 0.0))
    cable = Cable(mass_per_length=1.0, EA=EA, **(hangs or {"horizontal_tension": 1.0}))
    parts: dict[str, Any] = {"mass": Mass(mass=mass), "travel": travel, "drive": drive}
    return Scene(gravity=gravity, cable=cable, supports=supports, **parts)


def inside(s_o: float, V: float, a: float) -> Motion:
    """Return a travel that begins inside the string and ends at the far support."""
    d = 1.0 - s_o
    end = d / V if a == 0.0 else (math.sqrt(V * V + 2.0 * a * d) - V) / a
    return Motion(((0.0, end),), ((Piece(0.0, 0.0, s_o, V, 0.5 * a),),), 1.0)
