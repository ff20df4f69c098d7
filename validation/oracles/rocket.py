"""A sled driven by steady thrust along a taut level string, from its rest in the loaded string.

s_o = s0 + a t^2/2, a = thrust/mu.  Depth w below the empty string, from rest at w = mu sigma s0 (1 - s0):
    mu w.. + 2 w. = mu sigma ds_o^2 + mu sigma (1 - 2 s0) ds_o + mu a <w_s>,
    <w_s> = mu sigma [ (1 - 2 s0) - ds_o - 2 ds_o w./(mu sigma) ] / (2 (1 - ds_o^2)).

Source: d'Alembert's solution, derived here
Validity: a t < 1, before the first echo, sigma -> 0
Accuracy: DOP853 at rtol 1e-12
Group: A car that rolls
"""

from collections.abc import Iterator
from functools import partial

from scipy.integrate import OdeSolution, solve_ivp

from validation.oracles.case import RIDERS, Array, Limit, Solvers, refuse_unless, scene_in_units_of_cable

# w is down to 3e-5 l
FINE = {"fourier-kink": {"terms": 160, "steps": 400}, "following-p2": {"elements": 200, "steps": 800}}


def _mean_slope(speed: float, velocity: float, weight: float, s0: float) -> float:
    """<w_s> of both sides of the sled; speed : along the string, velocity : downwards."""
    slopes = weight * (1.0 - 2.0 * s0 - speed) - 2.0 * speed * velocity
    return slopes / (2.0 * (1.0 - speed * speed))


def solve_depth_under_thrust(
    t_end: float, *, mu: float, sigma: float, a: float, s0: float, lift: bool = True
) -> OdeSolution:
    """w and w. at times up to t_end, (2, ...); lift = False: without mu a <w_s>."""
    slow = 0.0 <= a * t_end < 1.0
    refuse_unless("mu, sigma > 0, 0 < s0 < 1, a t_end < 1", mu > 0.0, sigma > 0.0, 0.0 < s0 < 1.0, slow)
    at = s0 + 0.5 * a * t_end**2
    refuse_unless("an end before the first echo", t_end <= min(s0 + at, 2.0 - s0 - at))
    weight = mu * sigma

    def rates(t: float, q: Array) -> list[float]:
        """Of w and of its velocity."""
        _, dw = q
        V = a * t
        thrust_lift = lift * mu * a * _mean_slope(V, dw, weight, s0)
        drive = weight * V * V + weight * (1.0 - 2.0 * s0) * V + thrust_lift
        return [dw, (drive - 2.0 * dw) / mu]

    begin = [weight * s0 * (1.0 - s0), 0.0]
    run = solve_ivp(rates, (0.0, t_end), begin, "DOP853", rtol=1e-12, atol=1e-15 * weight, dense_output=True)
    return run.sol


def _relative_depth_deviation(solvers: Solvers, method: str, sigma: float, lift: bool) -> Array:
    mu = 0.3
    a = 0.8
    s0 = 0.4
    t_end = 0.7
    exact = solve_depth_under_thrust(t_end * 1.001, mu=mu, sigma=sigma, a=a, s0=s0, lift=lift)
    drive = {"mode": "free", "start": s0, "thrust": mu * a, "end": {"time": t_end}}
    scene = scene_in_units_of_cable(sigma, 300.0, mu, drive)
    r = solvers.run_scene(scene, method, scheme="trapezoidal", **FINE[method])
    w, _ = exact(r.t / scene.time_scale)
    return (r.v / r.length - w) / (mu * sigma)


def cases() -> Iterator[Limit]:
    """Comparisons with the solvers, wrong ones among them."""
    elements, sines = RIDERS
    few = (1e-2, 3e-3, 1e-3)
    yield _taut_limit("", (1e-2, 1e-3, 1e-4), elements)
    yield _taut_limit("", few, sines)
    yield _taut_limit(", thrust without lift", few, elements, lift=False)


def _taut_limit(remark: str, sigmas: tuple[float, ...], method: str, lift: bool = True) -> Limit:
    because = "sag and stretch change the waves like the square of sigma where alpha sigma² is small"
    return Limit(
        name="taut cable: depth over mu sigma" + remark, refined="sigma", values=sigmas, order=2.0, because=because,
        deviation=partial(_relative_depth_deviation, lift=lift), methods=(method,),
        expected="agree" if lift else "disagree",
    )  # fmt: skip
