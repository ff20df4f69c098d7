"""A mass with any travel below the wave speed on a taut string, with all reflections.

    v_tt - v_xx = R delta(x - xi),  v(0, t) = v(1, t) = 0,  at rest for t <= 0,  y = v(xi, t),  mu y'' = mu sigma - R.

With v = f(t+x) - f(t-x) behind the mass, g(t-x) - g(t+x-2) ahead of it, F(t) = f(t+xi), G(t) = g(t-xi):

    y = F - F(t1) = G - G(t2),   t1 + xi(t1) = t - xi,   t2 - xi(t2) = t + xi - 2,   F(<0) = G(<0) = 0,   (1)
    y' = sigma t - (2/mu) (F + G - y),                                                                    (2)

by collocation at Chebyshev points between arrivals of fronts.
With sigma (1 + V^2) it is the limit of a sagging cable for sigma -> 0 at fixed V, mu, alpha.

Source: Smith 1964; Dyniewicz & Bajer 2009
Validity: 0 <= xi <= 0.99, |xi'| < 1 throughout
Accuracy: 5e-9 of the largest y up to xi = 0.95, mu 0.1 to 20, speeds 0.14 to 0.9; 1e-7 at speed 0.1
Group: A mass on a taut string
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import block_array, csr_array, eye_array
from scipy.sparse.linalg import spsolve

from cablefem.scene import AccelerateCruiseBrake, ConstantAcceleration, ConstantSpeed, Motion, Scene
from validation.oracles.case import (
    BEST,
    MU,
    SIGMA,
    Array,
    Crossing,
    Limit,
    Solvers,
    chebyshev_points_and_integrals,
    level_string_groups,
    refuse_unless,
)

DEGREE = 10
POINTS, _INTEGRALS = chebyshev_points_and_integrals(DEGREE)
_TO_COEFFICIENTS: Any = np.linalg.inv(chebvander(POINTS, DEGREE))


def _panels_and_interpolation_weights(t: Array, edges: Array) -> tuple[NDArray[np.intp], Array]:
    """Panels of the times t (n,), and weights (n, DEGREE + 1) of the values at their points."""
    k = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, edges.size - 2)
    x = 2.0 * (t - edges[k]) / np.diff(edges)[k] - 1.0  # on [-1, 1]
    return k, chebvander(x, DEGREE) @ _TO_COEFFICIENTS


def _emission_times(motion: Motion, sign: float, characteristic: Array, latest: Array) -> Array:
    """t in [0, latest] with t + sign xi(t) = characteristic, by bisection."""
    low = np.zeros_like(latest)
    high = latest
    for _ in range(60):
        middle = 0.5 * (low + high)
        early = middle + sign * motion.position(middle) < characteristic
        low = np.where(early, middle, low)
        high = np.where(early, high, middle)
    return high


def _start_arrival_and_end_times(motion: Motion, end_time: float) -> Array:
    """Starts of the travel's pieces, returns of their waves by one support, and `end_time`."""
    starts = [piece.start for pieces in motion.pieces for piece in pieces if piece.start < end_time]
    times = {*starts, end_time}
    for start in starts:
        for sign, turn in ((1.0, 0.0), (-1.0, 2.0)):  # by the near support, by the far one
            last = -1.0
            t = start
            while last + 1e-9 < t < end_time:
                times.add(t)
                characteristic = t + sign * float(motion.position(t)) + turn
                last = t
                t = float(_emission_times(motion, -sign, np.array([characteristic]), np.array([end_time]))[0])
    return np.array(sorted(times))


@dataclass(frozen=True, slots=True)
class MassHistory:
    edges: Array  # of the panels
    values: Array  # y, F, G at the points of the panels (3, n, DEGREE + 1)

    def displacement_and_waves(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """y, F, G at t, each of its shape."""
        t = np.asarray(t, float)
        refuse_unless(f"t inside [0, {self.edges[-1]}]", t >= 0.0, t <= self.edges[-1])
        k, weights = _panels_and_interpolation_weights(t.ravel(), self.edges)
        y, F, G = np.einsum("fnk,nk->fn", self.values[:, k], weights).reshape(3, *t.shape)
        return y, F, G

    def mass_displacement(self, t: ArrayLike) -> Array:
        return self.displacement_and_waves(t)[0]


def solve_moving_mass(motion: Motion, *, mu: float, sigma: float) -> MassHistory:
    """Solve (1), (2) up to 0.01 before the far support; ValueError outside the validity."""
    slow = all(abs(speed) < 1.0 for _, speed in motion.speeds_where_extreme)
    domain = "mu, sigma > 0, travel on the string below the wave speed"
    refuse_unless(domain, mu > 0.0, sigma > 0.0, slow, motion.end_position <= 1.0)
    reach = 0.01  # distance to the far support at which the answer ends: fronts accumulate there
    end_time = motion.time_at_position(1.0 - reach) if motion.end_position > 1.0 - reach else motion.end_time
    longest = min(0.05, 0.125 * mu)  # panel: the string gives way within mu/2
    edges = _panel_edges(motion, end_time, longest)
    half = 0.5 * np.diff(edges)
    from_edges = half[:, None] * (1.0 + POINTS[1:])
    t = (edges[:-1, None] + from_edges).ravel()
    n = t.size
    own = np.arange(n) // DEGREE
    xi = motion.position(t)

    def sparse(panel: NDArray[np.intp], weights: Array) -> csr_array:
        """Weights at points of panels; the first is the last of the panel before, or 0."""
        columns = DEGREE * panel[:, None] + np.arange(-1, DEGREE)
        rows = np.broadcast_to(np.arange(n)[:, None], columns.shape)
        on = columns >= 0
        return csr_array((weights[on], (rows[on], columns[on])), shape=(n, n))

    def reflected(sign: float, characteristic: Array) -> csr_array:
        arrived = characteristic > sign * motion.start_position
        sent = _emission_times(motion, sign, characteristic, t)
        panel, weights = _panels_and_interpolation_weights(sent, edges)
        return sparse(panel, weights * arrived[:, None])

    one = eye_array(n)
    at_edge = np.zeros((n, DEGREE + 1))
    at_edge[:, 0] = 1.0
    before = sparse(own, at_edge)
    integral = sparse(own, half[own, None] * np.tile(_INTEGRALS[1:], (half.size, 1)))
    near = reflected(1.0, t - xi)
    far = reflected(-1.0, t + xi - 2.0)
    impulse = (2.0 / mu) * integral
    of_y = [one - before - impulse, impulse, impulse]
    of_F = [-one, one - near, None]
    of_G = [-one, None, one - far]
    matrix = block_array([of_y, of_F, of_G], format="csc")
    right = np.append(integral @ (sigma * t), np.zeros(2 * n))
    values = spsolve(matrix, right).reshape(3, -1, DEGREE)
    first = np.zeros((3, half.size, 1))
    first[:, 1:] = values[:, :-1, -1:]  # the last of the panel before
    return MassHistory(edges, np.concatenate([first, values], axis=2))


def _panel_edges(motion: Motion, end_time: float, longest: float) -> Array:
    """Arrivals of fronts, and times between them, at most `longest` apart."""
    edges = []
    for begin, stop in pairwise(_start_arrival_and_end_times(motion, end_time)):
        count = int(np.ceil((stop - begin) / longest))
        edges.append(np.linspace(begin, stop, 1 + count)[:-1])
    return np.append(np.concatenate(edges), end_time)


def cases() -> Iterator[Crossing | Limit]:
    """Comparisons with the solvers, wrong ones among them."""
    yield _paper_crossing()
    yield _steady_crossing(0.2, 0.6)
    yield _steady_crossing(5.0, 0.37)
    yield _steady_crossing(MU, 0.9)
    yield _crossing_with_mass("from rest, acceleration 0.23", ConstantAcceleration(acceleration=0.23).motion(1.0))
    yield _crossing_with_mass("accelerate, cruise, brake", AccelerateCruiseBrake(top_speed=0.55).motion(1.0))
    for model in ("sagged", "stretching", "full"):
        yield _small_sag_limit(model)
    yield _small_sag_limit("stretching", plain_gravity=True)


def _crossing_with_mass(name: str, motion: Motion, mu: float = MU) -> Crossing:
    """A crossing with any travel against its exact path."""
    exact = solve_moving_mass(motion, mu=mu, sigma=SIGMA).mass_displacement
    finer = 3.0 if mu < 0.5 else 1.0
    return Crossing(name=name, groups=level_string_groups(motion, mu), exact=exact, finer=finer)


def _steady_crossing(mu: float, V: float) -> Crossing:
    return _crossing_with_mass(f"mass ratio {mu:g}, speed {V:g}", ConstantSpeed(speed=V).motion(1.0), mu)


def _paper_crossing() -> Crossing:
    groups = Scene.load("level").groups
    motion = groups.motion
    assert motion is not None
    _, V, _ = motion.position_with_rates(0.0, 0)
    sigma = groups.sigma * (1.0 + V**2)
    exact = solve_moving_mass(motion, mu=groups.mu, sigma=sigma).mass_displacement
    name = "the paper's mass and speed, g (1 + V²)"
    return Crossing(name=name, scene="level", groups=groups, exact=exact, methods=None)


def _small_sag_limit(model: str, *, plain_gravity: bool = False) -> Limit:
    V = 0.45
    motion = ConstantSpeed(speed=V).motion(1.0)

    def deviation(solvers: Solvers, method: str, sigma: float) -> Array:
        """Error of a sagging cable against the taut string."""
        groups = level_string_groups(motion, sigma=sigma)
        weight = sigma if plain_gravity else sigma * (1.0 + V * V)
        exact = solve_moving_mass(motion, mu=groups.mu, sigma=weight).mass_displacement
        crossing = Crossing(name="", groups=groups, exact=exact, model=model)
        return crossing.relative_errors(solvers.mass_path(crossing, method))

    gravity = "plain g instead of g (1 + V²)" if plain_gravity else "g (1 + V²)"
    return Limit(
        name=f"limit of small sag, model {model}, {gravity}", refined="sag", values=(0.02, 0.01, 0.005), order=2.0,
        because="the tension that the sag adds goes like alpha sigma²", deviation=deviation,
        methods=("following-p2",) if plain_gravity else BEST, expected="disagree" if plain_gravity else "agree",
    )  # fmt: skip
