"""Damping of the cable in its plane, a force -c_d rho r. per length: its own, and that of a crosswind."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from cablefem.scene.bisection import bisected
from cablefem.scene.cable import Damping
from cablefem.scene.fields import NonNegative, Part, Positive, said

if TYPE_CHECKING:
    from cablefem.scene.scene import Scene

LEAST_INTERNAL = 1e-4  # [l sqrt(rho/H)] least internal damping; with 3e-5 elements stall once slack


class Wind(Part):
    """The table [wind]."""

    across: NonNegative = said("[m/s] across the line; it damps the cable")
    drag_coefficient: Positive = said("[-] of the cable", 1.2)
    air_density: Positive = said("[kg/m3] density of the air", 1.2)

    def force(self, diameter: float) -> float:
        """Horizontal force [N/m] on a cable at rest, rho_air c_D d U^2/2."""
        return 0.5 * self.air_density * self.drag_coefficient * diameter * self.across**2

    def resistance(self, diameter: float) -> float:
        """Force over velocity in the plane [N s/m^2], rho_air c_D d U/2, to first order."""
        return 0.5 * self.air_density * self.drag_coefficient * diameter * self.across


def first_frequency(scene: Scene) -> float:
    """omega_1 [rad/s] of the empty cable, at most that of the antisymmetric mode, x = pi.

    tan(x) = x - 4 x^3/L^2, omega = 2 x sqrt(tau/rho)/l, tau = H chord/span (Irvine 1981, 2.4).
    """
    L2 = scene.irvine
    tau = scene.horizontal_tension / (scene.supports.span / scene.chord)

    def off(x: float) -> float:  # times L^2 cos(x): no poles
        return L2 * (x * math.cos(x) - math.sin(x)) - 4.0 * x**3 * math.cos(x)

    x = bisected(off, 0.5 * math.pi, math.pi) if off(math.pi) > 0.0 else math.pi
    return 2.0 * x * math.sqrt(tau * scene.gravity / scene.catenary.weight) / scene.length


def damping_rates(scene: Scene) -> tuple[float, float]:
    """c_d [1/s] of `cable.damping` and of a crosswind."""
    own = scene.cable.damping
    wind = scene.wind
    if isinstance(own, Damping):
        own = own.rate
    elif own:
        own *= 2.0 * first_frequency(scene)
    return own, 0.0 if wind is None else wind.resistance(scene.cable.windward) * scene.gravity / scene.catenary.weight


def damping_fault(scene: Scene) -> str:
    if scene.wind is not None and scene.cable.diameter is None:
        return "cable.diameter: missing; must be given with wind.across, which acts on it"
    rates = damping_rates(scene)
    critical = 2.0 * first_frequency(scene)
    if sum(rates) <= critical:
        return ""
    name = "cable.damping" if rates[0] else "wind.across"
    most = f"must be at most critical, {critical:.4g} 1/s in the first mode"
    return f"{name}: damps by {sum(rates):.4g} 1/s in all; {most}"


def internal_fault(scene: Scene, mode: str) -> str:
    tau = scene.cable.internal_damping
    least = LEAST_INTERNAL * scene.time_scale
    told = f"cable.internal_damping = {tau!r} s: must be 0"
    if tau and mode != "grip":
        return f"{told} with drive.mode = {mode!r}; only a car that grips the cable runs it slack"
    if 0.0 < tau < least:
        return f"{told} or at least {least:.3g} s; less does not settle a slack cable"
    return ""
