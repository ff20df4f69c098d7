"""Frequencies of the cable without its mass, from both solvers and the exact theory."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cablefem.response import Array, write_json
from cablefem.scene import Scene
from validation.core.agreement import Agreement
from validation.core.bounds import Bound, Part

COUNT = 10
ROUNDING = 1e-10  # relative; dense eigenvalue solvers lose the ratio of the stiffest axial to the lowest mode
EXACT = "exact"


@dataclass(frozen=True, slots=True)
class Modes:
    """First frequencies by method, `exact` last, and each method's verdict against it."""

    omega: dict[str, Array]  # method -> (COUNT,) omega l sqrt(rho/H), ascending
    rows: list[Agreement]

    def write(self, out: Path) -> None:
        write_json(out / "modes.json", {name: omega.tolist() for name, omega in self.omega.items()})


def modes(scene: Scene | str | Path) -> Modes:
    """Compute the frequencies with each method's own error bar: its change from half the resolution.

    elements : scikit-fem's own assembly, degree 8; fourier, wavelet : the Galerkin bases, each value an upper bound;
    exact : the linearised catenary solved by collocation (validation/oracles/catenary_modes.py).
    """
    from cablefem.elements import modes as elements
    from galerkin import modes as galerkin
    from galerkin.bases.daubechies import Daubechies
    from galerkin.bases.fourier import Fourier
    from validation.oracles import catenary_modes

    groups = (scene if isinstance(scene, Scene) else Scene.load(scene)).groups
    pairs = {
        "elements": [elements.bare_frequencies(groups, elements=n, n=COUNT) for n in (10, 5)],
        "fourier": [galerkin.bare_frequencies(groups, Fourier(n), n=COUNT) for n in (120, 60)],
        "wavelet": [
            galerkin.bare_frequencies(groups, Daubechies(order=4, level=level, reading="literal"), n=COUNT)
            for level in (4, 3)
        ],
    }
    exact = catenary_modes.solve(groups.sigma, groups.alpha, groups.c, count=COUNT)
    rows = []
    for name, (fine, coarse) in pairs.items():
        gap, bar = np.abs(fine / exact.omega - 1.0), np.abs(fine / coarse - 1.0)
        parts = Part(name, float(bar.max()), "the change from half the resolution"), Part("rounding", ROUNDING)
        rows.append(Agreement(name, float(gap.max()), Bound("own bar", parts)))
    return Modes({name: fine for name, (fine, _) in pairs.items()} | {EXACT: exact.omega}, rows)
