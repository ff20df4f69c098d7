"""The work-precision chart: what a row says, what is read off the rows, and that figures need no solver."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cablefem import Scene
from validation.commands.chart import cost, front, study
from validation.commands.chart import page as pages
from validation.core import measures, store
from validation.core.methods import METHODS, find_method
from validation.core.running import run
from validation.peers import PEERS, Peer, PeerPath

LEVEL = Scene.load("level")
REFERENCE = {"elements": 8, "steps": 800}


# --- ladders ----------------------------------------------------------------------------------------------------------


def test_every_method_model_and_scheme_is_charted_and_nothing_else():
    lines = list(study.chart_series(LEVEL.groups))
    assert len({x.name for x in lines}) == len(lines)
    assert [x.name for x in lines if x.kind == "method"] == list(METHODS)
    assert {x.name for x in lines if x.kind == "peer"} == set(PEERS)
    assert {x.model for x in lines} == {"full", "string", "sagged", "stretching"}
    schemes = {x.rungs[0]["scheme"] for x in lines if x.kind == "integrator"}
    assert schemes == {"newmark", "generalized-alpha", "radau", "gauss"}


def peer_echoing_ours(groups, elements):
    """Another code's path: ours."""
    r = run(LEVEL, "following-p2", elements=elements, steps=200, until=0.8)
    return PeerPath(r.s_o / r.length, r.u / r.length, r.v / r.length, r.t / LEVEL.time_scale, 1e-3, "")


# --- a small chart ----------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def small_chart(tmp_path_factory):
    """A chart of two methods and some of the rest, one repeat."""
    out = tmp_path_factory.mktemp("chart")
    with pytest.MonkeyPatch.context() as patch:
        all_series = study.chart_series
        names = ("following-p2", "fixed-p1-naive", "model string", *PEERS)
        waiting = f"following-p2 --tol{study.FULL_PROGRAM}"
        names = (*names, "following-p2 --tol", waiting, "echo")
        patch.setattr(study, "PEERS", {"echo": Peer("math", peer_echoing_ours, ({"elements": 6},)), **PEERS})

        def few(groups):
            failing = tuple({"elements": 6, "steps": steps, "scheme": "central-difference"} for steps in (50, 100))
            yield study.Series("scheme central-difference", "integrator", failing, study.BASE)
            for x in all_series(groups):
                if x.name in names:
                    asked = x.kind in ("tolerance", "waiting")
                    rungs = ({"tol": 0.1},) if asked else x.rungs[:5:2]
                    yield study.Series(x.name, x.kind, rungs, x.method, x.model)

        patch.setattr(study, "chart_series", few)
        patch.setattr(study, "REFERENCE", ("following-p4", REFERENCE))
        patch.setattr(study, "WITNESS", ("fourier-kink", {"terms": 12, "steps": 200}))
        patch.setattr(study, "import_failure_reason", lambda name: None if name == "echo" else "not installed")
        labels = []
        found = study.chart(LEVEL, out, lambda label, done: labels.append((label, done)), repeats=1, budget=3000.0)
        runs = []
        patch.setattr(study, "run", lambda *a, **k: runs.append(a[1]) or run(*a, **k))
        again = study.chart(LEVEL, out, repeats=1, budget=3000.0)
    return out, found, again, labels, runs


def rows_of_series(found, name):
    return [r for r in found["rows"] if r["series"] == name]


def test_a_row_holds_errors_work_and_time(small_chart):
    _, found, _, _, _ = small_chart
    rows = rows_of_series(found, "following-p2")
    assert [r["status"] for r in rows] == ["ok"] * 3
    assert rows[-1]["path_error"] < rows[0]["path_error"] < 0.05
    assert rows[-1]["tension_error"] < rows[0]["tension_error"]
    for r in rows:
        assert 0.0 < r["path_rms"] <= r["path_error"]
        assert r["unknown_steps"] == r["steps"] * r["n_dof"]
        assert r["newton_iterations"] >= r["factorisations"] >= r["steps"]
        assert 1 <= r["repeats"] <= 3  # quick ones more often
        assert r["spread"] is None if r["repeats"] == 1 else r["spread"] >= 1.0
        assert 0.8 <= r["reached"] < 0.85


def test_an_error_is_that_of_the_same_run_against_the_same_reference(small_chart):
    rows = rows_of_series(small_chart[1], "following-p2")
    truth = run(LEVEL, "following-p4", **REFERENCE, until=0.8)
    again = run(LEVEL, "following-p2", until=0.8, **rows[0]["settings"])
    assert rows[0]["path_error"] == measures.relative_path_gap(again, truth, (0.02, 0.8)).largest


def test_wrong_methods_and_cheap_models_stay_on_show(small_chart):
    _, found, _, _, _ = small_chart
    naive = rows_of_series(found, "fixed-p1-naive")
    assert {r["status"] for r in naive} == {"ok"}
    assert min(r["path_error"] for r in naive) > 0.1
    assert all(r["path_error"] > 1.0 for r in rows_of_series(found, "model string"))


def test_failures_have_reasons(small_chart):
    _, found, _, _, _ = small_chart
    failed = rows_of_series(found, "scheme central-difference")
    assert {r["status"] for r in failed} == {"failed"}
    assert all(len(r["reason"]) > 20 for r in failed)
    for name in PEERS:
        (row,) = rows_of_series(found, name)
        assert (row["status"], row["reason"]) == ("not installed", "not installed")


def test_a_tolerance_is_a_row_with_its_bar_and_all_its_seconds(small_chart):
    for row in rows_of_series(small_chart[1], "following-p2 --tol"):
        assert row["path_error"] <= row["bar"] <= row["settings"]["tol"]
        assert row["chosen"]["elements"] >= 6
        assert row["seconds"] > 0.0


def test_what_a_user_waits_for_is_the_whole_command(small_chart):
    (row,) = rows_of_series(small_chart[1], f"following-p2 --tol{study.FULL_PROGRAM}")
    (quick,) = rows_of_series(small_chart[1], "following-p2 --tol")
    assert row["settings"] == quick["settings"]
    assert row["path_error"] <= row["bar"] <= row["settings"]["tol"]
    assert (row["kind"], row["chosen"]) == ("waiting", quick["chosen"])
    (march,) = rows_of_series(small_chart[1], "echo")
    (whole,) = rows_of_series(small_chart[1], f"echo{study.FULL_PROGRAM}")
    assert (whole["kind"], whole["path_error"]) == ("waiting", march["path_error"])
    assert whole["seconds"] == march["wait"]


def test_what_is_stored_is_what_was_found_and_a_second_call_measures_nothing_anew(small_chart):
    out, found, again, labels, runs = small_chart
    stored = json.loads((out / "chart.json").read_text())
    assert stored["rows"] == again["rows"]
    assert [r["seconds"] for r in again["rows"]] == [r["seconds"] for r in found["rows"]]
    assert len(runs) == 1  # the reference
    assert labels[-1][1] == 1.0
    assert [x for _, x in labels] == sorted(x for _, x in labels)


def test_another_scene_is_not_gone_on_with(small_chart, tmp_path):
    stored = (small_chart[0] / "chart.json").read_text()
    (tmp_path / "chart.json").write_text(stored)
    assert store.read_json_or_empty(tmp_path / "chart.json", scene_toml=LEVEL.to_toml())["rows"]
    assert store.read_json_or_empty(tmp_path / "chart.json", scene_toml=Scene.load("inclined").to_toml()) == {}


@pytest.mark.slow  # many figures
def test_pages_are_drawn_without_a_solver(small_chart, monkeypatch):
    def never(*a, **k):
        raise AssertionError("a page called a solver")

    monkeypatch.setattr("cablefem.newmark.integrate", never)
    sections = {s.id: s for s in pages.sections(small_chart[0])}
    assert list(sections) == [
        "chart-fastest", "chart-path", "chart-tension", "chart-work", "chart-failed", "chart-cost",
    ]  # fmt: skip
    assert "following-p2" in sections["chart-fastest"].summary
    assert "not measured: not installed" in sections["chart-fastest"].html
    assert "seconds of the time loop" in sections["chart-path"].html
    assert "steps × unknowns" in sections["chart-work"].html
    assert "central-difference" in sections["chart-failed"].html


def test_a_chart_ends_within_its_budget_whatever_runs_take_beside_their_time_loop(monkeypatch, tmp_path):
    now = [0.0]  # [s] by the clock

    def slow_run(timer, settings):
        now[0] += 0.3
        return {"status": "failed" if timer.series.kind == "peer" else "ok", "path_error": 0.1, "wait": None}, 1e-3

    def slow_reference(scene, stored, seconds):
        now[0] += 4.0
        return study._Reference(None, (0.02, 0.8), {"path_error": 1e-6, "settings": {}})

    monkeypatch.setattr(study, "time", SimpleNamespace(perf_counter=lambda: now[0]))
    monkeypatch.setattr(study._Reference, "compute", slow_reference)
    monkeypatch.setattr(study._SeriesTimer, "_time_run", slow_run)
    monkeypatch.setattr(study._SeriesTimer, "_time_command", slow_run)
    monkeypatch.setattr(study._SeriesTimer, "_time_peer_run", slow_run)
    monkeypatch.setattr(study, "fastest_methods_at_error", lambda rows, error: {})
    monkeypatch.setattr(study, "iteration_cost_over_bare_solve", lambda scene: {})
    found = study.chart(LEVEL, tmp_path, budget=20.0)
    assert 10.0 < now[0] < 20.6  # a run that has begun is ended
    assert {"ok", "not run"} <= {row["status"] for row in found["rows"]}


def test_a_small_budget_has_a_coarser_reference_that_says_so(monkeypatch):
    monkeypatch.setattr(study, "REFERENCE", ("following-p4", {"elements": 16, "steps": 800}))
    monkeypatch.setattr(study, "WITNESS", ("fourier-kink", {"terms": 24, "steps": 800}))
    coarse = study._Reference.compute(LEVEL, None, 0.0)
    assert coarse.stored["settings"] == {"elements": 4, "steps": 200}
    fine = study._Reference.compute(LEVEL, coarse.stored, 1e6)  # what an earlier call stored is not for it
    assert fine.stored["settings"] == {"elements": 16, "steps": 800}
    assert fine.stored["path_error"] < coarse.stored["path_error"]


# --- what is read off -------------------------------------------------------------------------------------------------
def chart_rows(points, series="a", kind="method", status="ok"):
    row = {"series": series, "kind": kind, "model": "full", "status": status, "reason": "r"}
    return [row | {"seconds": s, "path_error": e, "tension_error": 0.1 * e} for s, e in points]


def test_seconds_at_an_error_follow_the_power_law_between_the_best_dots():
    rows = chart_rows([(0.3, 1e-1), (3.0, 1e-3), (1.0, 0.5)])  # error ~ seconds^-2, and one dot that is no use
    assert front.seconds_at_error(rows, 1e-2) == pytest.approx(0.3 * math.sqrt(10.0), rel=1e-12)
    assert front.seconds_at_error(rows, 1e-4) is None
    assert front.seconds_at_error(rows, 0.4) == 0.3
    assert front.seconds_at_error(chart_rows([(1.0, 1e-3)], status="failed"), 1e-2) is None


def test_the_front_holds_what_nothing_else_beats():
    rows = chart_rows([(1.0, 1e-1), (2.0, 2e-1), (3.0, 1e-2), (3.0, 5e-2)]) + chart_rows([(0.5, 1e-3)], kind="model")
    assert front.our_pareto_rows(rows, "path") == [rows[0], rows[2]]


def test_ratios_to_other_codes_are_at_equal_error():
    rows = chart_rows([(0.01, 1e-2), (0.1, 1e-4)]) + chart_rows([(2.0, 1e-2), (50.0, 1e-3)], "b", "peer")
    at = front.fastest_methods_at_error(rows, 1e-3)
    assert at["series"] == "a"
    assert at["tension"] == {"series": "a", "seconds": pytest.approx(0.01), "cut": False}  # at its coarsest already
    assert at["seconds"] == pytest.approx(0.01 * math.sqrt(10.0))
    assert at["peers"]["b"]["ratio"] == pytest.approx(50.0 / (0.01 * math.sqrt(10.0)))
    beyond = front.fastest_methods_at_error(rows, 1e-4)["peers"]["b"]
    assert beyond["ratio"] is None
    assert beyond["reason"] == "comes to 0.1 % at best"
    cut = [*rows, rows[-1] | {"status": "not run", "path_error": None}]  # a budget that ended before the ladder did
    assert (
        front.fastest_methods_at_error(cut, 1e-4)["peers"]["b"]["reason"]
        == "comes to 0.1 % within the time it was given"
    )


def test_another_code_runs_the_travel_up_to_the_end_of_the_window():
    for name in ("level", "cruise"):
        groups = Scene.load(name).groups
        short = study.groups_until(groups, 0.8)
        t = np.linspace(0.0, short.motion.phases[-1][1], 50)
        np.testing.assert_allclose(short.motion.position(t), groups.motion.position(t), rtol=0.0, atol=1e-14)
        assert short.motion.position(t[-1]) == short.motion.end_position == 0.8
        assert len(short.motion.phases) <= len(groups.motion.phases)


def test_a_free_ride_is_charted_over_time_by_what_can_roll():
    text = Scene.load("zipline").to_toml().replace('mode = "free"', 'mode = "free"\nend = {place = 40.0}')
    ride = Scene.from_toml(text)
    lines = {x.name: x for x in study.chart_series(ride.groups)}
    assert "scheme trapezoidal" in lines
    usual = find_method(study.BASE).settings_for_scene(ride.groups, {})["scheme"]  # a line of its own already
    assert not {f"scheme {usual}"} & set(lines)
    for name, why in {"fixed-p1-path": "rolls", "model string": "rolls", "opensees": "grips", "exudyn": None}.items():
        found = lines[name].refusal_reason(ride)
        assert found is None if why is None else why in found
    truth, r = (run(ride, "following-p2", elements=n, steps=steps) for n, steps in ((8, 400), (4, 150)))
    known = study._Reference(truth, measures.common_window(truth), {})
    assert known.status_and_errors(r.reached, r.reason, dict)["status"] == "ok"
    assert known.status_and_errors(0.5, "it broke", dict) == {"status": "failed", "reason": "it broke"}
    l, tau = ride.length, ride.time_scale
    path = PeerPath(r.s_o / l, r.u / l, r.v / l, r.t / tau, 1.0, "")
    ours = known.response_errors(r)["path_error"]
    assert known.peer_path_errors(path, ride)["path_error"] == pytest.approx(ours, rel=1e-6)
    late = replace(path, t=1.01 * path.t)
    assert known.peer_path_errors(late, ride)["path_error"] > 10.0 * ours


# --- cost ------------------------------------------------------------------------------------------------------------
def test_what_an_iteration_costs_is_measured_beside_a_bare_banded_solve():
    """Ratios of seconds are for `cablefem chart`, on a quiet machine; here only what is measured."""
    found = cost.iteration_cost_over_bare_solve(LEVEL, repeats=1)
    assert found["n_dof"] == 78
    assert found["ratio"] == pytest.approx(found["iteration"] / found["bare_solve"])
    assert found["run_ratio"] == pytest.approx(found["run_iteration"] / found["bare_solve"])
