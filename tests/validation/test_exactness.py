"""The table of exact answers: its rows, its verdicts, its rows that must fail, its page."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from validation import oracles
from validation.commands.oracles import page
from validation.commands.oracles import study as exactness
from validation.core.methods import METHODS
from validation.oracles.case import Crossing

EVERY = {task.key: task for task in exactness.all_tasks()}
CROSSINGS = {key[:2]: task.case for key, task in EVERY.items() if isinstance(task.case, Crossing)}


def test_every_exact_answer_is_held_against_a_solver():
    assert {oracle for oracle, _, _ in EVERY} == set(oracles.find_oracles())
    assert len(EVERY) == len(exactness.all_tasks())  # no two rows have the same name


def test_a_file_in_the_folder_is_all_that_an_oracle_needs(tmp_path, monkeypatch):
    """It is found, held against every method it asks for, and shown, under a heading of its own."""
    (tmp_path / "brought_along.py").write_text(
        "'A title.\\n\\nSource: a source\\nGroup: A new group'\n"
        "from validation.oracles.case import BARE, Modes\n"
        "from validation.oracles.catenary_modes import solve_modes\n"
        "exact = solve_modes(BARE.sigma, BARE.alpha, BARE.c, count=3).omega\n"
        "case = Modes(name='first three', groups=BARE, model='full', exact=exact, methods=('sines',))\n"
        "cases = lambda: [case]\n"
    )
    monkeypatch.setattr(oracles, "__path__", [*oracles.__path__, str(tmp_path)])
    (task,) = [t for t in exactness.all_tasks() if t.oracle == "brought-along"]
    monkeypatch.setattr(exactness, "all_tasks", lambda: [task])
    assert exactness.write_oracle_table(tmp_path)["verdict"] == "agree"
    html = "".join(str(s.html) for s in page.sections(tmp_path))
    assert all(word in html for word in ("brought-along", "A new group", "a source", "first three"))


# --- the judge ------------------------------------------------------------------------------------------------------
def test_an_order_that_cannot_be_read_is_none():
    assert exactness.observed_order([5.0, 10.0, 20.0], [3e-2, 7.5e-3, 1.875e-3]) == pytest.approx(2.0)
    assert exactness.observed_order([5.0, 10.0, 20.0, 40.0], [3e-2, 7.5e-3, 1.875e-3, 0.0]) == pytest.approx(2.0)
    assert math.isnan(exactness.observed_order([5.0, 10.0, 20.0], [3e-2, 4e-2, 5e-2]))
    assert math.isnan(exactness.observed_order([5.0, 10.0, 20.0], [3e-2, 0.0, 1e-3]))
    assert math.isnan(exactness.observed_order([5.0, 10.0, 20.0], [3e-2, math.nan, 1e-3]))


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
    assert exactness.verdict_of_row(error, allowed, observed, 1.9) == verdict


def test_the_bar_is_made_without_the_exact_answer():
    """A path off by a constant factor has the same small bar, and is found out."""

    class Heavier(type(exactness.SOLVERS)):
        def mass_path(self, crossing, name, **settings):
            found = super().mass_path(crossing, name, **settings)
            return replace(found, v=1.01 * found.v)

    found = EVERY["moving-mass", "mass ratio 5, speed 0.37", "following-p2"].compute_row(Heavier())
    assert found["verdict"] == "disagree"
    assert found["error"] > 100.0 * found["allowed"]


def test_a_row_that_breaks_is_a_row_and_neither_sound_nor_a_comparison_that_must_fail(tmp_path, monkeypatch):
    class Silent(type(exactness.SOLVERS)):
        def mass_path(self, crossing, name, **settings):
            return np.zeros(0).max()  # of a run without a single frame

    sound = EVERY["moving-mass", "mass ratio 5, speed 0.37", "following-p2"]
    wrong = EVERY["moving-mass", "the paper's mass and speed, g (1 + V²)", "fixed-p1-naive"]
    monkeypatch.setattr(exactness, "all_tasks", lambda: [sound, wrong])
    monkeypatch.setattr(exactness, "SOLVERS", Silent())
    content = exactness.write_oracle_table(tmp_path)
    assert content["verdict"] == "disagree"
    assert [(row["verdict"], row["expected"]) for row in content["rows"]] == [
        ("failed", "agree"),
        ("failed", "disagree"),
    ]
    assert all("zero-size array" in row["reason"] for row in content["rows"])
    first, *_, last = page.sections(tmp_path)
    assert first.verdict == "disagree"
    assert "zero-size array" in first.summary
    assert last.summary.startswith("0 of 1")


# --- the file and its page ------------------------------------------------------------------------------------------
@pytest.fixture
def free_tasks(monkeypatch):
    """Return tasks that cost nothing, with one that must fail."""
    calls = []

    def toy(name, error, expected):
        def compute_row():
            calls.append(name)
            return {
                "oracle": "moving-mass", "case": name, "method": "following-p2", "ladder": ["elements 3", "elements 6"],
                "refined": "resolution", "sizes": [3.0, 6.0], "errors": [4.0 * error, error], "error": error,
                "worst": 1.7 * error, "observed_order": 2.0 if error < 0.1 else math.nan, "expected_order": 1.9,
                "because": "x < y & z", "allowed": 0.02, "allowed_because": "its bar",
                "verdict": exactness.verdict_of_row(error, 0.02, 2.0, 1.9), "expected": expected, "reason": "",
            }  # fmt: skip

        return SimpleNamespace(key=("moving-mass", name, "following-p2"), compute_row=compute_row)

    tasks = [toy("the paper's mass, toy", 0.013, "agree"), toy("second", 0.3, "disagree")]
    monkeypatch.setattr(exactness, "all_tasks", lambda: tasks)
    return tasks, calls


def test_the_table_is_written_and_goes_on_where_it_stopped(free_tasks, tmp_path):
    _, calls = free_tasks
    progress = []
    content = exactness.write_oracle_table(tmp_path, lambda label, done: progress.append((label, done)))
    assert content == json.loads((tmp_path / "oracles.json").read_text())
    assert content["verdict"] == "agree"
    assert content["rows"][1]["observed_order"] is None
    assert progress[-1] == ("oracles", 1.0)
    assert [o["name"] for o in content["oracles"]] == [*oracles.find_oracles()]
    first = free_tasks[0][0]
    (tmp_path / exactness.ROWS).write_text(json.dumps([json.dumps(first.key), content["rows"][0]]))
    calls.clear()
    assert exactness.write_oracle_table(tmp_path)["verdict"] == "agree"
    assert calls == ["second"]


def test_one_row_that_is_not_as_it_should_be_spoils_the_verdict(free_tasks, tmp_path, monkeypatch):
    tasks, _ = free_tasks
    failing = SimpleNamespace(key=tasks[1].key, compute_row=lambda: tasks[1].compute_row() | {"expected": "agree"})
    monkeypatch.setattr(exactness, "all_tasks", lambda: [tasks[0], failing])
    assert exactness.write_oracle_table(tmp_path)["verdict"] == "disagree"
    first = page.sections(tmp_path)[0]
    assert first.verdict == "disagree"
    assert "second" in first.summary


def test_the_page_shows_every_row_and_escapes_it(free_tasks, tmp_path):
    exactness.write_oracle_table(tmp_path)
    found = page.sections(tmp_path)
    html = "".join(str(s.html) for s in found)
    assert found[0].verdict == "agree"
    assert "x &lt; y &amp; z" in html
    assert "fails, as it must" in html
    assert len({s.id for s in found}) == len(found)


def test_errors_are_drawn_for_a_case_of_all_methods_and_not_for_whatever_is_first_of_a_small_part(free_tasks, tmp_path):
    content = exactness.write_oracle_table(tmp_path)
    assert "<svg" not in page.sections(tmp_path)[0].html
    row = content["rows"][0]
    rows = [row | {"method": method} for method in METHODS]
    (tmp_path / "oracles.json").write_text(json.dumps(content | {"rows": rows}))
    assert "<svg" in page.sections(tmp_path)[0].html


@pytest.mark.parametrize("crossing", CROSSINGS.values(), ids=lambda c: c.name)
def test_solver_and_oracle_begin_alike(crossing):
    assert crossing.groups.motion.position(0.0) == crossing.start_position
    assert crossing.exact(np.zeros(1)) == pytest.approx(0.0, abs=1e-14)
