"""Elements that travel with a light car's front: their motion, what they weigh, and the answer of a finer mesh."""

import numpy as np
import pytest

from cablefem.elements.following import FollowingElements
from cablefem.elements.front import FrontElements, lines
from cablefem.elements.kernels.balance import combine, follow
from cablefem.elements.kernels.front import follow_fronts, weigh
from cablefem.newmark import step_times
from cablefem.scene import Scene
from validation.core import measures
from validation.core.running import run

SCENE = Scene.from_groups(sag_ratio=0.037, alpha=310.0, slope=8.0, mu=0.043, speed_ratio=0.53)
KIND = {"until": 0.8, "scheme": "radau"}


@pytest.fixture(scope="module")
def system():
    return FrontElements(SCENE.groups, elements=9, degree=2)


def spans(system, t):
    kinematics = np.ascontiguousarray(system.motion.along(t, 0).T)
    out = np.empty((t.size, *system._mesh.span.shape))
    follow_fronts(system._xi, system._lines, system._width, t, kinematics, out)
    return out


def test_velocity_and_acceleration_of_the_elements_are_derivatives_of_their_place(system):
    t, h = np.random.default_rng(4).uniform(0.02, 0.9, 40) * SCENE.groups.motion.phases[-1][1], 1e-5
    before, now, after = (spans(system, t + x) for x in (-h, 0.0, h))
    for k in (2, 3, 4, 5):
        rate = (after[..., k - 2] - before[..., k - 2]) / (2.0 * h)
        np.testing.assert_allclose(rate, now[..., k], rtol=1e-4, atol=1e-4 * np.abs(now[..., k]).max())
    assert np.abs((after - before)[..., 2] / (2.0 * h) + now[..., 4]).max() > 1.0  # with the other sign


def test_elements_touch_end_at_the_mass_and_gather_at_the_front(system):
    t = np.array([0.4, 1.1])
    of, n = spans(system, t), 9
    for side, ends in ((0, (0.0 * t, system.motion.position(t))), (1, (system.motion.position(t), 0.0 * t + 1.0))):
        xi, part = system._xi[side], of[:, side * n : (side + 1) * n]
        begin, end = (part[..., 0] + part[..., 1] * x for x in (xi[:-1], xi[1:]))
        np.testing.assert_allclose(begin[:, 1:], end[:, :-1], rtol=1e-12)
        np.testing.assert_allclose(np.stack([begin[:, 0], end[:, -1]]), ends, rtol=1e-12, atol=1e-15)
        assert (end > begin).all()
    ahead = (of[0, n:, 0] + of[0, n:, 1] * system._xi[1, 1:])[np.argmin(of[0, n:, 1][1:-1]) + 1]
    assert abs(ahead - 0.4) < 2.0 * system._width


def test_weighs_what_the_following_mesh_weighs_where_it_moves_like_it(system):
    plain = FollowingElements(SCENE.groups, elements=9, degree=2)
    coefficients, span = np.empty((8, 3)), np.empty_like(system._mesh.span)
    follow(0.37, 0.6, -1.3, 9, coefficients, span)
    expected, found = np.empty_like(plain._bands), np.empty_like(plain._bands)
    combine(plain._operators, coefficients, expected)
    weigh(span, plain._dofs, plain._fine, 2, found)
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-13)
    span[:, 4:] *= -1.0
    weigh(span, plain._dofs, plain._fine, 2, found)
    assert np.abs(found[2] - expected[2]).max() > 0.1


def test_front_meets_the_car_where_waves_of_speed_one_do():
    """From s = 0 to the far support and back: s_o = V t = 2 - t."""
    motion = SCENE.groups.motion
    V = motion.at(0.0, 0)[1]
    left, right = lines(motion, 1.0, 0.05)
    meeting = 2.0 / (1.0 + V), 2.0 * V / (1.0 + V)
    assert right[1] == pytest.approx([1.0, 1.0])
    assert right[2] == pytest.approx(meeting, rel=1e-3)
    assert left[1] == pytest.approx(meeting, rel=1e-3)
    back = meeting[0] + 2.0 * (1.0 - meeting[1]) / (1.0 + V)  # what the car has thrown back
    assert right[4] == pytest.approx([back, V * back], rel=1e-3)


def test_steps_are_short_where_a_front_meets_something_and_those_of_half_as_many_are_among_them(system):
    (few,), (many,) = step_times(system, 60), step_times(system, 120)
    np.testing.assert_allclose(many[::2], few, rtol=1e-12)
    dt = np.diff(many)
    t = np.array([0.5, 1.0])  # between, and at the support
    away, met = dt[np.searchsorted(many, t) - 1]
    assert away == pytest.approx(4.0 * met, rel=1e-6)


def test_answers_of_a_finer_following_mesh_with_a_fraction_of_its_unknowns():
    """Path and tensions; the plain mesh with as many elements is far off."""
    fine = run(SCENE, "following-p2", elements=110, steps=560, **KIND)
    window = measures.window_of(fine)
    gap, tension = {}, {}
    for nodes in ("front", "mass"):
        r = run(SCENE, "following-p2", elements=26, steps=160, nodes=nodes, **KIND)
        gap[nodes], tension[nodes] = measures.path_gap(r, fine, window)[0], measures.tension_gap(r, fine, window)
    assert gap["front"] < 1.0e-3
    assert gap["mass"] > 3.0 * gap["front"]
    assert tension["front"] < 2e-3


def test_a_car_that_rolls_has_no_front():
    with pytest.raises(ValueError, match="nodes = front"):
        run(Scene.load("zipline"), "following-p2", nodes="front")
