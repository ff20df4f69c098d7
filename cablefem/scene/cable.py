"""The cable and its two supports, and the catenary that they define together."""

import math
from typing import Any

from cablefem.scene.catenary import Catenary, length_range, sag_range, tension_range
from cablefem.scene.errors import shown
from cablefem.scene.fields import Part, Positive, Real

SHAPES = ("length", "sag", "horizontal_tension")
# A support 84 degrees below the other is a hoist, not a ropeway; beyond, y' grows like the slope and digits go.
STEEPEST = 10.0


class Cable(Part):
    """A uniform elastic cable; exactly one of length, sag and horizontal_tension fixes how deep it hangs."""

    mass_per_length: Positive  # rho [kg/m] per stretched static length
    EA: Positive  # [N]
    length: Positive | None = None  # l [m], stretched static arc length
    sag: Positive | None = None  # [m], largest vertical distance below the chord
    horizontal_tension: Positive | None = None  # H [N]

    @classmethod
    def faults_between(cls, data: dict[str, Any]) -> list[str]:
        """A cable hangs as deep as exactly one number says."""
        given = [f"{name} = {shown(data[name])}" for name in SHAPES if data.get(name) is not None]
        one = f"exactly one of {', '.join(SHAPES)} must be given"
        if not given:
            return [f"{SHAPES[0]}: missing; {one}"]
        return [f"{extra}: too much beside {given[0]}; {one}" for extra in given[1:]]


class Supports(Part):
    """Two fixed points; the left one is the origin."""

    span: Positive  # b [m], horizontal
    drop: Real = 0.0  # h [m], right support below the left one: positive


def hang(gravity: float, cable: Cable, supports: Supports) -> Catenary:
    """The catenary of a cable that `hanging_faults` finds nothing wrong with."""
    weight = cable.mass_per_length * gravity
    if cable.length is not None:
        return Catenary.from_length(supports.span, supports.drop, weight, cable.length)
    if cable.sag is not None:
        return Catenary.from_sag(supports.span, supports.drop, weight, cable.sag)
    assert cable.horizontal_tension is not None
    return Catenary(supports.span, supports.drop, weight, cable.horizontal_tension)


def hanging_faults(gravity: float, cable: Cable, supports: Supports) -> list[str]:
    """Why these supports and this cable have no catenary, if they have none."""
    span, drop = supports.span, supports.drop
    if abs(drop) > STEEPEST * span:
        most = STEEPEST * span
        return [f"supports.drop = {drop!r}: must be from {-most:.6g} to {most:.6g}, {STEEPEST:g} spans"]
    name, value = next((n, v) for n in SHAPES if (v := getattr(cable, n)) is not None)
    low, high = {
        "length": lambda: length_range(span, drop),
        "sag": lambda: sag_range(span, drop),
        "horizontal_tension": lambda: tension_range(span, cable.mass_per_length * gravity),
    }[name]()
    if low <= value <= high:
        return []
    least = f"{low!r}" if name == "length" else f"{low:.6g}"  # a length counts by what it exceeds the chord
    fault = f"cable.{name} = {value!r}: must be from {least} to {high:.6g} with these supports"
    chord = math.hypot(span, drop)
    if name == "length" and value <= chord:
        fault += f" (the supports are {chord!r} m apart)"
    elif name == "length" and value < low:
        fault += " (for a cable this taut give sag or horizontal_tension)"
    return [fault]
