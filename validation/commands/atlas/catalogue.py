"""How methods fail (catalogue.toml), with cases of failure and remedy, and the measures that they name."""

import json
import math
from functools import cache
from typing import Any, Literal

import numpy as np
from scipy.linalg import eigvals

from cablefem import newmark
from cablefem.response import Array, Response
from cablefem.scene import Scene
from galerkin.bases.fourier import Fourier
from galerkin.equations import GalerkinSystem
from validation.commands.atlas import specimens
from validation.commands.modes.study import scaled_cable_frequencies
from validation.commands.paper import measured
from validation.commands.paper.vibration import relative_free_vibration_energy
from validation.core import measures, running, store
from validation.core.flags import MAX_GAIN
from validation.core.trust import convergence_limit, max_relative_path_gap_past_slack
from validation.page import page

Row = dict[str, Any]
Changes = dict[str, float]  # of groups of the level scene

CATALOGUE: tuple[Row, ...] = tuple(store.read_packaged_toml(__package__, "catalogue.toml")["row"])


def measure_failure_and_remedy(row: Row) -> Row:
    """A row of the page: its words, what was measured, whether the failure shows and the remedy works."""
    failure = _evaluate_by_name(row["shows"])
    cure = _evaluate_by_name(row["cures"])
    out = {k: row[k] for k in ("name", "scene", "method", "symptom", "cause", "remedy")}
    out |= {"failure": failure, "cure": cure}
    out["failure_shown"] = condition_holds(row["shown"], failure)
    out["remedy_works"] = condition_holds(row["cured"], cure)
    return out


def _evaluate_by_name(expressions: dict[str, str]) -> dict[str, float]:
    """Values by name; nan for None."""
    out = {}
    for name, expression in expressions.items():
        value = _evaluate(expression)
        out[name] = math.nan if value is None else float(value)
    return out


def condition_holds(condition: str, values: dict[str, float]) -> bool:
    """Whether a condition on values, which it names x.NAME, is true."""
    return bool(_evaluate(condition, x=values))


def _evaluate(expression: str, **names: Any) -> Any:
    return page.compile_template_expression(expression)(**MEASURES, **names)


def level_scene(**groups: float) -> Scene:
    return Scene.load("level").variant(**groups)


def run_on_level(method: str, groups: Changes | None = None, **how: Any) -> Response:
    """Run a method, or one with a planted fault, on the level scene; each run is made once."""
    return _run_of_json_key(json.dumps([method, groups or {}, how]))


@cache
def _run_of_json_key(key: str) -> Response:
    """key : method, groups and settings as JSON, which a cache can compare."""
    method, groups, how = json.loads(key)
    return running.run(level_scene(**groups), specimens.PLANTED.get(method, method), **how)


def relative_path_gap(
    a: Response, b: Response, low: float = measures.WINDOW[0], high: float = measures.WINDOW[1]
) -> float:
    """Largest distance of two paths, over the largest deflection of the second."""
    window = low, min(high, a.reached, b.reached)
    return measures.relative_path_gap(a, b, window).largest


def path_error(method: str, model: str = "full", groups: Changes | None = None, **how: Any) -> float:
    """Largest path error; infinite for a run that broke before 0.80.

    The reference is right to 2e-4 (level) and takes a second.
    """
    r = run_on_level(method, groups, model=model, law="elastic", **how)
    if r.reached < measures.WINDOW[1]:
        return math.inf
    reference = run_on_level("following-p2", groups, model=model, elements=20, steps=1500)
    return relative_path_gap(r, reference)


def energy_gain(method: str, **how: Any) -> float:
    """The energy gained without work, over weight times deflection."""
    gain = run_on_level(method, **how).energy_gain
    return math.inf if gain is None else gain


def tension_ripple(method: str, **how: Any) -> float:
    """Rms ripple of the tension off the mass over H, see `measured.tension_ripple_over_H`."""
    r = run_on_level(method, law="elastic", **how)
    return measured.tension_ripple_over_H(r, min_distance_from_mass=measures.JUMP_WIDTH)


@cache
def energy_history_of_large_vibration(scheme: str) -> Array:
    """The energy of a free cable over that at the start, at every step, in a large vibration of the second mode."""
    large: dict[str, Any] = {"terms": 30, "speed": 0.1, "sine": 2, "dt": 0.04, "steps": 200}
    groups = level_scene().groups
    return relative_free_vibration_energy(groups, newmark.scheme(scheme), **large)


def remaining_energy_of_small_vibration(scheme: str, **how: float) -> float:
    """Energy at the end of a vibration small enough to be linear, over that after its first steps."""
    small: dict[str, Any] = {"terms": 16, "speed": 1e-3, "sine": 2, "dt": 0.05, "steps": 600}
    groups = level_scene().groups
    energy = relative_free_vibration_energy(groups, newmark.scheme(scheme, **how), **small)
    return energy[-1] / energy[100]  # without the axial waves of the start


def first_wavelet_frequency_error(level: int, reading: Literal["literal", "scaling"]) -> float:
    """Relative error of the first frequency; exact: the linearised catenary, by collocation to 11 digits."""
    exact = 5.3454766022
    (first,) = scaled_cable_frequencies(level_scene().groups, level=level, reading=reading, n=1)
    return abs(float(first) / exact - 1.0)


def path_gap_past_slack(a: Response, b: Response, until: float = 1.0) -> float:
    """Distance of two paths on the slack cable, as far as both go."""
    end = min(a.reached, b.reached, until)
    return max_relative_path_gap_past_slack(a, b, end)


def light_mass_entry_error(**finer: float) -> float:
    """The path error of a light mass just after the entry; finer : settings for its layer."""
    light = {"mu": 0.01}
    r = run_on_level("following-p2", light, elements=8, steps=400, **finer)
    fine = run_on_level("following-p2", light, elements=40, steps=3000, grading=30.0, entry=0.01)
    s_o = r.length * np.array([0.02, 0.05])
    error = np.interp(s_o, r.s_o, r.v) - np.interp(s_o, fine.s_o, fine.v)
    return float(np.abs(error).max() / fine.max_deflection)


def compression_onset(method: str, **how: Any) -> float:
    """s_o/l of the mass when a point of the cable is first compressed, else infinite."""
    r = run_on_level(method, law="elastic", **how)
    smallest = r.fields.T_pointwise.min(axis=1)  # of each frame
    pressed = r.fields.s_o[smallest < 0.0]
    return float(pressed[0] / r.length) if pressed.size else math.inf


def coarse_and_fine_stiff_runs(model: str) -> list[Response]:
    """A run with 8 and one with 16 elements on a cable of alpha = 1e6."""
    stiff = {"alpha": 1e6}
    return [run_on_level("following-p2", stiff, model=model, elements=n, steps=50 * n) for n in (8, 16)]


def tension_gap_before_slack(a: Response, b: Response, field: str = "T") -> float:
    """The rms distance of two tension fields over H, from s_o/l = 0.02 to 0.2."""
    window = 0.02, min(0.2, a.reached, b.reached)
    return measures.rms_tension_gap_over_H(a, b, window, field)


def _level_system_and_duration(terms: int) -> tuple[GalerkinSystem, float]:
    system = GalerkinSystem(level_scene().groups, Fourier(terms))
    return system, system.phases[-1][1]


def frozen_growth_factor(terms: int) -> float:
    """Growth over the crossing, by eigenvalues of the system frozen at instants."""
    system, end = _level_system_and_duration(terms)
    instants = [0.1 * end, 0.5 * end, 0.9 * end]
    rate = max(specimens.frozen_growth_rate(system, t) for t in instants)
    return float(np.exp(end * rate))


def explicit_step_count(terms: int, dt_over_limit: float) -> int:
    """Number of steps of a crossing; the limit of stability is 2/omega_max with the mass at mid-span."""
    system, end = _level_system_and_duration(terms)
    M, _, K = specimens.frozen_matrices(system, 0.5 * end)
    omega_max = math.sqrt(eigvals(K, M).real.max())
    return round(end * omega_max / 2.0 / dt_over_limit)


_FUNCTIONS = (
    run_on_level, relative_path_gap, path_error, energy_gain, tension_ripple, energy_history_of_large_vibration,
    remaining_energy_of_small_vibration, first_wavelet_frequency_error, path_gap_past_slack, light_mass_entry_error,
    compression_onset, coarse_and_fine_stiff_runs, tension_gap_before_slack, frozen_growth_factor, explicit_step_count,
    convergence_limit,
)  # fmt: skip
MEASURES: dict[str, Any] = {f.__name__: f for f in _FUNCTIONS} | {"most_gain": MAX_GAIN}
