"""The table of exact answers: its rows, its verdicts, its rows that must fail, its page."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq

from cablefem import Scene
from cablefem.scene.statics import gripped
from validation import oracles
from validation.commands.oracles import page
from validation.commands.oracles import study as exactness
from validation.oracles import rest
from validation.oracles.case import Crossing

EVERY = {task.key: task for task in exactness.tasks()}
CROSSINGS = {key[:2]: task.case for key, task in EVERY.items() if isinstance(task.case, Crossing)}


def row(oracle, case, method):
    """Compute the one row whose case begins so."""
    (task,) = [t for key, t in EVERY.items() if key[0] == oracle and key[1].startswith(case) and key[2] == method]
    return task.compute()


def test_every_exact_answer_is_held_against_a_solver():
    assert {oracle for oracle, _, _ in EVERY} == set(oracles.find())
    assert len(EVERY) == len(exactness.tasks())  # no two rows have the same name


def test_a_file_in_the_folder_is_all_that_an_oracle_needs(tmp_path, monkeypatch):
    """It is found, held against every method it asks for, and shown, under a heading of its own."""
    (tmp_path / "brought_along.py").write_text(
        "'A title.\\n\\nSource: a source\\nGroup: A new group'\n"
        "from validation.oracles.case import BARE, Modes\n"
        "from validation.oracles.catenary_modes import solve\n"
        "exact = solve(BARE.sigma, BARE.alpha, BARE.c, count=3).omega\n"
        "case = Modes(name='first three', groups=BARE, model='full', exact=exact, methods=('sines',))\n"
        "cases = lambda: [case]\n"
    )
    monkeypatch.setattr(oracles, "__path__", [*oracles.__path__, str(tmp_path)])
    (task,) = [t for t in exactness.tasks() if t.oracle == "brought-along"]
    monkeypatch.setattr(exactness, "tasks", lambda: [task])
    assert exactness.oracle_table(tmp_path)["verdict"] == "agree"
    html = "".join(str(s.html) for s in page.sections(tmp_path))
    assert all(word in html for word in ("brought-along", "A new group", "a source", "first three"))


@pytest.mark.parametrize(
    ("method", "low", "high", "error"),
    [
        ("following-p1", 1.8, 2.1, 1e-5),
        ("following-p2", 2.4, 2.8, 1e-6),
        ("fourier", 0.9, 1.1, 7e-3),
        ("fourier-kink", 1.8, 2.3, 2e-5),
        ("wavelet", 0.9, 1.3, 8e-3),
        ("fixed-p2-path", 0.9, 1.1, 5e-3),
    ],
)
def test_a_moving_mass_has_the_orders_of_the_formulations(method, low, high, error):
    """Through scene, run and response: their units and their sampling are held against the exact path, too."""
    found = row("moving-mass", "the paper's mass", method)
    assert found.verdict == "agree"
    assert low < found.observed_order < high
    assert found.error < error


@pytest.mark.parametrize("method", ["fixed-p1-naive", "fixed-p2-naive"])
def test_the_classical_mistake_is_seen(method):
    found = row("moving-mass", "the paper's mass", method)
    assert (found.verdict, found.expected) == ("disagree", "disagree")
    assert math.isnan(found.observed_order)
    assert found.error > 5.0 * found.allowed


@pytest.mark.parametrize(
    ("oracle", "case"),
    [
        ("moving-force", "speed 0.95"), ("moving-mass", "accelerate, cruise"), ("running-apart", "one of"),
        ("accelerating-mass", "up to"), ("massless-string", "limit"), ("moving-mass", "limit of small sag, model full"),
    ],
)  # fmt: skip
def test_crossings_and_limits_agree(oracle, case):
    assert row(oracle, case, "following-p2").verdict == "agree"


def test_what_rides_with_the_load_is_unstable_above_the_wave_speed():
    found = row("accelerating-force", "through", "following-p2")
    assert found.verdict == found.expected == "disagree"


@pytest.mark.parametrize("oracle", ["irvine", "catenary-modes"])
@pytest.mark.parametrize("basis", ["P2 elements", "sines", "wavelets"])
def test_frequencies_of_both_wings(oracle, basis):
    assert row(oracle, "first four", basis).verdict == "agree"


LINES = {
    "zip line": (Scene.from_toml(rest.ZIP + "start = 2.0"), 0.784932735, -0.00571379),
    "level": (Scene.load("level"), 0.5, -0.01554625),
    "inclined": (Scene.load("inclined"), 0.883770533, -0.00596207),
}


@pytest.mark.parametrize(("scene", "place", "hold"), LINES.values(), ids=LINES)
def test_each_wing_s_own_statics_hold_a_car_and_find_where_it_rests(scene, place, hold):
    """Elements by the force on s_o, sines by the car's balance, which is another number (must not be the same)."""
    g = scene.groups
    at, law = rest.place_of_rest(g, 0.3), rest.balance(gripped(rest.TENTH, g))

    def found(method, **how):
        return brentq(lambda s: exactness.SOLVERS.hold(g, method, s, **how), place - 0.07, place + 0.06, xtol=1e-14)

    assert found("following-p2", elements=4) == pytest.approx(at, abs=5e-8)  # 4e-6 of a prototype
    assert found("following-p4", elements=4) == pytest.approx(at, abs=1e-13)
    assert found("fourier-kink", terms=20) == pytest.approx(at, abs=2e-6)
    assert at == pytest.approx(place, abs=1e-9)
    fine = exactness.SOLVERS.hold(g, "following-p4", rest.TENTH, elements=4)
    sines = exactness.SOLVERS.hold(g, "fourier-kink", rest.TENTH, terms=40)
    assert fine == pytest.approx(hold, abs=1e-8)
    assert sines == pytest.approx(law, rel=1e-6)
    assert law == pytest.approx(hold, abs=1e-7)
    assert abs(fine - law) > 1e3 * abs(fine - gripped(rest.TENTH, g).hold[0])


# --- the judge ------------------------------------------------------------------------------------------------------
def test_an_order_that_cannot_be_read_is_none():
    assert exactness.order([5.0, 10.0, 20.0], [3e-2, 7.5e-3, 1.875e-3]) == pytest.approx(2.0)
    assert math.isnan(exactness.order([5.0, 10.0, 20.0], [3e-2, 4e-2, 5e-2]))
    assert math.isnan(exactness.order([5.0, 10.0, 20.0], [3e-2, math.nan, 1e-3]))


@pytest.mark.parametrize(
    ("error", "allowed", "observed", "verdict"),
    [
        (1e-3, 2e-3, 1.9, "agree"),
        (3e-3, 2e-3, 1.9, "disagree"),  # further away than it says
        (1e-3, 2e-3, 1.4, "disagree"),  # closer, but an order is missing
        (1e-3, 2e-3, math.nan, "disagree"),
        (math.nan, 2e-3, 1.9, "disagree"),
    ],
)
def test_a_verdict_needs_both_the_bar_and_the_order(error, allowed, observed, verdict):
    assert exactness.judge(error, allowed, observed, 1.9) == verdict


def test_the_bar_is_made_without_the_exact_answer():
    """A path off by a constant factor has the same small bar, and is found out."""

    class Heavier(type(exactness.SOLVERS)):
        def path(self, crossing, name, **settings):
            found = super().path(crossing, name, **settings)
            return replace(found, v=1.01 * found.v)

    found = EVERY["moving-mass", "mass ratio 5, speed 0.37", "following-p2"].compute(Heavier())
    assert found.verdict == "disagree"
    assert found.error > 100.0 * found.allowed


# --- the file and its page ------------------------------------------------------------------------------------------
@pytest.fixture
def few(monkeypatch):
    """Return tasks that cost nothing, with one that must fail."""
    calls = []

    def toy(name, error, expected):
        def compute():
            calls.append(name)
            values = {
                "oracle": "moving-mass", "case": name, "method": "following-p2", "ladder": ["elements 3", "elements 6"],
                "refined": "resolution", "sizes": [3.0, 6.0], "errors": [4.0 * error, error], "error": error,
                "worst": 1.7 * error, "observed_order": 2.0 if error < 0.1 else math.nan, "expected_order": 1.9,
                "because": "x < y & z", "allowed": 0.02, "allowed_because": "its bar",
                "verdict": exactness.judge(error, 0.02, 2.0, 1.9), "expected": expected,
            }  # fmt: skip
            return exactness.Row(**values)

        return SimpleNamespace(key=("moving-mass", name, "following-p2"), compute=compute)

    tasks = [toy("the paper's mass, toy", 0.013, "agree"), toy("second", 0.3, "disagree")]
    monkeypatch.setattr(exactness, "tasks", lambda: tasks)
    return tasks, calls


def test_the_table_is_written_and_goes_on_where_it_stopped(few, tmp_path):
    _, calls = few
    progress = []
    content = exactness.oracle_table(tmp_path, lambda label, done: progress.append((label, done)))
    assert content == json.loads((tmp_path / "oracles.json").read_text())
    assert content["verdict"] == "agree"
    assert content["rows"][1]["observed_order"] is None
    assert progress[-1] == ("oracles", 1.0)
    assert [o["name"] for o in content["oracles"]] == [*oracles.find()]
    first = few[0][0]
    (tmp_path / exactness.ROWS).write_text(json.dumps([json.dumps(first.key), content["rows"][0]]))
    calls.clear()
    assert exactness.oracle_table(tmp_path)["verdict"] == "agree"
    assert calls == ["second"]


def test_one_row_that_is_not_as_it_should_be_spoils_the_verdict(few, tmp_path, monkeypatch):
    tasks, _ = few
    failing = SimpleNamespace(key=tasks[1].key, compute=lambda: replace(tasks[1].compute(), expected="agree"))
    monkeypatch.setattr(exactness, "tasks", lambda: [tasks[0], failing])
    assert exactness.oracle_table(tmp_path)["verdict"] == "disagree"
    first = page.sections(tmp_path)[0]
    assert first.verdict == "disagree"
    assert "second" in first.summary


def test_the_page_shows_every_row_and_escapes_it(few, tmp_path):
    exactness.oracle_table(tmp_path)
    found = page.sections(tmp_path)
    html = "".join(str(s.html) for s in found)
    assert found[0].verdict == "agree"
    assert "x &lt; y &amp; z" in html
    assert "fails, as it must" in html
    assert "<svg" in html
    assert len({s.id for s in found}) == len(found)


def travel_gap(crossing):
    """Largest distance of the travel sent to the solver and that of the exact answer, on the way."""
    t = np.linspace(0.0, crossing.motion.time_at(crossing.until), 41)
    return np.abs(crossing.travel(t) - crossing.motion.position(t)).max()


@pytest.mark.parametrize("crossing", CROSSINGS.values(), ids=lambda c: c.name)
def test_solver_and_oracle_travel_alike(crossing):
    assert travel_gap(crossing) < 1e-14
    assert crossing.motion.position(0.0) == crossing.begins
    faster = replace(crossing, travel=lambda t: crossing.travel(1.01 * t))
    assert travel_gap(faster) > 1e-3
    assert crossing.exact(np.zeros(1)) == pytest.approx(0.0, abs=1e-14)
