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
from galerkin.modes import scaled_frequencies
from validation.commands.paper import gibbs, measured, outlook, vibration
from validation.commands.paper.runs import SETTINGS, Runs
from validation.core import store
from validation.core.sidebyside import Progress
from validation.oracles import catenary_modes


def expression_variables(runs: Runs, others: dict[str, Any]) -> dict[str, Any]:
    """What expressions and templates may name: `m`, runs, scenes; a scene's name is that of its converged run.

    others : of `compute_or_load_numbers`.
    """
    converged = {scene: x.ladder.finest for scene, x in runs.reference.items()}
    return {
        "m": measured, "median": np.median, "pi": math.pi, "asked": SETTINGS, "scenes": runs.scenes,
        "runs": runs.by_name, "reference": runs.reference, **converged, **others,
    }  # fmt: skip


def compute_or_load_numbers(runs: Runs, file: Path, report: Progress, quick: bool = False) -> dict[str, Any]:
    """Numbers beyond runs: figure 2, overshoot beside the mass, energy in free vibration, the outlook's trolley.

    file : where they are stored, and read again if scenes and settings are the same.
    quick : overshoots of the three coarsest of each ladder, a trolley on fewer elements.
    """
    count = 3 if quick else None
    ladders = {method: ladder[:count] for method, ladder in SETTINGS["overshoot"]["terms"].items()}
    level = runs.scenes["level"]
    inclined = runs.scenes["inclined"]
    swing = SETTINGS["vibration"]
    energy = partial(vibration.max_relative_vibration_energy, level.groups)
    jobs: dict[str, Callable[[], Any]] = {
        "frequencies": lambda: first_frequency_by_terms(runs),
        "overshoot": lambda: gibbs.tension_overshoots(inclined.groups, ladders),
        "vibration": lambda: {
            "coarse": energy(swing["coarse_steps"]), "fine": energy(swing["fine_steps"]),
            "kept": energy(swing["coarse_steps"], "gauss"),
        },
        "outlook": lambda: outlook.ride_numbers_by_angle(quick),
    }  # fmt: skip
    conditions = level.to_toml(), inclined.to_toml(), SETTINGS["overshoot"] | {"terms": ladders}, swing, quick
    keyed = {json.dumps((name, *conditions)): job for name, job in jobs.items()}
    results = store.compute_and_store_missing(file, keyed, lambda job: job(), partial(report, "numbers"))
    return dict(zip(jobs, results.values(), strict=True))


def first_frequency_by_terms(runs: Runs) -> dict[str, Any]:
    """omega_1 against the number of terms in both bases, with the exact and the linear theory's value."""
    groups = runs.scenes["level"].groups
    exact = catenary_modes.solve_modes(groups.sigma, groups.alpha, groups.c, count=10).omega
    wavelets = [Daubechies(order=4, level=level, reading="literal") for level in range(4)]
    sines = [Fourier(n) for n in (*range(1, 21), 24, 30, 40, 59)]

    def frequencies_of(bases: Sequence[Basis]) -> dict[str, Any]:
        first = [float(scaled_frequencies(groups, basis, n=1)[0]) for basis in bases]
        return {"terms": [basis.n for basis in bases], "omega_1": first}

    def max_error_of_ten(basis: Basis) -> float:
        return float(np.abs(scaled_frequencies(groups, basis, n=10) / exact - 1.0).max())

    return {
        "fourier": frequencies_of(sines), "wavelet": frequencies_of(wavelets), "exact": float(exact[0]),
        "linear_theory": measured.linear_first_frequency(groups.sigma, groups.alpha),
        "worst_of_ten": {"fourier 30": max_error_of_ten(Fourier(30)), "wavelet 31": max_error_of_ten(wavelets[2])},
    }  # fmt: skip
