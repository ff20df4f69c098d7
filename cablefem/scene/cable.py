"""Cable, supports and their catenary, with temperature and ice: README.md, rule 2."""

import math
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import ConfigDict, model_validator

from cablefem.scene.bisection import bisect_zero
from cablefem.scene.catenary import Z_MAX, Z_MIN, Catenary
from cablefem.scene.errors import short_text
from cablefem.scene.fields import (
    POSITIVE,
    Admits,
    NonNegative,
    Part,
    Positive,
    Real,
    described_field,
    exactly_one_faults,
    number_between,
    number_or_table_type,
)

SHAPES = ("length", "sag", "horizontal_tension")
SAME_STIFFNESS = 0.02  # of EA: E section is that of the unstretched cable, and both are rounded
STEEPEST = 10.0  # [-] largest slope of the chord, 84 degrees; steeper lines lose digits

Celsius = Annotated[float, number_between(-100.0, 300.0)]


class Ice(Part):
    thickness: Positive = described_field("[m] radial thickness")
    density: Positive = described_field("[kg/m3] density of the ice")


class Rope(Part):
    """A uniform elastic rope, its temperature and its ice."""

    model_config = ConfigDict(json_schema_extra=lambda schema: schema["required"].remove("EA"))
    mass_per_length: Positive = described_field("[kg/m] mass of the cable per stretched length at rest")
    EA: Positive = described_field(
        "[N] axial stiffness per strain of the cable stretched at rest; of the unstretched: EA - T; default E section"
    )
    E: Positive | None = described_field("[Pa] modulus of elasticity of the cable", None)
    section: Positive | None = described_field("[m2] metallic section of the cable", None)
    wire: Positive | None = described_field("[m] diameter of its outer wires", None)
    diameter: Positive | None = described_field("[m] of the cable without ice", None)
    breaking_load: Positive | None = described_field("[N] tension at which the cable breaks", None)
    temperature: Celsius | None = described_field("[C] during the run", None)
    reference_temperature: Celsius | None = described_field("[C] at which the lengths and tensions given hold", None)
    expansion: Annotated[float, number_between(-1e-3, 1e-3)] | None = described_field(
        "[1/K] thermal expansion; steel 1.2e-5", None
    )
    ice: number_or_table_type(POSITIVE, Ice) | None = described_field(  # type: ignore[valid-type]
        "[kg/m] of the cable at the reference temperature", None
    )

    @model_validator(mode="before")
    @classmethod
    def _fill_EA_from_section(cls, data: Any) -> Any:
        """EA from E and section; a negative one is a fault of its own."""
        values = data if isinstance(data, dict) else {}
        E, section = values.get("E"), values.get("section")
        if isinstance(E, int | float) and isinstance(section, int | float):
            return {"EA": abs(E * section), **data}
        return data

    def cross_field_faults(self, written_values: Mapping[str, Any]) -> list[str]:
        """Faults of stiffness, ice and heat, one line each."""
        faults = self._stiffness_faults(written_values)
        if self.temperature is not None:
            needs = [name for name in ("reference_temperature", "expansion") if written_values.get(name) is None]
            faults += [f"{name}: missing; must be given with temperature" for name in needs]
        if isinstance(self.ice, Ice) and written_values.get("diameter") is None:
            faults.append("diameter: missing; must be given with the thickness of ice")
        return faults

    def _stiffness_faults(self, written_values: Mapping[str, Any]) -> list[str]:
        missing = [name for name in ("E", "section") if written_values.get(name) is None]
        if len(missing) == 1:
            other = "section" if missing == ["E"] else "E"
            return [f"{missing[0]}: missing; must be given with {other}"]
        of_section = (self.E or 0.0) * (self.section or 0.0)
        both_given = bool(self.EA and of_section)
        if both_given and abs(self.EA / of_section - 1.0) > SAME_STIFFNESS:
            must = f"must be E section = {of_section:.6g} N within {SAME_STIFFNESS:.0%}, or left out"
            return [f"EA = {self.EA!r}: {must}"]
        return []

    @property
    def has_heat_or_ice(self) -> bool:
        """Whether it differs from the rope as described."""
        return self.thermal_strain != 0.0 or self.ice is not None

    @property
    def thermal_strain(self) -> float:
        """Thermal strain a dT [-]."""
        if self.temperature is None or self.expansion is None or self.reference_temperature is None:
            return 0.0
        return self.expansion * (self.temperature - self.reference_temperature)

    @property
    def ice_mass_per_length(self) -> float:
        """Mass of the ice [kg/m] at the reference; r pi e (d + e) for a layer."""
        if isinstance(self.ice, Ice):
            assert self.diameter is not None
            return self.ice.density * math.pi * self.ice.thickness * (self.diameter + self.ice.thickness)
        return self.ice or 0.0

    @property
    def notes(self) -> list[str]:
        """Remarks on values probably given in another unit."""
        notes = []
        for name in ("temperature", "reference_temperature"):
            warm = getattr(self, name)
            if warm is not None and warm > 100.0:  # C
                celsius = f"{warm - 273.15:.3g} C"
                notes.append(f"cable.{name} = {warm:g} C is hotter than water boils; were kelvin meant? ({celsius})")
        thickest = {"diameter": (0.3, "m", 1e-3), "section": (0.05, "m2", 1e-6)}  # and what mm are in m
        for name, (most, unit, si) in thickest.items():
            value = getattr(self, name)
            if value is not None and value > most:
                meant = f"were m{unit} meant? ({value * si:.3g} {unit})"
                notes.append(f"cable.{name} = {value:g} {unit} is that of no rope; {meant}")
        return notes

    @property
    def diameter_with_ice(self) -> float:
        """Diameter [m] with ice."""
        assert self.diameter is not None
        return self.diameter + (2.0 * self.ice.thickness if isinstance(self.ice, Ice) else 0.0)


class Damping(Part):
    rate: NonNegative = described_field("[1/s] force per momentum of the cable")


RATIO = Admits("a ratio of critical from 0 to 1 (0.01 is 1 %)", ge=0.0, le=1.0)


class Cable(Rope):
    """The cable of one span; exactly one of length, sag and horizontal_tension."""

    damping: number_or_table_type(RATIO, Damping) = described_field(  # type: ignore[valid-type]
        "[-] ratio of critical in the first mode of the empty cable", 0.0
    )
    length: Positive | None = described_field("[m] stretched arc length at rest", None)
    sag: Positive | None = described_field("[m] largest vertical distance below the chord at rest", None)
    horizontal_tension: Positive | None = described_field("[N] horizontal part of the tension at rest", None)

    def cross_field_faults(self, written_values: Mapping[str, Any]) -> list[str]:
        return exactly_one_faults(SHAPES, written_values) + super().cross_field_faults(written_values)


class Supports(Part):
    """Two fixed points; the left one is the origin."""

    span: Positive = described_field("[m] horizontal distance of the supports")
    drop: Real = described_field("[m] right support below the left one: positive", 0.0)


def catenary_with_heat_and_ice(gravity: float, cable: Cable, supports: Supports) -> Catenary:
    """The catenary with heat and ice; ValueError where `no_catenary_fault` finds one."""
    cold = reference_catenary(gravity, cable, supports)
    if not cable.has_heat_or_ice:
        return cold
    l = cold.length
    T = cold.mean_tension
    thermal_strain = cable.thermal_strain
    weight = (cable.mass_per_length + cable.ice_mass_per_length) * gravity * l

    def catenary_at(z: float) -> Catenary:
        l_2 = Catenary.from_sag_parameter(supports.span, supports.drop, 1.0, z).length
        return Catenary.from_sag_parameter(supports.span, supports.drop, weight / l_2, z)

    def excess_length(z: float) -> float:
        """l_2 minus that of rule 2, from l - chord: a taut cable keeps digits."""
        now = catenary_at(z)
        stretch = thermal_strain + (1.0 + thermal_strain) * (now.mean_tension - T) / (cable.EA + T)
        return now.excess_over_chord - cold.excess_over_chord - l * stretch

    return catenary_at(bisect_zero(excess_length, Z_MIN, Z_MAX))


def reference_catenary(gravity: float, cable: Cable, supports: Supports) -> Catenary:
    """The described catenary, without heat and ice."""
    weight = cable.mass_per_length * gravity
    if cable.length is not None:
        return Catenary.from_length(supports.span, supports.drop, weight, cable.length)
    if cable.sag is not None:
        return Catenary.from_sag(supports.span, supports.drop, weight, cable.sag)
    assert cable.horizontal_tension is not None
    return Catenary(supports.span, supports.drop, weight, cable.horizontal_tension)


def no_catenary_fault(gravity: float, cable: Cable, supports: Supports) -> str:
    """Why there is no catenary."""
    span = supports.span
    drop = supports.drop
    if abs(drop) > STEEPEST * span:
        limit = STEEPEST * span
        return f"supports.drop = {drop!r}: must be from {-limit:.6g} to {limit:.6g}, {STEEPEST:g} spans"
    name = next(name for name in SHAPES if getattr(cable, name) is not None)
    value = getattr(cable, name)
    weight = cable.mass_per_length * gravity
    taut = Catenary.from_sag_parameter(span, drop, weight, Z_MIN)
    deep = Catenary.from_sag_parameter(span, drop, weight, Z_MAX)
    low, high = sorted((getattr(taut, name), getattr(deep, name)))
    smallest = f"{low:.6g}"
    if name == "length":  # nearer to the chord, the sag has less than four digits
        low = taut.chord * (1.0 + 1e-12)
        smallest = f"{low!r}"  # a length counts by its excess over the chord
    if low <= value <= high:
        try:
            catenary_with_heat_and_ice(gravity, cable, supports)
        except ValueError:  # `bisect_zero` found no root
            name = "temperature" if cable.ice is None else "ice"
            return (
                f"cable.{name} = {short_text(getattr(cable, name))}: must be less extreme; no cable at rest was found"
            )
        return ""
    fault = f"cable.{name} = {value!r}: must be from {smallest} to {high:.6g} with these supports"
    if name == "length" and value < low:
        if value <= taut.chord:
            return f"{fault} (the supports are {taut.chord!r} m apart)"
        return f"{fault} (for a cable this taut give sag or horizontal_tension)"
    return fault


def stretch_fault(gravity: float, cable: Cable, supports: Supports) -> str:
    """Whether the cable is longer than twice its unstretched length."""
    catenaries = [f(gravity, cable, supports) for f in (reference_catenary, catenary_with_heat_and_ice)]
    largest = max(catenary.max_tension for catenary in catenaries)
    if largest < cable.EA:
        return ""
    shape = next(f"cable.{name} = {value!r}" for name in SHAPES if (value := getattr(cable, name)) is not None)
    why = "or the cable hangs at more than twice its unstretched length"
    source = " (E section)" if (cable.E or 0.0) * (cable.section or 0.0) == cable.EA else ""
    must = f"must be > {largest:.6g} N, the largest static tension with {shape}"
    return f"cable.EA = {cable.EA!r}{source}: {must}, {why}"
