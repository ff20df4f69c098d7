"""Frequencies of the cable without its mass, from both solvers and the exact theory."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from cablefem.response import Array, write_json
from cablefem.scene import Groups, Scene
from validation.core.agreement import Agreement, Bound, BoundPart
from validation.core.sidebyside import Progress, no_progress

COUNT = 10
EXACT = "exact"


@dataclass(frozen=True, slots=True)
class Modes:
    """First frequencies by method, `exact` last, and each method's verdict against it."""

    omega: dict[str, Array]  # method -> (COUNT,) omega l sqrt(rho/H), ascending
    rows: list[Agreement]


def scaled_cable_frequencies(
    groups: Groups, *, elements: int | None = None, terms: int | None = None, level: int = 0, degree: int = 8,
    reading: Literal["literal", "scaling"] = "literal", **how: Any,
) -> Array:  # fmt: skip
    """Frequencies omega l sqrt(rho/H) of the bare cable by elements, by so many sines, or by wavelets up to a level.

    elements : scikit-fem's own assembly;  how : the model, and n, how many.
    """
    from cablefem.elements import modes as by_elements
    from galerkin.bases import Daubechies, Fourier
    from galerkin.modes import scaled_frequencies

    if elements is not None:
        return by_elements.scaled_frequencies(groups, elements=elements, degree=degree, **how)
    basis: Any = Daubechies(order=4, level=level, reading=reading) if terms is None else Fourier(terms)
    return scaled_frequencies(groups, basis, **how)


def modes(scene: Scene, out: Path | None = None, progress: Progress = no_progress) -> Modes:
    """Compute the frequencies with each method's own error bar: its change from half the resolution.

    exact : the linearised catenary, see `oracles.catenary_modes`.  out : folder for modes.json.
    """
    from validation.oracles import catenary_modes

    groups = scene.groups
    pairs = {
        "elements": [scaled_cable_frequencies(groups, elements=n, n=COUNT) for n in (10, 5)],
        "fourier": [scaled_cable_frequencies(groups, terms=n, n=COUNT) for n in (120, 60)],
        "wavelet": [scaled_cable_frequencies(groups, level=n, n=COUNT) for n in (4, 3)],
    }
    exact = catenary_modes.solve_modes(groups.sigma, groups.alpha, groups.c, count=COUNT)
    omega: dict[str, Array] = {}
    rows = []
    rounding = BoundPart("rounding", 1e-10)  # relative; dense solvers lose the ratio of the stiffest to the lowest mode
    for name, (fine, coarse) in pairs.items():
        omega[name] = fine
        gap = float(np.abs(fine / exact.omega - 1.0).max())
        bar = float(np.abs(fine / coarse - 1.0).max())
        change = BoundPart(name, bar, "the change from half the resolution")
        rows.append(Agreement(name, gap, Bound("own bar", (change, rounding))))
    omega[EXACT] = exact.omega
    if out is not None:
        write_json(out / "modes.json", {name: values.tolist() for name, values in omega.items()})
    return Modes(omega, rows)
