"""Every entry of the method table, and a user's own method, through everything that asks for methods."""

import json

import numpy as np
import pytest

from cablefem import Scene
from cablefem.newmark import integrate, scheme, stack_states, step_times_by_phase
from cablefem.response import Observation, Response
from tests.validation import sines
from validation import check, run
from validation.commands.atlas import study as atlas
from validation.commands.chart import study as chart
from validation.commands.oracles import study as oracles
from validation.core.methods import METHODS, find_method, scaled_settings
from validation.core.refine import TooCoarse, refine_to_tolerance
from validation.oracles import moving_mass

MINE = "my-sines"
SCENE = Scene.load("inclined")
TABLE = [*METHODS, MINE]
every = pytest.mark.parametrize("name", TABLE)


@pytest.fixture(autouse=True)
def own_method_in_table(monkeypatch):
    """Put a user's own method into the table."""
    monkeypatch.setitem(METHODS, MINE, sines.METHOD)


def coarse_settings(name):
    """Settings of some milliseconds."""
    method = find_method(name)
    settings = method.complete_settings(
        scaled_settings(method, method.settings_from_coarse_to_fine(1)[0], space=0.5)
    ) | {"steps": 120}
    return method.resolution_and_steps(settings)


def solver_and_first_states(name):
    """Return a solver and its first states."""
    method = find_method(name)
    settings = method.complete_settings(coarse_settings(name))
    solver = method.build(SCENE.groups, settings, model="full", load="mass", law="elastic")
    steps = integrate(solver, scheme(settings["scheme"]), step_times_by_phase(solver, 60))
    return solver, [next(steps) for _ in range(4)]


@every
def test_a_solver_is_what_the_contract_says(name):
    solver, states = solver_and_first_states(name)
    assert all(x.q.shape == x.v.shape == x.a.shape == (solver.n_dof,) for x in states)
    places = [solver.position(x) for x in states]
    assert places == sorted(places)
    assert 0.0 <= places[0] < places[-1] < 1.0
    value, s = solver.min_tension_and_position
    assert np.isfinite(value)
    assert 0.0 <= s <= 1.0
    history = solver.states_over_time(stack_states(states))
    observed = solver.observe(history, np.linspace(0.0, 1.0, 7), np.array([1, 3]))
    assert isinstance(observed, Observation)
    np.testing.assert_allclose(observed.s_o, places, rtol=1e-9, atol=1e-12)
    for values, shape in (
        (observed.path, (4, 2)),
        (observed.T_ahead, (4,)),
        (observed.energy, (4,)),
        (observed.T, (2, 7)),
    ):
        assert values.shape == shape
        assert np.isfinite(values).all()
    np.testing.assert_allclose(observed.u[:, [0, -1]], 0.0, rtol=0.0, atol=1e-15)  # held at the supports


@every
def test_a_taut_cable_does_not_know_its_law(name):
    solver, states = solver_and_first_states(name)
    other, x = solver.with_law("tension-only"), states[-1]
    same = (y.residual(x.t, x.q, x.v, x.a, x.phase) for y in (solver, other))
    np.testing.assert_allclose(*same, rtol=0.0, atol=1e-9 * solver.force_scale + 10.0 * solver.force_floor)


@every
def test_a_run_under_the_default_law(name, tmp_path):
    response = run(SCENE, name, **coarse_settings(name))
    assert response.law == "auto"
    assert (response.status == "complete") != (response.cause is not None)
    assert np.isfinite(response.v).all()
    response.write(tmp_path)
    assert Response.read(tmp_path).summary() == json.loads((tmp_path / "summary.json").read_text())


def test_a_run_by_object_is_that_by_name():
    runs = [
        run(SCENE, method, **coarse_settings("following-p2"))
        for method in ("following-p2", find_method("following-p2"))
    ]
    np.testing.assert_array_equal(*(r.v for r in runs))


@every
def test_a_tolerance_is_met_or_refused_with_the_best_there_is(name):
    if find_method(name).wrong:
        with pytest.raises(ValueError, match="wrong answer"):
            refine_to_tolerance(SCENE, name, 0.2, until=0.3)
        return
    try:
        response = refine_to_tolerance(SCENE, name, 0.2, until=0.3, budget=1e4).finest
        assert response.path_error <= 0.2
    except TooCoarse as error:
        response = error.ladder.finest
    assert find_method(name).resolution.setting in response.settings


@pytest.mark.parametrize(
    "name",
    ["fixed-p1-path", pytest.param("wavelet", marks=pytest.mark.slow), pytest.param(MINE, marks=pytest.mark.slow)],
)
def test_a_check_holds_it_against_the_other_wing(name, monkeypatch):
    monkeypatch.setattr("validation.commands.check.study.BUDGET", 1e3)
    other = "fourier-kink" if find_method(name).wing == "elements" else "following-p2"
    result = check(SCENE, tol=0.2, methods=(name, other))
    assert result.a.finest.method == name
    assert {row.quantity for row in result.rows} >= {"path_max"}
    json.dumps(result.agreement(), allow_nan=False)
    if name == MINE:
        assert next(row for row in result.rows if row.quantity == "path_max").verdict.value == "agree"


@every
def test_a_line_of_the_chart(name):
    (line,) = (x for x in chart.chart_series(SCENE.groups) if x.name == name)
    resolutions = [find_method(name).complete_settings(x)[find_method(name).resolution.setting] for x in line.rungs]
    assert len(resolutions) > 6
    assert resolutions == sorted(resolutions)


@every
def test_a_cell_of_the_atlas(name):
    settings = {
        find_method(name).resolution.setting: find_method(name).resolution.value_for_unknowns(4.0),
        "steps": 100,
    }
    drawn = {"name": "mine", "scene": {}, "methods": [[name, settings]]}
    (cell,) = atlas.run_and_judge_methods_at(drawn, 100.0, 4.0)
    assert cell["class"] in ("good", "poor", "wrong")
    mapped = dict(atlas.methods_with_fixed_settings(atlas.MAPS["map"][0]))
    assert (name in mapped) == (find_method(name).atlas_settings is not None)


def test_a_case_of_an_oracle(monkeypatch):
    """On two coarse rungs; the methods of the table: tests/oracles."""
    case = next(case for case in moving_mass.cases() if getattr(case, "scene", ""))
    assert MINE in (case.methods or METHODS)
    rungs = [oracles.Rung({"waves": n, "steps": 200}, float(n)) for n in (6, 12)]
    monkeypatch.setattr(oracles._Solvers, "rungs", lambda self, name, finer: rungs)
    row = oracles.Task("moving-mass", case, MINE).compute_row()
    assert row["method"] == MINE
    assert row["error"] < 0.1
