"""Lines in motion against laws of mechanics and exact answers."""

import dataclasses
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from cablefem.elements.system import LineElements
from cablefem.newmark import Work, consistent_acceleration, integrate, scheme, step_times_by_phase
from cablefem.scene.motion import Motion, Piece
from galerkin.lines import LineSines
from tests.motion.lines import ALL, LEFT, anchor, car, line, run_and_observe, states_by_radau
from validation.oracles.damped_mass import extrapolated_load_displacement

G = 9.81


@pytest.fixture(scope="module")
def motion_of_everything():
    return run_and_observe(LineElements(ALL), 240, np.linspace(5.0, 1100.0, 40))


def test_energy_is_what_drives_and_weights_put_in(motion_of_everything):
    x = motion_of_everything
    work = np.append(0.0, cumulative_simpson(sum(x.powers.values()), x=x.t))
    size = np.ptp(x.energy)
    np.testing.assert_allclose(x.energy - x.energy[0], work, atol=5e-5 * size)
    without = work - np.append(0.0, cumulative_simpson(x.powers["weight weight"], x=x.t))
    assert np.abs(x.energy - x.energy[0] - without).max() > 1e-2 * size


def test_momentum_jumps_at_each_car_by_its_force(motion_of_everything):
    """[N t - rho ds^2 r'] = M (p.. - g j) - F tau - drag, with N by the slopes."""
    rope = ALL.rope
    for at, given in zip(motion_of_everything.cars, ALL.cars_on_rope, strict=True):
        sides = []
        for slope in (at.slope_behind, at.slope_ahead):
            lam = np.linalg.norm(slope, axis=1)
            N = rope.EA * (lam - 1.0)
            sides.append((N / lam - rope.mass_per_length * at.ds**2)[:, None] * slope)
        mean = at.slope_behind + at.slope_ahead
        tau = mean / np.linalg.norm(mean, axis=1)[:, None]
        air = at.velocity - [given.drive.wind, 0.0]
        outside = (
            np.nan_to_num(at.haul_force)[:, None] * tau - given.drive.k * np.linalg.norm(air, axis=1)[:, None] * air
        )
        want = given.mass * (at.acceleration - [0.0, G]) - outside
        np.testing.assert_allclose(sides[1] - sides[0], want, atol=1e-4 * given.mass * G)


def test_tension_is_the_same_on_both_sides_of_saddles_and_cars_without_friction(motion_of_everything):
    tower, smooth = motion_of_everything.contacts[1], motion_of_everything.cars[2]
    for at in (tower, smooth):
        np.testing.assert_allclose(at.tension_behind, at.tension_ahead, rtol=1e-5)  # Newton's: 1e-4 of a weight
    grip = motion_of_everything.cars[0]
    assert (np.abs(grip.tension_ahead / grip.tension_behind - 1.0) > 1e-3).all()
    assert np.ptp(tower.s) > 0.05, "the rope must run over the saddle, or the test shows nothing"


def test_stations_and_contacts_show_one_tension(motion_of_everything):
    near = np.abs(motion_of_everything.s - 1.0) < 1e-9
    assert not near.any()
    x = run_and_observe(LineElements(dataclasses.replace(ALL, t_end=1.0)), 12, [0.0, 300.0])
    np.testing.assert_allclose(x.tension[:, 0], x.contacts[0].tension_ahead, rtol=1e-4)


def test_a_mirrored_line_moves_alike():
    rope = {"mass_per_length": 6.0, "EA": 9e7, "length": 405.0}
    scene = line(rope, LEFT, car("a", 900.0, _steady(80.0, 12.0)), car("b", 700.0, _steady(290.0, -9.0), "haul"),
                 anchor("right", 400.0, -60.0), t_end=6.0)  # fmt: skip
    mirrored = line(rope, LEFT, car("b", 700.0, _steady(115.0, 9.0), "haul"), car("a", 900.0, _steady(325.0, -12.0)),
                    anchor("right", 400.0, 60.0), t_end=6.0)  # fmt: skip
    x, y = (run_and_observe(LineElements(z, elements=4), 60) for z in (scene, mirrored))
    for one, other in zip(x.cars, reversed(y.cars), strict=True):
        np.testing.assert_allclose(one.point[:, 0], 400.0 - other.point[:, 0], atol=1e-7)
        np.testing.assert_allclose(one.point[:, 1] + 60.0, other.point[:, 1], atol=1e-7)
        np.testing.assert_allclose(one.tension_behind, other.tension_ahead, rtol=1e-8)
    np.testing.assert_allclose(x.cars[1].haul_force, -y.cars[0].haul_force, rtol=1e-6)


def _steady(begin: float, speed: float) -> Motion:
    return Motion(((0.0, 1e3),), ((Piece(0.0, 0.0, begin, speed, 0.0),),), begin + 1e3 * speed)


@pytest.mark.parametrize(("gravity", "allowed"), [(0.98, 4e-3), (0.098, 1e-4)])
def test_two_gripping_cars_on_a_taut_string_meet_each_others_waves(gravity, allowed):
    """M_i w_i. + I_i = M_i g t, I_i the impulse of car i on the string: first order in the load."""
    l, T, rho, EA, t_end = 100.0, 1e4, 1.0, 1e6, 1.3
    lam, c = 1.0 + T / EA, np.sqrt(T * (1.0 + T / EA) / rho)
    masses, begin, speed = np.array([12.0, 7.0]), np.array([20.0, 75.0]), np.array([25.0, -15.0])
    travels = [_steady(x / lam, v / lam) for x, v in zip(begin, speed, strict=True)]

    def string(sizes: np.ndarray, g: float) -> LineElements:
        cars = [car(name, m, z) for name, m, z in zip("ab", sizes, travels, strict=True)]
        rope = {"mass_per_length": rho, "EA": EA, "length": l / lam}
        return LineElements(line(rope, LEFT, *cars, anchor("right", l, 0.0), t_end=t_end, gravity=g), elements=12)

    # the string begins in its own shape at rest, which is taken away: the answer is of first order
    unloaded, system = string(1e-9 * masses, gravity), string(masses, gravity)
    rest = unloaded.start(0, None)
    states = states_by_radau(system, 130, consistent_acceleration(system, 0.0, rest.q, rest.v, 0))
    x = system.observe(states, np.array([1.0]))
    bends = gravity * (1.0 + (speed / c) ** 2)  # the way along the string's own shape is curved
    exact = _displacements_on_string(x.t, l, c, T, masses, begin, speed, bends)
    for at, want in zip(x.cars, exact, strict=True):
        away = at.point[:, 0]
        w = at.point[:, 1] - 0.5 * rho / lam * gravity * away * (l - away) / T
        assert np.abs(w - want).max() < allowed * np.abs(want).max()


@pytest.mark.parametrize("make", [partial(LineElements, elements=12), partial(LineSines, terms=20)])
@pytest.mark.parametrize(("damping", "told", "agree"), [(1.0, 1.0, True), (4.0, 4.0, True), (4.0, 3.9, False)])
def test_a_gripping_car_on_a_damped_string_sags_as_its_green_function_says(make, damping, told, agree):
    l, T, rho, EA, gravity, mu, speed, begin, t_end = 100.0, 1e4, 1.0, 1e6, 0.098, 0.5, 0.4, 0.3, 1.5
    lam = 1.0 + T / EA
    c = np.sqrt(T * lam / rho)
    mass = mu * rho / lam * l
    rope = {"mass_per_length": rho, "EA": EA, "length": l / lam, "damping": damping * c / l}

    def string(size: float) -> Any:
        one = car("one", size, _steady(begin * l / lam, speed * c / lam))
        return make(line(rope, LEFT, one, anchor("right", l, 0.0), t_end=t_end * l / c, gravity=gravity))

    rest = string(1e-9 * mass).start(0, None)
    system = string(mass)
    states = states_by_radau(system, 130, consistent_acceleration(system, 0.0, rest.q, rest.v, 0))
    x = system.observe(states, np.ones(1))
    along, depth = x.cars[0].point.T
    w = depth - 0.5 * rho / lam * gravity * along * (l - along) / T  # the string begins in its own shape
    load = mass * gravity / T * (1.0 + speed**2)  # the way along that shape is curved
    exact = extrapolated_load_displacement(t_end, mu=mu, P=load, V=speed, s0=begin, c=told)(x.t * c / l)
    gap = np.abs(w / l - exact).max() / exact.max()
    assert (gap < 1e-4) == agree


def _displacements_on_string(t, l, c, T, masses, begin, speed, gravity):
    """w_i = (c/2T) sum over cars and images (2 m l +- x_j, sign +-) of +- I_j at the retarded time."""
    fine = np.linspace(0.0, t[-1], 1001)
    dt, n = fine[1], fine.size
    impulse, w = np.zeros((2, n)), np.zeros((2, n))
    images = [(m, sign, j) for m in (-1, 0, 1) for sign in (1.0, -1.0) for j in (0, 1)]

    def echoes(i: int, k: int) -> float:
        at, total = begin[i] + speed[i] * fine[k], 0.0
        for m, sign, j in images:
            if (m, sign, j) == (0, 1.0, i):
                continue
            first = 2.0 * m * l + sign * begin[j]
            side = np.sign(at - first)
            when = (c * fine[k] - side * (at - first)) / (c - side * sign * speed[j])
            if when > 0.0:
                total += sign * np.interp(when, fine[: k + 1], impulse[j, : k + 1])
        return total

    for k in range(1, n):
        for i in range(2):
            late = echoes(i, k)
            # trapezoidal rule of M w. = M g t - (2 T/c) w + late
            before = masses[i] * gravity[i] * fine[k - 1] - impulse[i, k - 1]
            a, b = masses[i] / dt, T / c
            w[i, k] = (a * w[i, k - 1] + 0.5 * before + 0.5 * (masses[i] * gravity[i] * fine[k] + late)) / (a + b)
            impulse[i, k] = 2.0 * T / c * w[i, k] - late
    return np.array([np.interp(t, fine, z) for z in w])


@pytest.mark.parametrize("make", [lambda: LineElements(ALL, elements=2), lambda: LineSines(ALL, 4)])
def test_a_tangent_serves_many_steps_and_the_motion_stays(make):
    ends, works = [], []
    for keeps in (True, False):
        system, work = make(), Work()
        system.reuses_factors = keeps
        *_, end = integrate(system, scheme("radau"), step_times_by_phase(system, 60), work=work)
        ends.append([car.point[0] for car in system.observe([end], np.zeros(1)).cars])
        works.append(work.factorisations)
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-5)
    assert works[0] < 0.5 * works[1]
