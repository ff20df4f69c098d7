"""The numbers behind the paper's figures, and what a travelling kink adds to its method.

Path errors are largest |v - v_reference| on 0.02 <= s_o/l <= 0.80 over the largest v.  The reference is elements that
follow the mass: they share no formula with the Galerkin side.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from cablefem import Scene
from cablefem.response import Response
from galerkin import Daubechies, Fourier, bare_frequencies
from validation.commands.paper import gibbs
from validation.core import measures
from validation.core.running import run
from validation.oracles import catenary_modes, moving_mass

WINDOW = (0.02, 0.80)
LEVEL = Scene.load("level")


@cache
def computed(scene: str, method: str, model: str = "full", **settings: int) -> Response:
    return run(Scene.load(scene), method, model=model, **settings)


def reference(scene: str, elements: int = 24, steps: int = 2000) -> Response:
    """Halving both again moves the level path by 7e-5, the others by less."""
    return computed(scene, "following-p2", elements=elements, steps=steps)


def path_error(r: Response, exact: Response) -> float:
    inside = measures.inside(r, WINDOW)
    return float(np.abs(r.v - measures.at_steps_of(r, exact, exact.v))[inside].max() / exact.max_deflection)


def tension_gap(a: Response, b: Response) -> float:
    """Largest |T_a - T_b|/H over frames and stations off the mass."""
    place, i, j = measures.common_frames(a, b)
    inside = (place >= WINDOW[0]) & (place <= WINDOW[1])
    away = np.abs(a.fields.s[None, :] / a.length - place[inside][:, None]) >= measures.JUMP_WIDTH
    return float(np.abs(a.fields.T[i[inside]] - b.fields.T[j[inside]])[away].max() / a.horizontal_tension)


# --- figure 2 -------------------------------------------------------------------------------------------------------


def test_wavelet_frequencies_to_the_digits_known_each_from_above():
    groups = LEVEL.groups
    omega = [
        bare_frequencies(groups, Daubechies(order=4, level=level, reading="literal"), n=1)[0] for level in range(4)
    ]
    assert [round(x, 5) for x in omega] == [5.34615, 5.34548, 5.34548, 5.34548]
    exact = catenary_modes.solve(groups.sigma, groups.alpha, groups.c, count=1).omega[0]
    assert omega[0] > omega[1] > omega[2] > exact
    assert omega[3] > exact - 1e-8  # quadrature of the tangent


def test_other_readings_of_the_wavelet_sets_do_not_give_the_frequency():
    stalled = bare_frequencies(LEVEL.groups, Daubechies(order=4, level=3, reading="scaling"), n=1)[0]
    assert stalled > 5.40


# --- paths ----------------------------------------------------------------------------------------------------------


def test_ten_sines_and_a_kink_beat_a_hundred_plain_ones():
    exact = reference("level")
    kink = path_error(computed("level", "fourier-kink", terms=10, steps=1000), exact)
    plain = path_error(computed("level", "fourier", terms=100, steps=1000), exact)
    assert kink <= 6e-3
    assert 0.8e-2 < plain < 1.2e-2
    thirty = path_error(computed("level", "fourier-kink", terms=30, steps=1000), exact)
    assert thirty <= 6e-4  # half of it is the time error of 1000 steps


def test_a_kink_helps_wavelets_as_much():
    exact = reference("level")
    plain = path_error(computed("level", "wavelet", level=2, steps=1000), exact)
    kink = path_error(computed("level", "wavelet-kink", level=2, steps=1000), exact)
    assert plain > 2e-2
    assert 10.0 * kink < plain


def test_kink_and_following_elements_agree_on_the_inclined_cable_path_and_tension():
    exact = reference("inclined")
    r = computed("inclined", "fourier-kink", terms=60, steps=2000)
    assert measures.path_gap(r, exact, WINDOW)[0] <= 1e-4
    assert tension_gap(r, exact) <= 0.001
    # must fail: plain sines of the same number
    assert tension_gap(computed("inclined", "fourier", terms=60, steps=1000), exact) > 0.003


@pytest.mark.slow
@pytest.mark.parametrize(
    ("terms", "steps", "bound"), [(10, 8000, 6e-3), (30, 8000, 3.5e-4), (60, 8000, 1.2e-4), (90, 8000, 5e-5)]
)
def test_sines_and_a_kink_on_the_level_cable(terms, steps, bound):
    """Up to 20 s each; the reference's own error is 2e-5."""
    exact = reference("level", elements=60, steps=8000)
    assert path_error(computed("level", "fourier-kink", terms=terms, steps=steps), exact) <= bound


# --- figures 9 and 10 -----------------------------------------------------------------------------------------------


def test_the_overshoot_of_plain_sines_does_not_shrink_and_is_gone_with_the_kink():
    groups = Scene.load("inclined").groups
    few, many = (gibbs.overshoot(groups, "fourier", n) for n in (15, 60))
    assert few.size > 0.03
    assert 0.75 < many.size / few.size < 1.35  # 0.25 if it fell as the path's error does
    kink = [gibbs.overshoot(groups, "fourier-kink", n).size for n in (15, 60)]
    assert kink[0] < 0.1 * few.size
    assert kink[1] < 0.4 * kink[0]


# --- the linear string against its exact answer ---------------------------------------------------------------------


def string_error(method: str, steps: int = 2000, **settings: int) -> float:
    """Against delay equations; the load carries the static curvature, M (g + V^2 sigma g), in the string too."""
    groups = LEVEL.groups
    V = groups.motion.at(0.0, 0)[1]
    exact = _ride(groups.mu, groups.sigma * (1.0 + V**2), V)
    r = computed("level", method, model="string", steps=steps, **settings)
    path = LEVEL.length * exact.path(r.t / LEVEL.time_scale)
    return float(np.abs(r.v - path)[measures.inside(r, WINDOW)].max() / path.max())


@cache
def _ride(mu: float, sigma: float, V: float):
    return moving_mass.solve(moving_mass.constant_speed(V), mu=mu, sigma=sigma)


@pytest.mark.parametrize(
    ("method", "knob", "ladder", "order", "finest"),
    [
        ("fourier", "terms", (20, 40, 80), 1.0, 8e-3),
        ("wavelet", "level", (0, 1, 2), 1.0, 2.5e-2),
        ("fourier-kink", "terms", (10, 20, 40), 2.0, 4e-5),
    ],
)
def test_observed_order_of_the_path_on_the_linear_string(method, knob, ladder, order, finest):
    """The kink at the mass costs sums of smooth functions their order; with a hat of its own it does not.

    Wavelets: N = 10, 17, 31 is a little less than doubling, the cell they resolve halves.
    """
    errors = np.array([string_error(method, **{knob: n}) for n in ladder])
    slope = np.log2(errors[0] / errors[-1]) / (len(ladder) - 1)
    assert abs(slope - order) < 0.15, errors
    assert errors[-1] < finest


def test_fourier_frequencies_fall_towards_the_same_value():
    omega = [bare_frequencies(LEVEL.groups, Fourier(n), n=1)[0] for n in (10, 30, 100)]
    assert omega[0] > omega[1] > omega[2] > 5.345476
    assert omega[2] < 5.34548
