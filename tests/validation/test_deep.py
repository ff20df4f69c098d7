"""Third parties of `check --deep`: right answers agree with each, and each sees a fault of what it checks."""

from dataclasses import replace

import numpy as np
import pytest

from cablefem import Scene
from cablefem.newmark.collocation_rule import CollocationRule
from cablefem.newmark.newmark_rule import NewmarkRule
from tests.validation.pairs import LEVEL, right_answer_of_elements
from tests.validation.test_rides_check import RIDE, ride_of_elements
from validation.commands.check.deep import THIRD, shared_part_check_rows
from validation.core.agreement import Verdict

PARTIES = dict(zip(("frequencies", "rest", "driver", "bars"), THIRD, strict=True))


def third_party_verdict(which, scene, a):
    row = THIRD[PARTIES[which]](scene, a)
    return None if row is None else row.verdict


def test_right_answers_agree_with_all_third_parties_that_their_scene_has():
    gripped = list(shared_part_check_rows(LEVEL, right_answer_of_elements()))
    assert [row.law for row in gripped] == [PARTIES[x] for x in ("frequencies", "driver", "bars")]
    rolling = [THIRD[PARTIES["rest"]](RIDE, ride_of_elements())]
    assert {row.verdict for row in [*gripped, *rolling]} == {Verdict.AGREE}, [*gripped, *rolling]


def test_a_car_that_starts_elsewhere_is_seen():
    lower = ride_of_elements().map(lambda r: replace(r, y=r.y + 1e-3 * r.max_deflection))
    assert third_party_verdict("rest", RIDE, lower) is Verdict.DISAGREE


@pytest.mark.parametrize(("scene", "rule"), [("level", NewmarkRule), ("zipline", CollocationRule)])
def test_a_driver_whose_velocities_lag_is_seen(scene, rule, monkeypatch):
    """Of a rule of either solver, for a timetable and for a ride."""
    step = rule.__call__

    def lagging(self, x, t1):
        after = step(self, x, t1)
        after.v[:] = after.v - 1e-5 * (after.v - x.v)
        return after

    a = right_answer_of_elements() if scene == "level" else ride_of_elements()
    assert third_party_verdict("driver", Scene.load(scene), a) is Verdict.AGREE
    monkeypatch.setattr(rule, "__call__", lagging)
    monkeypatch.setattr(rule, "solve_steps", lambda self, x, times: iter(()))
    assert third_party_verdict("driver", Scene.load(scene), a) is Verdict.DISAGREE


def test_a_path_outside_its_bar_is_seen():
    a = right_answer_of_elements()
    wrong = a.map(lambda r: replace(r, v=r.v + 4.0 * a.finest.path_error * r.max_deflection * np.sign(r.s_o)))
    assert third_party_verdict("bars", LEVEL, wrong) is Verdict.DISAGREE
