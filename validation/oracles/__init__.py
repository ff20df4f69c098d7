"""Exact answers, one per file: each states its equation, its source, where it holds and how exact it is.

Units of every oracle: length l, tension T (horizontal tension H of a sagging cable), time l sqrt(rho/T); mu =
M/(rho l), sigma = rho g l/T, alpha = EA/T; v and y down; speeds over the wave speed.  No oracle uses a solver.
"""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any, NamedTuple

from validation.oracles import (
    accelerating_force,
    accelerating_mass,
    catenary_modes,
    coupled_travel,
    curved_cable,
    foundation,
    harmonic_force,
    inextensible,
    irvine,
    massless_string,
    moving_force,
    moving_mass,
    running_apart,
)


class Oracle(NamedTuple):
    """One exact answer, as the command line lists it."""

    name: str
    title: str
    source: str
    validity: str
    module: ModuleType
    answer: Callable[..., Any]  # its main function


ORACLES = (
    Oracle(
        "moving-force",
        "constant force at constant speed on a taut string",
        "Fryba 1972",
        "any speed, before and after the exit",
        moving_force,
        moving_force.displacement,
    ),
    Oracle(
        "moving-mass",
        "mass with any travel below (or above) the wave speed on a taut string, with all reflections",
        "Smith 1964; Dyniewicz & Bajer 2009",
        "|xi'| < 1 or xi' >= 1 throughout, any mass",
        moving_mass,
        moving_mass.solve,
    ),
    Oracle(
        "massless-string",
        "mass at constant speed on a string without inertia",
        "Fryba 1972; Smith 1964",
        "0 < T l/(2 M V^2) <= 1e4",
        massless_string,
        massless_string.path,
    ),
    Oracle(
        "accelerating-force",
        "force accelerating or braking through the wave speed",
        "Flaherty 1968; Sagartz & Forrestal 1975",
        "infinite string, constant acceleration",
        accelerating_force,
        accelerating_force.displacement,
    ),
    Oracle(
        "curved-cable",
        "weight and centrifugal force of an accelerating mass on a slightly curved cable",
        "Forrestal, Bickel & Sagartz 1975",
        "infinite cable of small sag, no inertia of the mass",
        curved_cable,
        curved_cable.displacement,
    ),
    Oracle(
        "accelerating-mass",
        "mass accelerating from rest through the wave speed",
        "Rodeman, Longcope & Shampine 1976",
        "infinite string, any time",
        accelerating_mass,
        accelerating_mass.path,
    ),
    Oracle(
        "running-apart",
        "two equal forces running apart",
        "Kanninen & Florence 1967",
        "infinite string, any speed",
        running_apart,
        running_apart.displacement,
    ),
    Oracle(
        "harmonic-force",
        "harmonic force at constant speed, steady",
        "Pierucci (reference 12 of Al-Qassab et al. 2003)",
        "infinite string, not at the wave speed",
        harmonic_force,
        harmonic_force.displacement,
    ),
    Oracle(
        "foundation",
        "force at constant speed on a string on an elastic foundation, steady",
        "Yen & Tang 1970, linear part",
        "infinite string, not at the wave speed",
        foundation,
        foundation.deflection,
    ),
    Oracle(
        "coupled-travel",
        "mass sliding freely or driven, its travel coupled to the string",
        "D'Acunto (reference 9 of Al-Qassab et al. 2003), solved here",
        "infinite string, start below the wave speed",
        coupled_travel,
        coupled_travel.solve,
    ),
    Oracle(
        "irvine",
        "frequencies of a flat elastic cable",
        "Irvine & Caughey 1974",
        "small sag",
        irvine,
        irvine.frequencies,
    ),
    Oracle(
        "inextensible",
        "frequencies of a flat inextensible cable",
        "Tadjbakhsh & Wang 1994",
        "small sag, no stretch",
        inextensible,
        inextensible.frequencies,
    ),
    Oracle(
        "catenary-modes",
        "frequencies and modes of an elastic catenary, u and v",
        "Henghold, Russell & Morgan 1977; Wu & Chen 1989",
        "any sag, slope and stiffness",
        catenary_modes,
        catenary_modes.solve,
    ),
)
