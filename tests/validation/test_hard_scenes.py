"""Hard and hostile scenes: no traceback, no NaN, no hang, no silent wrong answer."""

from dataclasses import replace

import numpy as np
import pytest

from cablefem import Scene
from cablefem.newmark import StateHistory
from validation.commands.sweep import job
from validation.commands.sweep.study import Study
from validation.core import measures, recomputed
from validation.core.design import design_numbers
from validation.core.flags import with_energy_gain_flags_and_cause
from validation.core.methods import METHODS
from validation.core.refine import run_with_error_bars
from validation.core.running import Run, run
from validation.core.sampling import response_of_history

LEVEL = Scene.load("level")
# the campaign itself takes an hour: some of its scenes
HOSTILE = Study.load("reliability").model_copy(update={"truth": None, "seconds": 120.0})


def test_a_ride_on_a_cable_without_a_rest_is_refused():
    """Its top speed is that of the quasi-static ride, which there is none of."""
    other = HOSTILE.model_copy(update={"sample": HOSTILE.sample.model_copy(update={"seed": 231126})})
    row = job.row_of_point_or_failure(other, 8042, other.point(8042))
    assert (row["status"], row["cause"]) == ("refused", "scene")
    assert "no cable at rest under the car was found" in row["reason"]


@pytest.mark.parametrize("index", range(0, len(HOSTILE), 3000))
def test_a_hostile_scene_gets_an_answer_or_a_diagnosis(index):
    row = job.row_of_point_or_failure(HOSTILE, index, HOSTILE.point(index))
    assert row["status"] in ("complete", "incomplete", "refused"), row
    assert row["status"] == "complete" or (row["cause"] and row["reason"])


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
    r = run_with_error_bars(scene, "following-p2", elements=8, steps=400).finest
    assert job.response_faults(r) == []
    if r.path_error is None:
        assert r.cause is not None
    elif not r.flags:  # nothing said against the bar: it has to hold
        fine = run(scene, "following-p2", elements=24, steps=1200)
        window = measures.common_window(r, fine, window=tuple(r.error_window))
        assert measures.relative_path_gap(r, fine, window).largest <= r.path_error
    # from the wave speed on the bar is no bound, and that is said
    assert ("fast" in r.flag_kinds) == (scene.speed_ratio >= 1.0)


def test_the_checker_sees_a_response_that_is_not_finite_or_ends_without_a_reason(monkeypatch):
    r = run(LEVEL, "following-p2", elements=4, steps=100)
    assert job.response_faults(r) == []
    v = r.v.copy()
    v[7] = np.nan
    broken = replace(r, v=v)
    assert job.response_faults(broken) == ["v is not finite"]
    assert job.response_faults(replace(r, status="incomplete", reason=None)) == ["incomplete without a reason"]


def test_a_run_that_breaks_where_the_cable_goes_slack_has_no_energy_after_it():
    r = run(LEVEL, "following-p2", elements=4, steps=100, until=0.5)
    broken = replace(r, switched=r.reached * (1.0 + 1e-15) + 1e-15)
    assert with_energy_gain_flags_and_cause(broken, LEVEL, METHODS["following-p2"]).flag_kinds == r.flag_kinds


def test_a_bar_that_is_too_small_is_seen():
    r = run_with_error_bars(LEVEL, "following-p2", elements=6, steps=200).finest
    found = job.errors_against_finer_run(LEVEL, r, 4)
    assert found["doubt"] < found["true_error"] / 3.0
    assert found["true_error"] <= r.path_error
    assert found["true_error"] > 1e-9  # and a run so sure of itself would be found out


@pytest.mark.parametrize("method", ["following-p2", "fourier-kink"])
def test_a_ride_that_rolls_back_ends_by_the_support_it_came_from(method):
    """Nothing converges nearer: a run that went on would creep."""
    point = {"sag_ratio": 0.02, "alpha": 500.0, "slope": -20.0, "mu": 0.3, "speed_ratio": 0.2, "drive.mode": "free"}
    scene = HOSTILE.scene_at(point)
    r = run(scene, method, steps=60)
    assert (r.status, [x["event"] for x in r.events]) == ("complete", ["back"])
    assert r.s_o[-1] == pytest.approx(scene.groups.drive.rollback_end_position * r.length, rel=1e-9)
    assert r.work["steps"] < 5 * 60


def test_a_coarse_companion_of_which_nothing_is_known_leaves_no_bar():
    row = job.row_of_point_or_failure(HOSTILE, 589, HOSTILE.point(589))
    assert row["status"] in ("complete", "incomplete"), row["reason"]


@pytest.mark.parametrize(
    ("method", "settings"),
    [("following-p2", {"elements": 2, "scheme": "generalized-alpha"}), ("fourier-kink", {"terms": 12})],
)
@pytest.mark.parametrize("beyond", [True, False], ids=["beyond", "on the cable"])
def test_a_ride_that_ends_beyond_the_cable_ended_before(method, settings, beyond):
    ride = Run(Scene.load("zipline"), method, steps=40, **settings)
    ride.run_to(0.1)
    *before, last = ride.history.states
    ride.history.states = StateHistory(
        [*before, last._replace(q=np.append(last.q[:-1], 1.02 if beyond else last.q[-1]))]
    )
    r = response_of_history(ride.scene, ride.history, method=method, settings=ride.settings, **ride.run_options)
    assert (r.status, r.t.size) == (
        ("incomplete", len(ride.history.states) - 1) if beyond else ("complete", len(ride.history.states))
    )
    assert r.cause == ("unstable" if beyond else None)


@pytest.mark.parametrize("method", ["following-p1", "following-p2"])
def test_one_element_on_each_side_is_enough_to_run(method):
    r = run(LEVEL, method, elements=1, steps=40)
    assert (r.status, job.response_faults(r)) == ("complete", [])


@pytest.mark.parametrize(
    "settings",
    [
        {"scheme": "radau", "elements": 60, "steps": 200},
        {"scheme": "generalized-alpha", "rho_inf": 0.8, "elements": 60, "steps": 1600},
    ],
)
def test_energy_is_kept_where_a_light_car_enters_fast_and_steps_are_few(settings):
    """It bends the cable at once: half of the drive's work in the first long step would be missing."""
    r = run(LEVEL.variant(mu=0.07, speed_ratio=0.6), "following-p2", until=0.6, **settings)
    window = measures.common_window(r, window=(0.02, 0.58))
    scale = r.horizontal_tension * r.max_deflection

    def defect(r):
        return float(np.abs(measures.energy_defect_in_joules(r)[measures.steps_in_window(r, window)]).max()) / scale

    assert defect(r) < 4e-4
    assert defect(replace(r, power=1.01 * r.power)) > 4e-4


def test_a_run_that_ends_before_its_first_frame_is_recomputed():
    """Must fail: a number that it cannot have."""
    r = run(Scene.load("level"), "following-p2", steps=200, until=1e-9)
    assert r.fields.t.size == 0
    with_numbers = replace(r, design=design_numbers(r))
    assert all(row.gap <= row.allowed for row in recomputed.recomputed_rows(with_numbers))
    speed = {"quantity": "speed", "value": 1e6, "bar": 0.0, "unit": "m/s", "s_o": None}
    assert not all(row.gap <= row.allowed for row in recomputed.recomputed_rows(replace(r, design=[speed])))
