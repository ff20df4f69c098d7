"""What the expressions of claims.toml may name: measures, runs, scenes, and numbers that take a while."""

import json
import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from galerkin.bases import Basis
from galerkin.bases.daubechies import Daubechies
from galerkin.bases.fourier import Fourier
from galerkin.modes import bare_frequencies
from validation.commands.paper import gibbs, measured, vibration
from validation.commands.paper.runs import SAID, Runs
from validation.core import store
from validation.core.sidebyside import Progress
from validation.oracles import catenary_modes


def names(runs: Runs, beyond: dict[str, Any]) -> dict[str, Any]:
    """Everything by name; beyond : of `numbers`.  A scene's name is that of its converged run."""
    converged = {scene: x.ladder.run for scene, x in runs.reference.items()}
    return {
        "m": measured, "median": np.median, "pi": math.pi, "asked": SAID, "scenes": runs.scenes,
        "runs": runs.by_name, "reference": runs.reference, **converged, **beyond,
    }  # fmt: skip


def numbers(runs: Runs, file: Path, report: Progress, quick: bool = False) -> dict[str, Any]:
    """Numbers beyond runs: figure 2, overshoot beside the mass, energy in free vibration.

    file : where they are stored, and read again if scenes and settings are the same.
    quick : overshoots of the three coarsest of each ladder.
    """
    ladders = {method: ladder[: 3 if quick else None] for method, ladder in SAID["overshoot"]["terms"].items()}
    level = runs.scenes["level"]
    inclined = runs.scenes["inclined"]
    swing = SAID["vibration"]
    energy = partial(vibration.energy_ratio, level.groups)
    jobs: dict[str, Callable[[], Any]] = {
        "frequencies": lambda: figure_2(runs),
        "overshoot": lambda: gibbs.overshoots(inclined.groups, ladders),
        "vibration": lambda: {
            "coarse": energy(swing["coarse_steps"]), "fine": energy(swing["fine_steps"]),
            "kept": energy(swing["coarse_steps"], "gauss"),
        },
    }  # fmt: skip
    same = level.to_toml(), inclined.to_toml(), SAID["overshoot"] | {"terms": ladders}, swing
    keyed = {json.dumps((name, *same)): job for name, job in jobs.items()}
    found = store.each_once(file, keyed, lambda job: job(), partial(report, "numbers"))
    return dict(zip(jobs, found.values(), strict=True))


def figure_2(runs: Runs) -> dict[str, Any]:
    """omega_1 against the number of terms in both bases, with the exact and the linear theory's value."""
    groups = runs.scenes["level"].groups
    exact = catenary_modes.solve(groups.sigma, groups.alpha, groups.c, count=10).omega
    wavelets = [Daubechies(order=4, level=level, reading="literal") for level in range(4)]
    sines = [Fourier(n) for n in (*range(1, 21), 24, 30, 40, 59)]
    bases: dict[str, Sequence[Basis]] = {"fourier": sines, "wavelet": wavelets}

    def worst_of_ten(basis: Basis) -> float:
        return float(np.abs(bare_frequencies(groups, basis, n=10) / exact - 1.0).max())

    return {
        name: {"terms": [b.n for b in of], "omega_1": [float(bare_frequencies(groups, b, n=1)[0]) for b in of]}
        for name, of in bases.items()
    } | {
        "exact": float(exact[0]), "linear_theory": measured.linear_theory(groups.sigma, groups.alpha),
        "worst_of_ten": {"fourier 30": worst_of_ten(Fourier(30)), "wavelet 31": worst_of_ten(wavelets[2])},
    }  # fmt: skip
