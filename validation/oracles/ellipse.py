"""A bead on a string without weight or stretch runs on an ellipse with the supports as foci.

r1 = s_o, r2 = l - s_o, D distance of the supports, a = l/2, b^2 = a^2 - D^2/4, psi inclination of the path:
    v^2 = 2 g (y - y_0),   N = M (v^2 a b/(r1 r2)^(3/2) + g cos(psi)) sqrt(r1 r2)/(2 b);
small swings omega^2 = g b/a^2.  Limit of a rolling car for EA >> M g >> rho g l.

Source: Energy and the geometry of the ellipse
Validity: D < l, no friction
Accuracy: rounding; places over time by DOP853 at rtol 1e-12
Group: A car that rolls
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from cablefem.scene import Scene
from validation.oracles.case import RIDERS, Array, Limit, Solvers, refuse_unless, scene_in_units_of_cable


@dataclass(frozen=True, slots=True)
class Ellipse:
    """Unit mass, string of length 1, supports D apart; y down."""

    D: float
    g: float

    def __post_init__(self) -> None:
        refuse_unless("0 < D < 1, g > 0", 0.0 < self.D < 1.0, self.g > 0.0)

    @property
    def b(self) -> float:
        return math.sqrt(0.25 - 0.25 * self.D**2)

    def point(self, s_o: ArrayLike) -> tuple[Array, Array]:
        """(x, y) from the left support."""
        r1 = np.asarray(s_o, float)
        along = (2.0 * r1 - 1.0 + self.D**2) / (2.0 * self.D)
        return along, np.sqrt(np.maximum(r1**2 - along**2, 0.0))

    def speed(self, s_o: ArrayLike, start: float) -> Array:
        """v when released at `start`."""
        _, y = self.point(s_o)
        _, y_0 = self.point(start)
        return np.sqrt(np.maximum(2.0 * self.g * (y - y_0), 0.0))

    def tension(self, s_o: ArrayLike, start: float) -> Array:
        """N for a unit mass."""
        r1 = np.asarray(s_o, float)
        product = r1 * (1.0 - r1)
        b = self.b
        w = self._eccentric_angle(r1)
        half_sin = 0.5 * np.sin(w)
        down = half_sin / np.hypot(b * np.cos(w), half_sin)  # of the outward normal
        press = self.speed(r1, start) ** 2 * 0.5 * b / product**1.5 + self.g * down
        return press * np.sqrt(product) / (2.0 * b)

    def transverse_bounce_period(self, s_o: ArrayLike, stiffness: float) -> Array:
        """Period of bounces normal to the path; EA in weights of the bead."""
        r1 = np.asarray(s_o, float)
        return 2.0 * math.pi * np.sqrt(r1 * (1.0 - r1) / (stiffness * self.g)) / (2.0 * self.b)

    def position_at_time(self, t: ArrayLike, start: float) -> Array:
        """s_o(t); s_o = 1/2 + (D/2) cos(w)."""
        t = np.asarray(t, float)
        b = self.b

        def rates(now: float, q: Array) -> list[float]:
            """Of angle and angular speed."""
            w, dw = q
            c = math.cos(w)
            s = math.sin(w)
            inertia = 0.25 * s * s + b * b * c * c
            force = self.g * b * c - (0.25 - b * b) * s * c * dw**2
            return [dw, force / inertia]

        begin = [float(self._eccentric_angle(np.array(start))), 0.0]
        span = (0.0, float(t.max()) + 1e-9)
        run = solve_ivp(rates, span, begin, "DOP853", rtol=1e-12, atol=1e-13, dense_output=True)
        w, _ = run.sol(t.ravel())
        return 0.5 + 0.5 * self.D * np.cos(w.reshape(t.shape))

    def _eccentric_angle(self, s_o: Array) -> Array:
        return np.arccos(np.clip((2.0 * s_o - 1.0) / self.D, -1.0, 1.0))


# damped: steps do not resolve the bounce
RULES: dict[str, dict[str, Any]] = {
    "following-p2": {"scheme": "radau"}, "fourier-kink": {"scheme": "generalized-alpha", "rho_inf": 0.0},
}  # fmt: skip
BEAD = Ellipse(D=1.0 / 1.05, g=1.0)
MU = 1000.0
START = 0.2


def free_ride_on_stiff_rope(stiffness: float, mu: float = MU, start: float = START, t_end: float = 1.7) -> Scene:
    """EA in weights of the car, mass mu, sudden start."""
    drive = {"mode": "free", "start": start, "end": {"time": t_end}, "rest_distance": 1e-6}
    return scene_in_units_of_cable(BEAD.g, stiffness * mu, mu, drive, span=BEAD.D, length=1.0)


def _run_with_damped_scheme(solvers: Solvers, method: str, *rope_and_car: float, **motion: float) -> Any:
    """The ride of `free_ride_on_stiff_rope`."""
    scene = free_ride_on_stiff_rope(*rope_and_car, **motion)
    return solvers.run_scene(scene, method, steps=1200, **RULES[method])


def _relative_distance_from_ellipse(solvers: Solvers, method: str, stiffness: float) -> Array:
    """Distance over l at each step of the run."""
    r = _run_with_damped_scheme(solvers, method, stiffness)
    x, y = BEAD.point(r.s_o / r.length)
    return np.hypot(r.x / r.length - x, r.y / r.length - y)


def _relative_speed_error(solvers: Solvers, method: str, stiffness: float) -> Array:
    r = _run_with_damped_scheme(solvers, method, stiffness)
    speed = BEAD.speed(r.s_o / r.length, START)
    return (r.speed - speed) / speed.max()


def _relative_tension_error(solvers: Solvers, method: str, stiffness: float, averaged: bool = True) -> Array:
    """Error over the largest N; means over one bounce."""
    r = _run_with_damped_scheme(solvers, method, stiffness)
    s_o = BEAD.position_at_time(r.t, START)
    right = BEAD.tension(s_o, START)
    bounce = BEAD.transverse_bounce_period(s_o, stiffness) if averaged else np.zeros_like(s_o)
    sides = [_moving_means(r.t, N / MU - right, bounce) for N in (r.T_behind, r.T_ahead)]
    return np.concatenate(sides) / right.max()


def _moving_means(t: Array, values: Array, durations: Array) -> Array:
    """Means over `durations` about t, at times at which they fit into the run; over 0: the values."""
    if not durations.any():
        return values[1:]
    begin = t - 0.5 * durations
    end = t + 0.5 * durations
    within = (begin >= t[0]) & (end <= t[-1])
    steps = 0.5 * np.diff(t) * (values[1:] + values[:-1])
    integral = np.append(0.0, np.cumsum(steps))
    means = (np.interp(end, t, integral) - np.interp(begin, t, integral)) / durations
    return means[within]


def _relative_swing_period_error(solvers: Solvers, method: str, mu: float) -> float:
    """Relative error of the time between two passages of the middle, in small swings."""
    start = 0.49
    omega = math.sqrt(BEAD.g * BEAD.b) / 0.5
    r = _run_with_damped_scheme(solvers, method, 1e5, mu, start, t_end=5.5 * math.pi / omega)

    def mean_half_period(s_o: Array) -> float:
        passages = CubicSpline(r.t, s_o - 0.5).roots(extrapolate=False)
        return float(np.diff(passages).mean())

    exact = mean_half_period(BEAD.position_at_time(r.t, start))
    return abs(exact / mean_half_period(r.s_o / r.length) - 1.0)


def cases() -> Iterator[Limit]:
    """Comparisons with the solvers, wrong ones among them."""
    stretch = "the cable stretches by M g/EA"
    bounces = "the car that is let go bounces, at a speed like sqrt(M g/EA)"
    rings = "it rings on, whatever EA"
    weight = "the cable's own weight counts like one over the car's"
    light = "stiff light cable: "
    tension = light + "tension over the largest, "
    at_any_time = partial(_relative_tension_error, averaged=False)
    three = (1e2, 1e3, 1e4)
    four = (*three, 1e5)
    stiff = partial(Limit, refined="stiffness", methods=RIDERS, order=1.0)
    yield stiff(
        name=light + "distance from it over l", values=four, because=stretch, deviation=_relative_distance_from_ellipse
    )
    yield stiff(
        name=light + "speed over the largest", values=four, order=0.5, because=bounces, deviation=_relative_speed_error
    )
    tensions = partial(stiff, values=three, deviation=_relative_tension_error)
    yield tensions(name=tension + "mean over a bounce", because=stretch)
    yield tensions(name=tension + "at any time", because=rings, deviation=at_any_time, expected="disagree")
    yield stiff(
        name="small swings on a stiff light cable: frequency", refined="mu", values=(10.0, 100.0, 1000.0),
        because=weight, deviation=_relative_swing_period_error,
    )  # fmt: skip
