"""Heat and ice on a cable at rest: the elastic catenary keeps its unstretched length and its weight.

Unstretched length S, weight q per unstretched metre, end forces (H, P) and (H, P1), P1 = P - q S, N = hypot(H, P):

    dx = H S/EA + (H/q) [asinh(P/H) - asinh(P1/H)],   dy = (P S - q S^2/2)/EA + (N - N1)/q;   heat: S (1 + a dT).

Source: Irvine, Cable Structures (1981), 1.3; RTE mechaphlowers; Code_Aster SSNL114
Validity: any cable at rest; the solvers' plain catenary is 1e-6 off in H
Accuracy: rounding
Group: A car that rolls
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

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
    dy = (P * S - 0.5 * q * S * S) / EA + (math.hypot(H, P) - math.hypot(H, P1)) / q
    return np.array([dx, dy])


def left_end_force_of_catenary(span: float, drop: float, S: float, weight: float, EA: float) -> tuple[float, float]:
    """(H, P) at the left support; S [m], weight [N]."""

    def end_gap(x: np.ndarray) -> np.ndarray:
        log_H, P_over_weight = x
        extent = catenary_extent(math.exp(log_H), P_over_weight * weight, S, weight / S, EA)
        return (extent - [span, drop]) / span

    start = [math.log(weight), 0.5 + drop / span]
    found, _, ok, message = fsolve(end_gap, start, xtol=1e-14, full_output=True)
    if ok != 1 and np.abs(end_gap(found)).max() > 1e-13:
        raise ArithmeticError(message)
    log_H, P_over_weight = found
    return math.exp(log_H), P_over_weight * weight


def stretched_length_from_end_force(
    H: float, P_left: float, unstretched: float, total_weight: float, EA: float
) -> float:
    """unstretched + int N/EA dS [m]; (H, P_left) : force [N] at the left end, total_weight [N]."""
    q = total_weight / unstretched

    def integral_of_N(P: float) -> float:
        return 0.5 * (P * math.hypot(H, P) + H * H * math.asinh(P / H))

    stretch = (integral_of_N(P_left) - integral_of_N(P_left - total_weight)) / (q * EA)
    return unstretched + stretch


def unstretched_length(rest: Catenary, EA: float) -> float:
    """int ds/(1 + T/EA)."""
    x, weights = np.polynomial.legendre.leggauss(60)
    T = rest.tension(0.5 * rest.length * (1.0 + x))
    return float(0.5 * rest.length * (weights / (1.0 + T / EA)).sum())


def heated_length_and_total_weight(scene: Scene, stretched: float, unstretched: float) -> tuple[float, float]:
    """S [m] and weight [N], hot or cold, with ice; lengths [m] : at the reference temperature."""
    cable = scene.cable
    mass_per_length = cable.mass_per_length + cable.ice_mass_per_length
    return unstretched * (1.0 + cable.thermal_strain), mass_per_length * scene.gravity * stretched


class HeldCarInCold(NamedTuple):
    """A cold iced line with a car held at START."""

    scene: Scene
    point: np.ndarray  # of the car, exact
    empty_point: np.ndarray  # of the same point of the empty cable


def held_car_in_cold(EA: float) -> HeldCarInCold:
    """EA [N] of the cable before it hangs."""
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
    H, P = left_end_force_of_catenary(span, drop, S, weight, EA)
    l = stretched_length_from_end_force(H, P, S, weight, EA)
    # EA of the solvers refers to the hanging cable: EA less tension
    mean = Catenary(span, drop, weight / l, scene.horizontal_tension).mean_tension
    S = l * (1.0 - mean / EA)
    q = weight / l / (1.0 - mean / EA)
    EA -= mean
    H, P = left_end_force_of_catenary(span, drop, S, weight, EA)

    def start_gap(x: float) -> float:
        return stretched_length_from_end_force(H, P, x, q * x, EA) - START

    at = brentq(start_gap, 0.5 * START, START, xtol=1e-12)  # unstretched

    def end_gap(x: np.ndarray) -> np.ndarray:
        h, p = x * weight
        behind = catenary_extent(h, p, at, q, EA)
        ahead = catenary_extent(h, p - q * at - car, S - at, q, EA)
        return (behind + ahead - ends) / span

    first = [1.3 * H / weight, (P + 0.7 * car) / weight]
    h, p = fsolve(end_gap, first, xtol=1e-12) * weight
    return HeldCarInCold(scene, catenary_extent(h, p, at, q, EA), catenary_extent(H, P, at, q, EA))


def _relative_position_error(solvers: Solvers, method: str, EA: float) -> float:
    """Error of the place over the deflection."""
    held = held_car_in_cold(EA)
    settings = {"terms": 40} if method == "fourier-kink" else {}
    r = solvers.run_scene(held.scene, method, steps=100, **settings)
    x, y = held.point
    deflection = math.hypot(*(held.point - held.empty_point))
    return math.hypot(r.x[0] - x, r.y[0] - y) / deflection


def cases() -> Iterator[Case]:
    """Comparisons with the solvers, wrong ones among them."""
    yield Limit(
        name="cold and iced: place of a held car over its deflection", refined="EA", values=(2.5e5, 5e5, 1e6),
        order=1.0, deviation=_relative_position_error, methods=RIDERS,
        because="T/EA varies along the cable, and with it the mass per metre",
    )  # fmt: skip
