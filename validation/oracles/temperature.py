"""Heat and ice on a cable at rest: the elastic catenary keeps its unstretched length and its weight.

Unstretched length S, weight q per unstretched metre, end forces (H, P) and (H, P1), P1 = P - q S, N = hypot(H, P):

    dx = H S/EA + (H/q) [asinh(P/H) - asinh(P1/H)],   dy = (P S - q S^2/2)/EA + (N - N1)/q;   heat: S (1 + a dT).

Source: Irvine, Cable Structures (1981), 1.3; RTE mechaphlowers; Code_Aster SSNL114
Validity: any cable at rest; the solvers' plain catenary is 1e-6 off in H
Accuracy: rounding
Group: A car that rolls
"""

import math

import numpy as np
from scipy.optimize import brentq, fsolve

from cablefem.scene import Catenary, Scene
from validation.oracles.case import RIDERS, Case, Limit, Solvers
from validation.oracles.rest import ZIP

CHANGE = """
    temperature = -15.0
    reference_temperature = 20.0
    expansion = 1.2e-5
    diameter = 0.014
    ice = {thickness = 0.012, density = 700.0}
    [supports]"""

START = 100.0  # [m] of the held car


def catenary_extent(H: float, P: float, S: float, q: float, EA: float) -> np.ndarray:
    """(dx, dy), y down; P > 0: it descends."""
    P1 = P - q * S
    dx = H * S / EA + H / q * (math.asinh(P / H) - math.asinh(P1 / H))
    return np.array([dx, (P * S - 0.5 * q * S * S) / EA + (math.hypot(H, P) - math.hypot(H, P1)) / q])


def left_end_force_of_catenary(span: float, drop: float, S: float, weight: float, EA: float) -> tuple[float, float]:
    """(H, P) at the left support; S [m], weight [N]."""

    def end_gap(x: np.ndarray) -> np.ndarray:
        return (catenary_extent(math.exp(x[0]), x[1] * weight, S, weight / S, EA) - [span, drop]) / span

    start = [math.log(weight), 0.5 + drop / span]
    found, _, ok, message = fsolve(end_gap, start, xtol=1e-14, full_output=True)
    if ok != 1 and np.abs(end_gap(found)).max() > 1e-13:
        raise ArithmeticError(message)
    return math.exp(found[0]), found[1] * weight


def stretched_length(H: float, P: float, S: float, weight: float, EA: float) -> float:
    """S + int N/EA dS."""
    q = weight / S
    F = [0.5 * (x * math.hypot(H, x) + H * H * math.asinh(x / H)) for x in (P, P - weight)]
    return S + (F[0] - F[1]) / (q * EA)


def unstretched_length(rest: Catenary, EA: float) -> float:
    """int ds/(1 + T/EA)."""
    x, weights = np.polynomial.legendre.leggauss(60)
    T = rest.tension(0.5 * rest.length * (1.0 + x))
    return float(0.5 * rest.length * (weights / (1.0 + T / EA)).sum())


def heated_length_and_total_weight(scene: Scene, stretched: float, unstretched: float) -> tuple[float, float]:
    """S [m] and weight [N], hot or cold, with ice; lengths [m] : at the reference temperature."""
    cable = scene.cable
    ice = cable.ice_mass_per_length
    return unstretched * (1.0 + cable.thermal_strain), (cable.mass_per_length + ice) * scene.gravity * stretched


def cold_scene_with_exact_points(EA: float) -> tuple[Scene, np.ndarray, np.ndarray]:
    """Cold iced line with a car held at START, its exact place, the empty cable's place."""
    text = ZIP.replace("EA = 1.2e7", f"EA = {EA!r}")
    reference = Scene.from_toml(text)
    drive = f"start = {START}\nrelease = 5.0\nend = {{time = 0.02}}"
    scene = Scene.from_toml(text.replace("[supports]", CHANGE.strip()) + drive)
    assert scene.mass is not None
    span = scene.supports.span
    drop = scene.supports.drop
    car = scene.mass.mass * scene.gravity
    ends = np.array([span, drop])
    rest = reference.catenary
    S, weight = heated_length_and_total_weight(scene, rest.length, unstretched_length(rest, EA))
    l = stretched_length(*left_end_force_of_catenary(span, drop, S, weight, EA), S, weight, EA)
    # EA of the solvers refers to the hanging cable: EA less tension
    mean = Catenary(span, drop, weight / l, scene.horizontal_tension).mean_tension
    S = l * (1.0 - mean / EA)
    q = weight / l / (1.0 - mean / EA)
    EA -= mean
    H, P = left_end_force_of_catenary(span, drop, S, weight, EA)
    at = brentq(lambda x: stretched_length(H, P, x, q * x, EA) - START, 0.5 * START, START, xtol=1e-12)

    def end_gap(x: np.ndarray) -> np.ndarray:
        h, p = x * weight
        return (catenary_extent(h, p, at, q, EA) + catenary_extent(h, p - q * at - car, S - at, q, EA) - ends) / ends[0]

    h, p = fsolve(end_gap, [1.3 * H / weight, (P + 0.7 * car) / weight], xtol=1e-12) * weight
    return scene, catenary_extent(h, p, at, q, EA), catenary_extent(H, P, at, q, EA)


def _relative_position_error(solvers: Solvers, method: str, EA: float) -> float:
    """Error of the place over the deflection."""
    scene, point, empty = cold_scene_with_exact_points(EA)
    r = solvers.run_scene(scene, method, steps=100, **({"terms": 40} if method == "fourier-kink" else {}))
    return math.hypot(r.x[0] - point[0], r.y[0] - point[1]) / math.hypot(*(point - empty))


def cases() -> list[Case]:
    """Comparisons with the solvers, wrong ones among them."""
    return [
        Limit(
            name="cold and iced: place of a held car over its deflection", refined="EA", values=(2.5e5, 5e5, 1e6),
            order=1.0, deviation=_relative_position_error, methods=RIDERS,
            because="T/EA varies along the cable, and with it the mass per metre",
        )
    ]  # fmt: skip
