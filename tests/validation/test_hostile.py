"""Random scenes, half of them hostile: no traceback, no NaN, no hang, no silent wrong answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cablefem import Scene
from validation.commands.atlas import hostile
from validation.commands.atlas.hostile import BROKEN, draws, examine, faults_of, hostile_survey
from validation.core import measures
from validation.core.running import run

SEED = 20031
SAMPLE = draws(60, SEED)
LEVEL = Scene.load("level")


@pytest.mark.parametrize("draw", SAMPLE, ids=lambda d: f"{SEED}-{d.number}")
def test_a_random_scene_gets_an_answer_or_a_diagnosis(draw):
    outcome = examine(draw, estimate=draw.number % 4 == 0, truth=draw.number % 12 == 0)
    assert outcome["outcome"] not in BROKEN, (draw, outcome)
    if outcome["outcome"] == "refused":
        assert draw.hostile, outcome["reason"]


HARD = {
    "V/c 0.9": {"speed_ratio": 0.9}, "V/c 1.0": {"speed_ratio": 1.0}, "V/c 1.1": {"speed_ratio": 1.1},
    "V/c 1.5": {"speed_ratio": 1.5}, "mu 20": {"mu": 20.0}, "alpha 1e6": {"alpha": 1e6},
    "sag 0.3": {"sag_ratio": 0.3, "alpha": 844.416, "mu": 1.0, "speed_ratio": 0.41},
}  # fmt: skip


@pytest.mark.parametrize("name", [*HARD, "slope 45"])
def test_hard_scenes_get_an_error_estimate_or_a_diagnosis(name):
    if name == "slope 45":
        scene = Scene.from_groups(sag_ratio=0.05, alpha=844.0, slope=45.0, mu=1.1, speed_ratio=0.41)
    else:
        scene = LEVEL.variant(**HARD[name])
    r = hostile.estimated(scene, "following-p2", elements=8, steps=400).run
    assert faults_of(r) == []
    if r.path_error is None:
        assert r.cause is not None
    elif not r.flags:  # nothing said against the bar: it has to hold
        fine = run(scene, "following-p2", elements=32, steps=1600)
        window = measures.window_of(r, fine, window=tuple(r.error_window))
        assert measures.path_gap(r, fine, window)[0] <= r.path_error
    # from the wave speed on the bar is no bound, and that is said
    assert ("fast" in r.flag_kinds) == (scene.speed_ratio >= 1.0)


def test_the_checker_sees_a_response_that_is_not_finite_or_ends_without_a_reason():
    r = run(LEVEL, "following-p2", elements=4, steps=100)
    assert faults_of(r) == []
    v = r.v.copy()
    v[7] = np.nan
    assert faults_of(replace(r, v=v)) == ["v is not finite"]
    assert faults_of(replace(r, status="incomplete", reason=None)) == ["incomplete without a reason"]


def test_the_survey_counts_tracebacks_and_silent_wrong_answers(monkeypatch):
    sound = hostile.estimated

    def sure_of_itself(scene, method, **how):
        e = sound(scene, method, **how)
        return replace(e, run=replace(e.run, path_error=1e-9))

    mild = replace(SAMPLE[0], method="following-p2", groups={
        "sag_ratio": 0.021, "alpha": 844.0, "slope": 3.0, "mu": 1.3, "speed_ratio": 0.4, "travel": "constant_speed",
    })  # fmt: skip
    assert examine(mild, truth=True)["outcome"] == "complete"
    monkeypatch.setattr(hostile, "estimated", sure_of_itself)
    assert examine(mild, truth=True)["outcome"] == "silent"

    def raising(*args, **how):
        raise ZeroDivisionError

    monkeypatch.setattr(hostile, "estimated", raising)
    found = hostile_survey(2, seed=3)
    assert found["counts"].get("traceback", 0) >= 1
    assert found["broken"][0]["outcome"] == "traceback"


def test_draws_repeat_with_their_seed_and_half_are_hostile():
    assert str(draws(40, 7)) == str(draws(40, 7))  # as text: nan is among them
    assert draws(10, 7)[0] != draws(10, 8)[0]
    assert sum(d.hostile for d in draws(50, 7)) == 25
