"""Damping of the cable in its plane, a force -c_d rho r. per length: its own, and that of a crosswind."""

from __future__ import annotations

import math

from cablefem.scene.bisection import bisect_zero
from cablefem.scene.cable import Cable, Damping
from cablefem.scene.catenary import Catenary
from cablefem.scene.fields import NonNegative, Part, Positive, described_field


class Wind(Part):
    """The table [wind]."""

    across: NonNegative = described_field(
        "[m/s] across the line; it damps the cable; its load on rope and car is left out"
    )
    drag_coefficient: Positive = described_field("[-] of the cable", 1.2)
    air_density: Positive = described_field("[kg/m3] density of the air", 1.2)

    def force_per_length(self, diameter: float) -> float:
        """Horizontal force [N/m] on a cable at rest, rho_air c_D d U^2/2."""
        return 0.5 * self.air_density * self.drag_coefficient * diameter * self.across**2

    def drag_per_length_and_velocity(self, diameter: float) -> float:
        """Force over velocity in the plane [N s/m^2], rho_air c_D d U/2, to first order."""
        return 0.5 * self.air_density * self.drag_coefficient * diameter * self.across


def first_angular_frequency(catenary: Catenary, EA: float, gravity: float) -> float:
    """omega_1 [rad/s] of the empty cable, at most that of the antisymmetric mode, x = pi.

    tan(x) = x - 4 x^3/L^2, omega = 2 x sqrt(T_chord/rho)/l, T_chord = H chord/span (Irvine 1981, 2.4).
    """
    L2 = catenary.irvine(EA)
    T_chord = catenary.horizontal_tension / (catenary.span / catenary.chord)

    def frequency_equation(x: float) -> float:  # times L^2 cos(x): no poles
        return L2 * (x * math.cos(x) - math.sin(x)) - 4.0 * x**3 * math.cos(x)

    x = bisect_zero(frequency_equation, 0.5 * math.pi, math.pi) if frequency_equation(math.pi) > 0.0 else math.pi
    return 2.0 * x * math.sqrt(T_chord * gravity / catenary.weight) / catenary.length


def own_and_wind_damping_rates(
    catenary: Catenary, cable: Cable, wind: Wind | None, gravity: float
) -> tuple[float, float]:
    """c_d [1/s] of `cable.damping` and of a crosswind."""
    own = cable.damping
    if isinstance(own, Damping):
        own = own.rate
    elif own:
        own *= 2.0 * first_angular_frequency(catenary, cable.EA, gravity)
    if wind is None:
        return own, 0.0
    return own, wind.drag_per_length_and_velocity(cable.diameter_with_ice) * gravity / catenary.weight


def damping_fault(catenary: Catenary, cable: Cable, wind: Wind | None, gravity: float) -> str:
    """Text if the damping exceeds the critical one of the first mode, or the diameter is missing; else empty."""
    if wind is not None and cable.diameter is None:
        return "cable.diameter: missing; must be given with wind.across, which acts on it"
    rates = own_and_wind_damping_rates(catenary, cable, wind, gravity)
    critical = 2.0 * first_angular_frequency(catenary, cable.EA, gravity)
    if sum(rates) <= critical:
        return ""
    name = "cable.damping" if rates[0] else "wind.across"
    must = f"must be at most critical, {critical:.4g} 1/s in the first mode"
    return f"{name}: damps by {sum(rates):.4g} 1/s in all; {must}"
