"""Lines in motion by sines: tangent, exact answers, laws, and the other wing."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson
from scipy.linalg import eig

from cablefem import Scene
from cablefem.elements.system import LineElements
from cablefem.newmark import State, StepFailure, Work, integrate, scheme, step_times_by_phase
from cablefem.scene.bodies import Hanger, Wheels
from cablefem.scene.contacts import Car, Elastic, MovingLine
from galerkin.bodies import Friction
from galerkin.carrying import positions_slopes_and_velocities_at
from galerkin.line_rest import coordinates_at_rest
from galerkin.lines import LineSines
from tests.motion.lines import (
    ALL,
    LEFT,
    RIGHT,
    ROPE,
    WEIGHED,
    Smooth,
    anchor,
    car,
    line,
    run_and_observe,
    saddle,
    spring,
    states_by_radau,
    weight,
)
from tests.motion.test_moving import _displacements_on_string, _steady
from tests.scene.test_ride import ZIP

TWO = line({"mass_per_length": 11.4, "EA": 2.1e8, "length": 812.0}, LEFT, car("up", 5000.0, Smooth(100.0, 8.0)),
           car("down", 4000.0, Smooth(600.0, -6.0), "haul"), anchor("right", 800.0, -120.0), t_end=20.0)  # fmt: skip
SLIDING = line({"mass_per_length": 9.0, "EA": 1.4e8, "length": 824.0}, LEFT, car("up", 4000.0, Smooth(100.0, 8.0)),
               saddle("tower", 400.0, -30.0), anchor("right", 820.0, -20.0), t_end=20.0)  # fmt: skip
SCENES = {"two cars": TWO, "counterweight": line(ROPE, LEFT, car("up", 5000.0, Smooth(150.0, 9.0), "haul"), RIGHT),
          "saddle": SLIDING, "spring": line(ROPE, spring(0.0, 0.0), WEIGHED.contacts[1], RIGHT),
          "all": ALL}  # fmt: skip
WHEELS = Wheels(base=3.0, inertia=4e3, below=1.5, ahead=0.3)
CABIN = Hanger(mass=800.0, length=4.0, gyration=1.2, damping=0.1)


def system_and_random_state(scene, terms=5):
    """A system and a state far from balance."""
    system, rng = LineSines(scene, terms), np.random.default_rng(3)
    x = system.start(0, None)
    q, v, a = (z + rng.normal(size=x.q.size) * size for z, size in zip(x[1:4], (0.02, 0.5, 0.5), strict=True))
    return system, State(1.0, q, v, a, 0)


@pytest.mark.parametrize("bodies", [{}, {"wheels": WHEELS}, {"hanger": CABIN}])
def test_tangent_is_the_derivative(bodies):
    turned = {"hitch": (0.3, -2.0), "thrust_angle": 0.2, "thrust_at": (-1.0, -0.2), "rear_brakes": ((500.0, 2e3),)}
    free = car("free", 900.0, None, "free", start=1e3, mu_r=0.02, k=0.4, thrust_table=((0.0, 3e3), (9.0, 3e3)))
    cars = [
        dataclasses.replace(c, **bodies, drive=dataclasses.replace(c.drive, **turned)) if isinstance(c, Car) else c
        for c in (*ALL.contacts[:-1], free, ALL.contacts[-1])
    ]
    system, x = system_and_random_state(dataclasses.replace(ALL, contacts=tuple(cars)))
    Z = system.all_coordinates_with_rates(x)[:, None]
    _, tangent = system.equations.evaluate_with_derivatives(Z, system.frictions_at([1.0]))
    rng = np.random.default_rng(5)
    for which, part, step in ((1, tangent[0], 1e-4), (2, tangent[1], 1e-3), (3, tangent[2], 1e-1)):
        largest = np.abs(part).max(axis=0)
        sizes = np.where(largest > 0.0, step * largest.max() / np.maximum(largest, 1e-6 * largest.max()), step)

        def residual(e, which=which):
            return system.residual(*(z + e if i == which else z for i, z in enumerate(x)))

        for j in (*rng.choice(system.n_dof, 12, replace=False), *range(system.n_dof - 24, system.n_dof)):
            e = np.zeros(system.n_dof)
            e[j] = min(sizes[j], 10.0 * step)
            difference = 8.0 * (residual(e) - residual(-e)) - residual(2.0 * e) + residual(-2.0 * e)
            np.testing.assert_allclose(difference / 12.0, part @ e, atol=1e-6 * (np.abs(part @ e).max() + 1e-3))


def test_inertia_is_that_of_points_of_the_rope():
    """Differences of r at fixed s, while contacts move along the rope; damping acts with the inertia."""
    system, x = system_and_random_state(ALL)
    layout, Z, dt = system.layout, system.all_coordinates_with_rates(x), 1e-3
    values = system.equations.evaluate(Z[:, None], system.frictions_at([x.t]))
    s = Z[0, layout.s[:-1], None] + layout.tables.points * np.diff(Z[0, layout.s])[:, None]
    before, now, after = (
        positions_slopes_and_velocities_at(layout, np.stack([Z[0] + t * Z[1] + 0.5 * t**2 * Z[2], Z[1]]), s.ravel())[0]
        for t in (-dt, 0.0, dt)
    )
    acceleration = (after - 2.0 * now + before) / dt**2
    velocity = (after - before) / (2.0 * dt)
    want = ROPE["mass_per_length"] * (acceleration + ALL.rope.damping * velocity - [0.0, 9.81])
    got = values.inertia_and_weight[0].reshape(want.shape)
    np.testing.assert_allclose(got, want, atol=1e-5 * np.abs(want).max())


def test_newton_doubles_the_digits():
    system, x = system_and_random_state(ALL)
    dt, a, norms = 0.02, x.a, []
    for _ in range(4):
        state = x.t, x.q + dt**2 * a / 4.0, x.v + dt * a / 2.0, a, 0
        r, solve = system.linearise(*state, (dt**2 / 4.0, dt / 2.0, 1.0))
        norms.append(np.linalg.norm(r))
        a = a - solve(r.copy())
    assert norms[2] > 1e5 * system.force_floor
    assert norms[3] < 1e-5 * norms[2]


def frequencies(scene, terms):
    """Of the line with its cars held, rising [1/s]."""
    system = LineSines(scene, terms)
    rest = coordinates_at_rest(system)
    frictions = np.array([[Friction() for _ in scene.contacts]])
    _, K = system.equations.evaluate_with_derivatives(rest[:, None], frictions)
    return np.sort(np.sqrt(eig(K[0], K[2], right=False).real))


def test_frequencies_of_a_car_and_of_a_counterweight():
    empty = line(ROPE, LEFT, RIGHT)
    np.testing.assert_allclose(frequencies(WEIGHED, 6)[:3], [0.61781632, 2.0816558, 2.3354839], rtol=2e-8)
    exact = [1.12168304, 2.26609538, 2.37919708, 3.58003800]
    np.testing.assert_allclose(frequencies(empty, 12)[:4], exact, rtol=2e-7)
    straight = {"mass_per_length": 8.0, "EA": 1e8}
    heavy = line(straight, LEFT, weight(400.0, 0.0, 3e5), gravity=1e-3)
    assert np.abs(frequencies(heavy, 8) - 0.0289107311).min() < 1e-9


@pytest.fixture(scope="module")
def runs_of_both_wings():
    s = np.linspace(5.0, 560.0, 12)
    known = {}

    def both(name):
        if name not in known:
            scene = SCENES[name]
            known[name] = run_and_observe(LineElements(scene), 160, s), run_and_observe(LineSines(scene, 6), 160, s)
        return known[name]

    return both


@pytest.mark.parametrize("name", SCENES)
def test_both_wings_agree(name, runs_of_both_wings):
    one, other = runs_of_both_wings(name)
    T = max(np.nanmax(c.tension_ahead) for c in one.cars)
    np.testing.assert_allclose(one.points, other.points, atol=1e-4)
    np.testing.assert_allclose(one.tension, other.tension, atol=1e-5 * T)
    assert one.powers.keys() == other.powers.keys()
    largest = max(np.abs(power).max() for power in one.powers.values())
    for cause, power in one.powers.items():
        np.testing.assert_allclose(power, other.powers[cause], atol=1e-3 * largest + 1e-5 * T)
    for a, b in zip((*one.cars, *one.contacts), (*other.cars, *other.contacts), strict=True):
        for field in dataclasses.fields(a):
            x, y = getattr(a, field.name), getattr(b, field.name)
            if "force" in field.name or "tension" in field.name or field.name == "pressure":
                np.testing.assert_allclose(x, y, atol=1e-5 * T)
            elif field.name not in ("name", "kind", "turning", "wheel_loads"):
                np.testing.assert_allclose(x, y, atol=1e-3 if field.name == "acceleration" else 1e-5)


@pytest.mark.parametrize("name", ["two cars", "all"])
def test_energy_is_what_drives_and_weights_put_in(name, runs_of_both_wings):
    x = runs_of_both_wings(name)[1]
    work = np.append(0.0, cumulative_simpson(sum(x.powers.values()), x=x.t))
    np.testing.assert_allclose(x.energy - x.energy[0], work, atol=1e-4 * np.ptp(x.energy))


def test_a_mirrored_line_moves_alike():
    def mirrored(scene):
        end, drop = scene.contacts[-1].point
        left, _, tower, _ = scene.contacts
        up = car("up", 4000.0, Smooth(scene.rope.length - 100.0, -8.0))
        tower = saddle("tower", end - tower.point[0], tower.point[1] - drop)
        return dataclasses.replace(scene, contacts=(left, tower, up, anchor("right", end, -drop)), t_end=8.0)

    x = run_and_observe(LineSines(dataclasses.replace(SLIDING, t_end=8.0), 4), 60)
    y = run_and_observe(LineSines(mirrored(SLIDING), 4), 60)
    reflected = [820.0, -20.0] + y.cars[0].point * [-1.0, 1.0]
    np.testing.assert_allclose(x.cars[0].point, reflected, atol=1e-7)
    np.testing.assert_allclose(x.cars[0].tension_behind, y.cars[0].tension_ahead, rtol=1e-9)
    np.testing.assert_allclose(x.contacts[1].ds, -y.contacts[1].ds, atol=1e-8)


def test_a_rider_is_braked_where_the_text_on_rides_says():
    """Shared text on rides, section 6: places and times of a zip line with friction and a brake."""
    scene = Scene.from_toml(ZIP)
    shorter = 1.0 / (1.0 + scene.catenary.mean_tension / scene.cable.EA)
    rope = Elastic(mass_per_length=scene.rho / shorter, EA=scene.cable.EA, length=scene.length * shorter)
    rider = car("rider", 95.0, None, "free", start=2.0 * shorter, k=0.36, mu_r=0.02, brakes=((280.0 * shorter, 600.0),))
    system = LineSines(MovingLine(rope=rope, contacts=(LEFT, rider, anchor("right", 300.0, 15.0)), t_end=36.0), 6)
    work = Work()
    states = list(integrate(system, scheme("radau"), step_times_by_phase(system, 240, entry_ratio=1e-3), work=work))
    times = {event.name: event.t for event in work.events}  # the last of each
    assert times["rider brakes"] == pytest.approx(34.800, abs=2e-3)
    assert times["rider stops"] == pytest.approx(35.43, abs=0.01)
    assert system.all_coordinates_with_rates(states[-1])[0, system.layout.s[1]] / shorter == pytest.approx(
        281.375, abs=5e-3
    )


def test_two_gripping_cars_on_a_taut_string_meet_each_others_waves():
    gravity = 0.098
    l, T, rho, EA = 100.0, 1e4, 1.0, 1e6
    lam = 1.0 + T / EA
    c = np.sqrt(T * lam / rho)
    masses, begin, speed = np.array([12.0, 7.0]), np.array([20.0, 75.0]), np.array([25.0, -15.0])
    rope = {"mass_per_length": rho, "EA": EA, "length": l / lam}

    def string(sizes):
        cars = [car(*z) for z in zip("ab", sizes, map(_steady, begin / lam, speed / lam), strict=True)]
        return LineSines(line(rope, LEFT, *cars, anchor("right", l, 0.0), t_end=1.3, gravity=gravity), 20)

    system, unloaded = string(masses), string(1e-9 * masses)
    x = system.observe(states_by_radau(system, 130, system.with_acceleration(unloaded.start(0, None))), np.array([1.0]))
    bends = gravity * (1.0 + (speed / c) ** 2)  # the path along the shape of the rope is curved
    exact = _displacements_on_string(x.t, l, c, T, masses, begin, speed, bends)
    for at, want in zip(x.cars, exact, strict=True):
        along, depth = at.point.T
        w = depth - 0.5 * rho / lam * gravity * along * (l - along) / T
        assert np.abs(w - want).max() < 1e-4 * np.abs(want).max()


def test_a_saddle_that_would_have_to_hold_the_rope_down_is_refused():
    rope = {"mass_per_length": 9.0, "EA": 1.4e8, "length": 824.0}
    contacts = LEFT, saddle("tower", 400.0, 30.0), anchor("right", 820.0, -20.0)
    with pytest.raises(StepFailure, match="the smallest pressure on a saddle -"):
        LineSines(line(rope, *contacts), 4).start(0, None)
