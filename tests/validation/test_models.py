"""The cheaper models of both wings: how far from the full cable, how close to one another, how cheap."""

from dataclasses import replace

import numpy as np
import pytest

from cablefem import Scene
from validation.commands.advise.study import LADDER, relative_gaps_by_need
from validation.core import measures
from validation.core.running import run
from validation.core.view import View

LEVEL = Scene.load("level")
WINDOW = measures.WINDOW


def run_full_model(scene, elements=20, steps=1200):
    return run(scene, "following-p2", elements=elements, steps=steps, until=WINDOW[1])


# off the beaten numbers: inclined, neither light nor heavy, from rest
OTHER = Scene.from_groups(
    sag_ratio=0.031, slope=23.0, alpha=460.0, mu=0.62, speed_ratio=0.57, travel="accelerate_cruise_brake", name="other"
)


@pytest.mark.parametrize(("model", "load"), LADDER[:-1])
def test_both_wings_have_the_same_models(model, load):
    """Two solvers that share no formula; what is left is the front of a massless force, first order in either."""
    kind = {"model": model, "load": load, "until": WINDOW[1]}
    a = run(OTHER, "following-p2", elements=16, steps=600, **kind)
    b = run(OTHER, "fourier-kink", terms=24, steps=600, **kind)
    path = measures.relative_path_gap(a, b, WINDOW).largest
    assert path < 3e-3
    assert measures.rms_tension_gap_over_H(a, b, WINDOW) < 2e-3
    np.testing.assert_allclose(a.u, -a.v * np.tan(np.radians(OTHER.slope)), rtol=0.0, atol=1e-9 * OTHER.length)


def test_models_that_differ_are_seen_to_differ():
    runs = [
        run(OTHER, "following-p2", model=model, load=load, elements=10, steps=400, until=WINDOW[1])
        for model, load in LADDER[:-1]
    ]
    for i, a in enumerate(runs):
        for b in runs[:i]:
            assert measures.relative_path_gap(a, b, WINDOW).largest > 2e-2, (a.model, a.load, b.model, b.load)


def test_a_run_that_stops_short_has_no_distance():
    far = run_full_model(LEVEL, elements=6, steps=200)
    short = run(LEVEL, "following-p2", model="string", elements=6, steps=200, until=0.4)
    view = View.of_scene(LEVEL)
    assert set(relative_gaps_by_need(short, far, view).values()) == {np.inf}
    assert max(relative_gaps_by_need(short, far, replace(view, window=(0.02, 0.39))).values()) < np.inf
