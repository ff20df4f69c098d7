"""Frequencies of the cable without its mass, from both solvers and the exact theory."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from cablefem.response import Array, write_json
from cablefem.scene import Groups, Scene
from validation.core.agreement import Agreement, Bound, BoundPart
from validation.core.sidebyside import Progress, no_progress

COUNT = 10


@dataclass(frozen=True, slots=True)
class Modes:
    """First frequencies by method, `exact` last, and each method's verdict against it."""

    omega: dict[str, Array]  # method -> (COUNT,) omega l sqrt(rho/H), ascending
    hertz: Array  # (COUNT,) the exact ones [Hz]
    rows: list[Agreement]


def scaled_cable_frequencies(
    groups: Groups, *, elements: int | None = None, terms: int | None = None, level: int = 0, degree: int = 8,
    reading: Literal["literal", "scaling"] = "literal", **how: Any,
) -> Array:  # fmt: skip
    """Frequencies omega l sqrt(rho/H) of the bare cable by elements, by so many sines, or by wavelets up to a level.

    elements : scikit-fem's own assembly;  how : the model, and n, how many (None: all).
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
        "elements": [scaled_cable_frequencies(groups, elements=n, n=None) for n in (10, 5)],
        "fourier": [scaled_cable_frequencies(groups, terms=n, n=None) for n in (120, 60)],
        "wavelet": [scaled_cable_frequencies(groups, level=n, n=None) for n in (4, 3)],
    }
    exact = catenary_modes.solve_modes(groups.sigma, groups.alpha, groups.c, count=COUNT).omega
    found = Modes({}, exact / (2.0 * math.pi * scene.time_scale), [])
    for name, (fine, coarse) in pairs.items():
        found.omega[name] = omega = fine[:COUNT]
        change = np.abs(omega / coarse[:COUNT] - 1.0).max()
        rounding = np.finfo(float).eps * (fine[-1] / fine[0]) ** 2  # dense solvers lose the ratio of squares
        bar = (
            BoundPart(name, change, "the change from half the resolution"),
            BoundPart("rounding", rounding, "of the highest frequency, in the lowest"),
        )
        gap = np.abs(omega / exact - 1.0).max()
        found.rows.append(Agreement(name, gap, Bound("own bar", bar)))
    found.omega["exact"] = exact
    if out is not None:
        omega_lists = {name: values.tolist() for name, values in found.omega.items()}
        rows = [row.to_json() for row in found.rows]
        write_json(out / "modes.json", {"hertz": found.hertz.tolist(), "rows": rows, **omega_lists})
    return found
