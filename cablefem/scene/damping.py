"""Damping of the cable in its plane, a force -c_d rho r. per length: its own, and that of a crosswind."""

import math

from cablefem.scene.bisection import bisected
from cablefem.scene.cable import Cable, Damping, Ice
from cablefem.scene.catenary import Catenary
from cablefem.scene.fields import NonNegative, Part, Positive, said

LEAST_INTERNAL = 1e-4  # [l sqrt(rho/H)] least time of internal damping; with 3e-5 elements stall on a slack cable


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


def first_frequency(gravity: float, cable: Cable, catenary: Catenary) -> float:
    """omega_1 [rad/s] of the empty cable, at most that of the antisymmetric mode, x = pi.

    tan(x) = x - 4 x^3/L^2, omega = 2 x sqrt(tau/rho)/l, tau = H chord/span (Irvine 1981, 2.4).
    """
    cos, H = catenary.span / catenary.chord, catenary.horizontal_tension
    L2 = catenary.sigma**2 * cable.EA / H * cos**5

    def off(x: float) -> float:  # times L^2 cos(x): no poles
        return L2 * (x * math.cos(x) - math.sin(x)) - 4.0 * x**3 * math.cos(x)

    x = bisected(off, 0.5 * math.pi, math.pi) if off(math.pi) > 0.0 else math.pi
    return 2.0 * x * math.sqrt(H / cos * gravity / catenary.weight) / catenary.length


def windward(cable: Cable) -> float:
    """Diameter [m] with ice."""
    assert cable.diameter is not None
    return cable.diameter + (2.0 * cable.ice.thickness if isinstance(cable.ice, Ice) else 0.0)


def damping_rates(wind: Wind | None, gravity: float, cable: Cable, catenary: Catenary) -> tuple[float, float]:
    """c_d [1/s] of `cable.damping` and of a crosswind."""
    own = cable.damping
    if isinstance(own, Damping):
        own = own.rate
    elif own:
        own *= 2.0 * first_frequency(gravity, cable, catenary)
    return own, 0.0 if wind is None else wind.resistance(windward(cable)) * gravity / catenary.weight


def internal_faults(mode: str, gravity: float, cable: Cable, catenary: Catenary) -> list[str]:
    if not cable.internal_damping:
        return []
    name = f"cable.internal_damping = {cable.internal_damping!r} s"
    if mode != "grip":
        return [f"{name}: must be 0 with drive.mode = {mode!r}; only a car that grips the cable runs it slack"]
    H, weight = catenary.horizontal_tension, catenary.weight
    least = LEAST_INTERNAL * catenary.length * math.sqrt(weight / gravity / H)
    if cable.internal_damping >= least:
        return []
    return [f"{name}: must be 0 or at least {least:.3g} s; less does not settle a slack cable"]


def damping_faults(wind: Wind | None, gravity: float, cable: Cable, catenary: Catenary) -> list[str]:
    if wind is not None and cable.diameter is None:
        return ["cable.diameter: missing; must be given with wind.across, which acts on it"]
    rates = damping_rates(wind, gravity, cable, catenary)
    critical = 2.0 * first_frequency(gravity, cable, catenary)
    if sum(rates) <= critical:
        return []
    name = "cable.damping" if rates[0] else "wind.across"
    return [
        f"{name}: damps by {sum(rates):.4g} 1/s in all; must be at most critical, {critical:.4g} 1/s in the first mode"
    ]
