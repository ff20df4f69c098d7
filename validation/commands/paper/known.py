"""What the expressions of claims.toml may name: measures, runs, scenes, and numbers that take a while."""

import json
import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cablefem.scene import Groups
from galerkin.bases import Basis
from galerkin.bases.daubechies import Daubechies
from galerkin.bases.fourier import Fourier
from galerkin.modes import scaled_frequencies
from validation.commands.paper import gibbs, measured, outlook, vibration
from validation.commands.paper.runs import SETTINGS, Runs
from validation.core import store
from validation.core.sidebyside import Progress
from validation.oracles import catenary_modes

ByName = dict[str, Any]


def expression_variables(runs: Runs, numbers: ByName) -> ByName:
    """What expressions and templates may name: `m`, runs, scenes; a scene's name is that of its converged run.

    numbers : of `compute_or_load_numbers`.
    """
    converged = {scene: x.ladder.finest for scene, x in runs.reference.items()}
    constants = {"m": measured, "median": np.median, "pi": math.pi, "asked": SETTINGS}
    of_runs = {"scenes": runs.scenes, "runs": runs.by_name, "reference": runs.reference}
    return constants | of_runs | converged | numbers


def compute_or_load_numbers(runs: Runs, file: Path, report: Progress, quick: bool = False) -> ByName:
    """Numbers beyond runs: figure 2, overshoot beside the mass, energy in free vibration, the outlook's trolley.

    file : where they are stored, and read again if scenes and settings are the same.
    quick : overshoots of the three coarsest of each ladder, a trolley on fewer elements.
    """
    count = 3 if quick else None
    overshoot = SETTINGS["overshoot"]
    ladders = {method: ladder[:count] for method, ladder in overshoot["terms"].items()}
    level = runs.scenes["level"]
    inclined = runs.scenes["inclined"]
    jobs: dict[str, Callable[[], Any]] = {
        "frequencies": lambda: frequency_convergence(level.groups),
        "overshoot": lambda: {
            method: [gibbs.tension_overshoot_over_H(inclined.groups, method, terms) for terms in ladder]
            for method, ladder in ladders.items()
        },
        "vibration": lambda: _max_vibration_energies(level.groups),
        "outlook": lambda: outlook.rides_by_thrust_angle(quick),
    }
    conditions = level.to_toml(), inclined.to_toml(), overshoot | {"terms": ladders}, SETTINGS["vibration"], quick
    keyed = {json.dumps((name, *conditions)): job for name, job in jobs.items()}
    results = store.compute_and_store_missing(file, keyed, lambda job: job(), partial(report, "numbers"))
    return dict(zip(jobs, results.values(), strict=True))


def _max_vibration_energies(groups: Groups) -> dict[str, float]:
    """Largest relative energies of the trapezoidal rule with few and many steps, and of Gauss's with few."""
    coarse = SETTINGS["vibration"]["coarse_steps"]
    fine = SETTINGS["vibration"]["fine_steps"]
    energy = partial(vibration.max_relative_vibration_energy, groups)
    return {"coarse": energy(coarse), "fine": energy(fine), "kept": energy(coarse, "gauss")}


def frequency_convergence(groups: Groups) -> ByName:
    """omega_1 against the number of terms in both bases, with the exact and the linear theory's value."""
    exact = catenary_modes.solve_modes(groups.sigma, groups.alpha, groups.c, count=10).omega
    wavelets = [Daubechies(order=4, level=level, reading="literal") for level in range(4)]
    sines = [Fourier(n) for n in (*range(1, 21), 24, 30, 40, 59)]

    def frequencies_of(bases: Sequence[Basis]) -> ByName:
        first = [float(scaled_frequencies(groups, basis, n=1)[0]) for basis in bases]
        return {"terms": [basis.n for basis in bases], "omega_1": first}

    def max_error_of_ten(basis: Basis) -> float:
        ratios = scaled_frequencies(groups, basis, n=10) / exact
        return float(np.abs(ratios - 1.0).max())

    linear = measured.linear_first_frequency(groups.sigma, groups.alpha)
    worst = {"fourier 30": max_error_of_ten(Fourier(30)), "wavelet 31": max_error_of_ten(wavelets[2])}
    return {
        "fourier": frequencies_of(sines), "wavelet": frequencies_of(wavelets), "exact": float(exact[0]),
        "linear_theory": linear, "worst_of_ten": worst,
    }  # fmt: skip
