"""Rules that balance inside a step, from rest at a support where one side of the mass has no length yet."""

import numpy as np
import pytest

from cablefem import Scene
from validation.core.running import run

SCENES = {name: Scene.load(name) for name in ("cruise", "inclined")}
SETTINGS = {"following-p2": {"elements": 6}, "fourier-kink": {"terms": 10}}


def tensions_behind(scene, method, **scheme):
    r = run(SCENES[scene], method, until=0.002, steps=300, **SETTINGS[method], **scheme)
    return r.T_behind[1:] / r.horizontal_tension


@pytest.mark.parametrize("method", SETTINGS)
@pytest.mark.parametrize("scene", SCENES)
def test_tension_behind_the_mass_is_right_from_the_first_step_on(scene, method):
    exact = tensions_behind(scene, method, scheme="trapezoidal")
    assert exact.size > 5
    assert np.abs(tensions_behind(scene, method, scheme="generalized-alpha", rho_inf=0.8) - exact).max() < 0.02


@pytest.mark.parametrize("model", ["full", "string", "sagged", "stretching"])
def test_both_wings_set_off_along_the_same_path_from_the_first_step_on(model):
    """From rest w = d s_o, with a slope d that each wing has from its own balance."""
    slopes = []
    for method, settings in SETTINGS.items():
        r = run(SCENES["cruise"], method, until=0.002, steps=300, model=model, scheme="trapezoidal", **settings)
        slopes.append(r.v[1:8] / r.s_o[1:8])
    assert np.all(np.abs(slopes[1] / slopes[0] - 1.0) < 2e-3)


@pytest.mark.parametrize("scene", ["cruise", "level"])
def test_the_place_between_two_instants_is_the_mean_of_their_places(scene):
    motion = Scene.load(scene).groups.motion
    t0, t1 = motion.phases[0]
    for begin, end in ((t0, 0.1 * t1), (0.3 * t1, 0.4 * t1)):
        t0 = np.linspace(begin, end, 5)[:-1]
        t1 = np.append(t0[1:], end)
        s = [motion.positions_with_rates(t, 0)[0] for t in (t0, motion.times_of_mean_positions(t0, t1, 0.3, 0), t1)]
        assert s[1] == pytest.approx(0.7 * s[0] + 0.3 * s[2], rel=1e-8)
