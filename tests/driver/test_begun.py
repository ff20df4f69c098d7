"""A car that grips and is let in on the way: both wings begin in the exact rest of the loaded cable."""

import numpy as np
import pytest

from cablefem import Scene
from cablefem.newmark import stack_states
from cablefem.scene import ConstantSpeed
from cablefem.scene.statics import gripped_rest
from tests.runs import observe
from validation.core.methods import find_method
from validation.core.running import Run

SCENES = {
    "level, at 2 %": ("level", 0.02),
    "steep, in the middle": ("tramway", 0.5),
    "heavy, next to the far support": ("inclined", 0.9),
}


@pytest.mark.parametrize(
    ("method", "settings", "tol"), [("following-p2", {"elements": 12}, 1e-6), ("fourier-kink", {"terms": 30}, 3e-4)]
)
@pytest.mark.parametrize("name", SCENES)
def test_a_car_let_in_on_the_way_begins_at_rest_on_the_loaded_cable(name, method, settings, tol):
    """Place and velocity are those of the exact catenary of two pieces; the empty cable's are far from it."""
    of, place = SCENES[name]
    base = Scene.load(of)
    travel = ConstantSpeed(speed=0.1 * base.wave_speed, **{"from": place * base.length})
    g = base.variant(travel=travel, drive={"mode": "grip"}).groups
    kind = find_method(method)
    system = kind.build(g, kind.settings_for_scene(g, settings), model="full", load="mass", law="elastic")
    x = system.start(0, None)
    seen = observe(system, stack_states([x]))
    exact = gripped_rest(place, g)
    w = exact.car_point[0] - np.array(g.coordinates(place))
    v = exact.along[0] * g.motion.position_with_rates(0.0, 0)[1]
    assert np.linalg.norm(seen.path[0] - w) < tol * np.linalg.norm(w)
    assert np.linalg.norm(seen.path_velocity[0] - v) < tol * np.linalg.norm(v)
    empty = np.array(g.tension_and_slope(place)[1:]) * g.motion.position_with_rates(0.0, 0)[1]
    assert np.linalg.norm(empty - v) > 10.0 * tol * np.linalg.norm(v)


@pytest.mark.parametrize("method", ["fixed-p1-naive", "fixed-p1-path"])
def test_a_fixed_mesh_begins_at_the_support_and_says_so(method):
    base = Scene.load("level")
    scene = base.variant(travel=ConstantSpeed(speed=10.0, **{"from": 90.0}))
    with pytest.raises(ValueError, match=r"not yet: travel\.from with fixed-p1"):
        Run(scene, method)


def test_many_steps_on_the_slack_cable_are_those_taken_one_by_one():
    many, single = (Run(Scene.load("level"), "fourier-kink", terms=24, steps=200, scheme="newmark") for _ in range(2))
    single.history.solver.many_steps = False
    for run in (many, single):
        run.march_until_end_or_failure(0.95)
        assert run.history.onset.step < len(run.history.states) - 5
    for a, b in zip(many.history.states, single.history.states, strict=True):
        np.testing.assert_allclose(a.q, b.q, rtol=0.0, atol=1e-12)
