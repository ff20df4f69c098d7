"""Cars on two wheels and cabins that swing: exact answers, laws of mechanics and the balance's derivative."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from cablefem.elements.rest import coordinates_at_rest, resting_coordinates_with_forces
from cablefem.elements.system import LineElements
from cablefem.newmark import Work, integrate_blocks, scheme, step_times_by_phase
from cablefem.scene.bodies import Hanger, Wheels
from cablefem.scene.contacts import Car, MovingLine
from cablefem.scene.drive import Drive
from cablefem.scene.motion import Motion, Piece
from tests.motion.lines import (
    LEFT,
    Smooth,
    anchor,
    car,
    last_of_equal_steps,
    line,
    run_and_observe,
    saddle,
    spring,
    weight,
)
from tests.motion.test_frequencies import frequencies
from tests.motion.test_segments import SOFT

G = 9.81
TRAM = {"mass_per_length": 13.3, "EA": 2.52e8, "length": 778.1681731397}
CABIN = Hanger(mass=700.0, length=3.0, gyration=0.8, damping=0.05)
SLED = Wheels(base=3.0, inertia=900.0, below=0.8, ahead=0.2)
RISE = anchor("right", 400.0, -60.0)
STEEL = {"mass_per_length": 6.0, "EA": 9e7, "length": 405.0}


def with_body(car: Car, body: Hanger | Wheels) -> Car:
    return dataclasses.replace(car, **{"hanger" if isinstance(body, Hanger) else "wheels": body})


def free_car(name: str, mass: float, start: float, **drive) -> Car:
    return Car(name=name, mass=mass, drive=Drive(mode="free", start=start, **drive))


def tram_line(travel, rope=TRAM, **more) -> MovingLine:
    wheels = Wheels(base=4.0, inertia=3e4, below=3.0, ahead=0.2)
    hauled = with_body(car("car", 8100.0, travel, "haul", hitch=(0.0, -2.0)), wheels)
    return line(rope, LEFT, hauled, anchor("right", 700.0, -341.0), **more)


@pytest.mark.parametrize(
    ("front", "rope", "exact"),
    [
        (100.0, TRAM, [95.05843704, -26.30059972, -0.3392363487, 96.01081712, 28267.450091, 20957.54104, 54020.46035]),
        (402.0, TRAM, [373.425053, -147.76544418, -0.433217347, 398.01305696, 35104.913919, 16213.34328, 55940.53766]),
        (402.0, TRAM | {"mass_per_length": 1e-9, "length": 785.0},
         [381.33062183, -123.56035185, -0.3908457193, 398.0043106, 35084.84303, 19139.73099, 54617.00243]),
    ],
)  # fmt: skip
def test_a_trolley_at_rest(front, rope, exact):
    system = LineElements(tram_line(front, rope))
    q = coordinates_at_rest(system, 0.0, 0)
    z = resting_coordinates_with_forces(system, q)
    x = system.observe([system.start(0, None)._replace(q=q[system.free], a=z.a[system.free])], np.array([1.0]))
    at = x.cars[0]
    loads = [wheel.load[0] for wheel in at.turning.wheels]
    found = [*at.turning.centre[0], at.turning.angle[0], at.turning.wheels[0].s[0], at.haul_force[0], *loads]
    np.testing.assert_allclose(found, exact, rtol=2e-9)


def test_a_trolley_in_motion():
    """Centre, pitch, tensions at both ends, loads and haul force by two prototypes without a common row."""
    x = run_and_observe(LineElements(tram_line(Smooth(100.0, 10.0), t_end=16.0)), 200)
    at = x.cars[0]
    for t, centre, pitch, tensions, loads, force in (
        (4.0, (100.94664, -28.38904), -0.329607, (689114.0, 733484.0), (12340.0, 63668.0), 47807.0),
        (8.0, (132.69611, -40.52901), -0.357207, (721478.0, 765833.0), (20222.0, 54392.0), 29406.0),
        (16.0, (207.16675, -71.04844), -0.384769, (775224.0, 819576.0), (18736.0, 55240.0), 31629.0),
    ):
        i = int(np.argmin(np.abs(x.t - t)))
        np.testing.assert_allclose(at.turning.centre[i], centre, atol=1e-4)
        assert at.turning.angle[i] == pytest.approx(pitch, abs=1e-4)
        ends = x.contacts[0].tension_ahead[i], x.contacts[1].tension_behind[i]
        np.testing.assert_allclose(ends, tensions, atol=37.0)
        np.testing.assert_allclose([wheel.load[i] for wheel in at.turning.wheels], loads, atol=42.0)
        assert at.haul_force[i] == pytest.approx(force, abs=50.0)


@pytest.mark.parametrize(
    ("rho", "exact"), [(8.0, [3.0462985308, 6.0920141939, 9.1364901995]), (0.008, [38.7691492271])]
)
def test_a_trolley_pitches_at_the_middle_of_a_straight_rope(rho, exact):
    """J w^2 = N b [x cot x + x cot(k L1)]."""
    stretch = 1.0 + 3e5 / 1e8

    def pitching(inertia: float) -> np.ndarray:
        wheels = Wheels(base=2.0, inertia=inertia)
        trolley = with_body(car("car", 100.0, 201.0 / stretch), wheels)
        rope = {"mass_per_length": rho, "EA": 1e8, "length": 400.0 / stretch}
        found = frequencies(LineElements(line(rope, LEFT, trolley, anchor("right", 400.0, 0.0), gravity=1e-9)))
        return np.array([found[np.argmin(np.abs(found - w))] for w in exact])

    np.testing.assert_allclose(pitching(400.0), exact, rtol=1e-6)
    assert np.abs(pitching(440.0) / exact - 1.0).max() > 1e-5


def test_a_cabin_swings_under_a_gripped_carriage_at_mid_span():
    """det [[M + m, m h], [m h, m h^2 + J]] w^2 = diag(K_x, m g h), K_x = 2 (EA/(l/2) cos^2 th + N/L sin^2 th)."""
    l, span, M, m, h, J = 300.0, 298.0, 500.0, 900.0, 2.0, 1200.0
    EA = 1e8
    hanger = Hanger(mass=m, length=h, gyration=np.sqrt(J / m))
    rope = {"mass_per_length": 1e-6, "EA": EA, "length": l}
    system = LineElements(
        line(rope, LEFT, with_body(car("car", M + m, l / 2.0), hanger), anchor("right", span, 0.0)), elements=2
    )
    x = system.observe([system.start(0, None)], np.array([1.0]))
    along, drop = x.cars[0].point[0]
    L, N = np.hypot(along, drop), x.cars[0].tension_ahead[0]
    K = 2.0 * (EA / (l / 2.0) * (along / L) ** 2 + N / L * (drop / L) ** 2)
    masses = np.array([[M + m, m * h], [m * h, m * h**2 + J]])
    exact = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(masses, np.diag([K, m * G * h])))))
    found = frequencies(system)
    np.testing.assert_allclose([found[np.argmin(np.abs(found - w))] for w in exact], exact, rtol=1e-6)


def test_a_cabin_that_rolls_freely_is_a_double_pendulum():
    """On an inextensible weightless rope the carriage moves on an ellipse of radius a^2/b."""
    carriage = with_body(free_car("car", 95.0, 150.0), Hanger(mass=90.0, length=1.2))
    rope = {"mass_per_length": 1e-4, "EA": 1e9, "length": 300.0}
    found = frequencies(LineElements(line(rope, LEFT, carriage, anchor("right", 298.0, 0.0)), elements=1, degree=4))
    for exact in (0.08679034, 12.468388):
        assert np.abs(found / exact - 1.0).min() < 1e-3


def test_a_cabin_under_constant_acceleration_swings_to_twice_its_angle():
    a = 2.0
    travel = Motion(((0.0, 20.0),), ((Piece(0.0, 0.0, 100.0, 0.0, 0.5 * a / 1.01),),), 1e3)
    cabin = with_body(car("car", 11.0, travel), Hanger(mass=10.0, length=2.0, gyration=0.5))
    rope = {"mass_per_length": 1.0, "EA": 1e8, "length": 1000.0 / 1.01}
    x = run_and_observe(LineElements(line(rope, LEFT, cabin, anchor("right", 1000.0, 0.0), t_end=6.0)), 200)
    swing = x.cars[0].turning.angle
    assert swing.min() == pytest.approx(-2.0 * np.arctan(a / G), rel=2e-3)
    assert swing.max() == pytest.approx(0.0, abs=5e-3)


def test_a_mirrored_trolley_rolls_alike():
    def of(start, sense, ahead, rise):
        thrust = ((0.0, sense * 900.0), (9.0, sense * 900.0))
        sled = Wheels(base=3.0, inertia=900.0, below=0.8, ahead=ahead)
        trolley = free_car("car", 900.0, start, k=0.5, thrust_table=thrust, thrust_angle=sense * 0.2)
        return LineElements(
            line(STEEL, LEFT, with_body(trolley, sled), anchor("right", 400.0, rise), t_end=4.0), elements=4
        )

    x = run_and_observe(of(150.0, 1.0, 0.2, -60.0), 80)
    y = run_and_observe(of(405.0 - x.cars[0].turning.wheels[0].s[0], -1.0, -0.2, 60.0), 80)
    one, other = x.cars[0].turning, y.cars[0].turning
    # one is held at its lower wheel before the start, the other at its upper one
    np.testing.assert_allclose(one.angle, -other.angle, atol=1e-5)
    for a, b in zip(one.wheels, reversed(other.wheels), strict=True):
        np.testing.assert_allclose(a.point, [400.0, -60.0] + b.point * [-1.0, 1.0], atol=3e-4)
        np.testing.assert_allclose(a.load[8:], b.load[8:], rtol=1e-3)


@pytest.mark.parametrize("base", [1.0, 2.0])
def test_two_wheels_hang_higher_by_the_known_coefficient(base):
    """m g b/(4 N) of a taut level rope; 1 % less of it is seen."""
    rope = {"mass_per_length": 1e-6, "EA": 1e12, "length": 400.0 / (1.0 + 3e5 / 1e12)}

    def of(x: Car) -> np.ndarray:
        system = LineElements(line(rope | {"EA": 1e9, "length": 399.88}, LEFT, x, anchor("right", 400.0, 0.0)))
        at = system.observe([system.start(0, None)], np.array([1.0]))
        return np.array([at.cars[0].point[0, 1], at.cars[0].tension_ahead[0]])

    point, N = of(car("car", 100.0, 199.94))
    two, _ = of(with_body(car("car", 100.0, 199.94 + 0.5 * base), Wheels(base=base, inertia=50.0)))
    share = (point - two) / (100.0 * G * base / (4.0 * N))
    assert share == pytest.approx(1.0, abs=5e-3)
    assert abs(share / 0.99 - 1.0) > 5e-3


def test_energy_is_what_drives_put_in():
    scene = line(
        STEEL, LEFT, with_body(car("a", 900.0, Smooth(60.0, 12.0, 4.0)), CABIN),
        with_body(car("w", 800.0, Smooth(150.0, 6.0, 3.0), "haul", mu_r=0.02, k=0.5, hitch=(0.1, -0.5)), SLED),
        with_body(car("b", 700.5, Smooth(290.0, -9.0, 3.0), "haul", k=0.4, mu_r=0.01), CABIN), RISE, t_end=8.0,
    )  # fmt: skip
    x = run_and_observe(LineElements(scene, elements=4), 200)

    def defect(powers) -> float:
        work = np.append(0.0, cumulative_simpson(sum(powers.values()), x=x.t))
        return float(np.abs(x.energy - x.energy[0] - work).max() / np.ptp(x.energy))

    assert defect(x.powers) < 5e-5
    for name in ("a swing", "w haul", "w drag", "b haul"):
        assert defect({k: power for k, power in x.powers.items() if k != name}) > 1e-3


def test_a_wheel_that_lifts_off_ends_the_run():
    thrust = {"thrust_table": ((0.0, 9e3), (9.0, 9e3)), "thrust_at": (-1.0, 3.0)}
    scene = line(STEEL, LEFT, with_body(free_car("sled", 500.0, 60.0, **thrust), SLED), RISE, t_end=9.0)
    system, work = LineElements(scene, elements=4), Work()
    list(integrate_blocks(system, scheme("radau"), step_times_by_phase(system, 300), work=work))
    assert [event.name for event in work.events] == ["sled front wheel lifts off"]


# --- the balance and its derivative ------------------------------------------------------------------------------
MIXED = MovingLine(
    rope=SOFT, t_end=4.0,
    contacts=(
        spring(0.0, 0.0), with_body(car("grip", 700.0, Smooth(60.0, 7.0)), SLED),
        with_body(car("gripping cabin", 900.0, Smooth(110.0, 7.0)), CABIN),
        with_body(free_car("free", 900.0, 200.0, mu_r=0.07, k=0.8, wind=-3.0, thrust_table=((0.0, 400.0), (9.0, 900.0)),
                       thrust_angle=0.1, thrust_at=(0.3, -0.2), brakes=((150.0, 40.0),), rear_brakes=((150.0, 10.0),)),
                  SLED),
        saddle("saddle", 290.0, -20.0), with_body(car("hung", 800.0, Smooth(350.0, 6.0), "haul", mu_r=0.03), CABIN),
        with_body(car("hauled", 1000.0, Smooth(420.0, 2.0), "haul", mu_r=0.03, k=0.6, hitch=(0.1, -0.5)), SLED),
        with_body(car("in x", 1200.0, Smooth(520.0, -4.0), "haul", "x", mu_r=0.02, wind=2.0), SLED),
        car("point", 500.0, Smooth(560.0, 2.0)), weight(600.0, -50.0, 7e4),
    ),
)  # fmt: skip


def system_and_random_state() -> tuple[LineElements, list[np.ndarray]]:
    system, rng = LineElements(MIXED, elements=2), np.random.default_rng(23)
    x = system.start(0, None)
    return system, [z + size * rng.standard_normal(z.size) for z, size in zip(x[1:4], (3e-3, 0.5, 0.5), strict=True)]


def test_tangent_is_the_derivative_of_the_balance_at_a_standstill():
    """In motion the tangent leaves out what the pitch rate adds to mass."""
    system, (q, _, _) = system_and_random_state()
    zero, rng = np.zeros(q.size), np.random.default_rng(5)
    for c in ((0.3, 0.5, 1.0), (1.0, 0.1, 1e-2), (1e-3, 0.02, 1.0)):
        y, step = rng.standard_normal(q.size), 1e-6
        moved = [system.residual(1.0, q + e * c[0] * y, e * c[1] * y, e * c[2] * y, 0) for e in (step, -step)]
        _, solve = system.linearise(1.0, q, zero, zero, 0, c)
        want = (moved[0] - moved[1]) / (2.0 * step)
        np.testing.assert_allclose(solve(want.copy()), y, atol=1e-4)
        assert np.abs(solve(1.01 * want) - y).max() > 1e-3


def test_many_steps_at_once_are_the_single_ones():
    last = []
    for many_steps in (True, False):
        system, _ = system_and_random_state()
        system.many_steps = many_steps
        last.append(last_of_equal_steps(system, system.start(0, None), 0.02, 8))
    for x, want in zip(last[0][1:4], last[1][1:4], strict=True):
        np.testing.assert_allclose(x, want, rtol=0.0, atol=1e-8 * np.abs(want).max())
