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
from validation.core.trust import convergence_limit, max_path_gap_past_slack
from validation.core.watch import MAX_GAIN
from validation.page import page

Row = dict[str, Any]
Groups = dict[str, float]  # of the level scene, changed

CATALOGUE: tuple[Row, ...] = tuple(store.read_packaged_toml(__package__, "catalogue.toml")["row"])


def measure_failure_and_remedy(row: Row) -> Row:
    """A row of the page: its words, what was measured, whether the failure shows and the remedy works."""
    failure = _evaluate_by_name(row["shows"])
    cure = _evaluate_by_name(row["cures"])
    words = {k: row[k] for k in ("name", "scene", "method", "symptom", "cause", "remedy")}
    return words | {
        "failure": failure, "cure": cure, "failure_shown": condition_holds(row["shown"], failure),
        "remedy_works": condition_holds(row["cured"], cure),
    }  # fmt: skip


def _evaluate_by_name(expressions: dict[str, str]) -> dict[str, float]:
    """Values by name; nan for None."""
    values = {name: _evaluate(expression) for name, expression in expressions.items()}
    return {name: math.nan if x is None else float(x) for name, x in values.items()}


def condition_holds(condition: str, values: dict[str, float]) -> bool:
    """Whether a condition on values, which it names x.NAME, is true."""
    return bool(_evaluate(condition, x=values))


def _evaluate(expression: str, **names: Any) -> Any:
    return page.compile_template_expression(expression)(**MEASURES, **names)


def level_scene(**groups: float) -> Scene:
    return Scene.load("level").variant(**groups)


def run_on_level(method: str, scene: Groups | None = None, **how: Any) -> Response:
    """Run a method, or one with a planted fault, on the level scene."""
    return _run_of_json_key(json.dumps([method, scene or {}, how]))


@cache
def _run_of_json_key(key: str) -> Response:
    """The run of a method, groups and settings, which are given as JSON so that it is made once."""
    method, scene, how = json.loads(key)
    return running.run(level_scene(**scene), specimens.PLANTED.get(method, method), **how)


def relative_path_gap(
    a: Response, b: Response, low: float = measures.WINDOW[0], high: float = measures.WINDOW[1]
) -> float:
    """Largest distance of two paths, over the largest deflection of the second."""
    return measures.relative_path_gap(a, b, (low, min(high, a.reached, b.reached))).largest


def path_error(method: str, model: str = "full", scene: Groups | None = None, **how: Any) -> float:
    """Largest path error; infinite for a run that broke before 0.80.

    The reference is right to 2e-4 (level) and takes a second.
    """
    r = run_on_level(method, scene, model=model, law="elastic", **how)
    if r.reached < measures.WINDOW[1]:
        return math.inf
    return relative_path_gap(r, run_on_level("following-p2", scene, model=model, elements=20, steps=1500))


def energy_gain(method: str, **how: Any) -> float:
    """The energy gained without work, over weight times deflection."""
    gain = run_on_level(method, **how).energy_gain
    return math.inf if gain is None else gain


def tension_ripple(method: str, **how: Any) -> float:
    """Rms ripple of the tension off the mass over H, see `measured.tension_ripple_over_H`."""
    return measured.tension_ripple_over_H(run_on_level(method, law="elastic", **how), min_distance=measures.JUMP_WIDTH)


@cache
def vibration_energy_history(scheme: str) -> Array:
    """The energy of a free cable over that at the start, at every step, in a large vibration of the second mode."""
    large: dict[str, Any] = {"terms": 30, "speed": 0.1, "sine": 2, "dt": 0.04, "steps": 200}
    return relative_free_vibration_energy(level_scene().groups, newmark.scheme(scheme), **large)


def remaining_vibration_energy(scheme: str, **how: float) -> float:
    """Energy at the end of a vibration small enough to be linear, over that after its first steps."""
    small: dict[str, Any] = {"terms": 16, "speed": 1e-3, "sine": 2, "dt": 0.05, "steps": 600}
    energy = relative_free_vibration_energy(level_scene().groups, newmark.scheme(scheme, **how), **small)
    return energy[-1] / energy[100]  # without the axial waves of the start


def frequency_error(level: int, reading: Literal["literal", "scaling"]) -> float:
    """Relative error of the first frequency; exact: the linearised catenary, by collocation to 11 digits."""
    first = float(scaled_cable_frequencies(level_scene().groups, level=level, reading=reading, n=1)[0])
    return abs(first / 5.3454766022 - 1.0)


def slack_path_gap(a: Response, b: Response, last: float = 1.0) -> float:
    """Distance of two paths on the slack cable, as far as both go."""
    return max_path_gap_past_slack(a, b, min(a.reached, b.reached, last))


def light_mass_entry_error(**finer: float) -> float:
    """The path error of a light mass just after the entry; finer : settings for its layer."""
    light = {"mu": 0.01}
    r = run_on_level("following-p2", light, elements=8, steps=400, **finer)
    fine = run_on_level("following-p2", light, elements=40, steps=3000, grading=30.0, entry=0.01)
    position = r.length * np.array([0.02, 0.05])
    error = np.interp(position, r.s_o, r.v) - np.interp(position, fine.s_o, fine.v)
    return float(np.abs(error).max() / fine.max_deflection)


def compression_onset(method: str, **how: Any) -> float:
    """s_o/l of the mass when a point of the cable is first compressed, else infinite."""
    r = run_on_level(method, law="elastic", **how)
    pressed = r.fields.s_o[r.fields.T_pointwise.min(axis=1) < 0.0]
    return float(pressed[0] / r.length) if pressed.size else math.inf


def stiff_cable_runs(model: str) -> tuple[Response, Response]:
    """A coarse and a finer run on a stiff cable."""
    a, b = (run_on_level("following-p2", {"alpha": 1e6}, model=model, elements=n, steps=50 * n) for n in (8, 16))
    return a, b


def taut_tension_gap(a: Response, b: Response, field: str = "T") -> float:
    """The rms distance of two tension fields over H, before the slack."""
    return measures.rms_tension_gap_over_H(a, b, (0.02, min(0.2, a.reached, b.reached)), field)


def frozen_growth_factor(terms: int) -> float:
    """Growth over the crossing, by eigenvalues of the system frozen at instants."""
    system = GalerkinSystem(level_scene().groups, Fourier(terms))
    end = system.phases[-1][1]
    rate = max(specimens.frozen_growth_rate(system, x * end) for x in (0.1, 0.5, 0.9))
    return float(np.exp(end * rate))


def explicit_step_count(terms: int, factor: float) -> int:
    """Number of steps of a crossing, each `factor` times the longest stable one.

    That is 2/omega_max with the mass at mid-span.
    """
    system = GalerkinSystem(level_scene().groups, Fourier(terms))
    end = system.phases[-1][1]
    M, _, K = specimens.frozen_matrices(system, 0.5 * end)
    omega_max = math.sqrt(eigvals(K, M).real.max())
    return round(end * omega_max / 2.0 / factor)


_FUNCTIONS = (
    run_on_level, relative_path_gap, path_error, energy_gain, tension_ripple, vibration_energy_history,
    remaining_vibration_energy, frequency_error, slack_path_gap, light_mass_entry_error, compression_onset,
    stiff_cable_runs, taut_tension_gap, frozen_growth_factor, explicit_step_count, convergence_limit,
)  # fmt: skip
MEASURES: dict[str, Any] = {f.__name__: f for f in _FUNCTIONS} | {"most_gain": MAX_GAIN}
