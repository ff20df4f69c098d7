"""Cabins that swing and cars on two wheels by sines: exact answers of the shared text on contacts, section 8."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson
from scipy.linalg import eigh
from scipy.optimize import brentq

from cablefem.elements.system import LineElements
from cablefem.newmark import State, Work, integrate, scheme, step_times_by_phase
from cablefem.scene.bodies import Hanger, Wheels
from cablefem.scene.contacts import Car
from cablefem.scene.drive import Drive
from cablefem.scene.motion import rest_motion
from galerkin.line_rest import coordinates_at_rest
from galerkin.lines import LineSines
from tests.motion.lines import LEFT, Smooth, anchor, line, run_and_observe
from tests.motion.test_sines import frequencies

WHEELS = Wheels(base=4.0, inertia=3e4, below=3.0, ahead=0.2)
HAUL = Drive(mode="haul", hitch=(0.0, -2.0))
TRAM = {"mass_per_length": 13.3, "EA": 2.52e8, "length": 778.1681731397}
WEIGHTLESS = {"mass_per_length": 1e-9, "EA": 1e8}


def tram_line(travel, **rope):
    cabin = Car(name="cabin", mass=8100.0, wheels=WHEELS, drive=HAUL, travel=travel)
    return line(TRAM | rope, LEFT, cabin, anchor("right", 700.0, -341.0), t_end=32.0)


def level_line(car, length, chord, **rope):
    return line(WEIGHTLESS | {"length": length} | rope, LEFT, car, anchor("right", chord, 0.0))


def observe_at_rest(system):
    """What a line at rest shows whose cars are not free."""
    rest, free, forces = coordinates_at_rest(system), system.equations.free, system.equations.forces
    q = np.where(forces, 0.0, rest[0, free])
    state = State(0.0, q, 0.0 * q, np.where(forces, rest[2, free], 0.0), 0)
    return system.observe([state], np.array([1.0]))


@pytest.mark.parametrize(
    ("s", "rope", "centre", "pitch", "rear", "haul", "tension", "loads"),
    [
        (100.0, {}, (95.05843704, -26.30059972), -0.3392363487, 96.01081712, 28267.450091,
         (679549.957, 683245.078, 683418.277, 723917.701), (20957.54104, 54020.46035)),
        (402.0, {}, (373.42505300, -147.76544418), -0.4332173470, 398.01305696, 35104.913919,
         (805725.423, 825176.643, 825395.015, 850071.027), (16213.34328, 55940.53766)),
        (402.0, {"mass_per_length": 1e-9, "length": 785.0}, (381.33062183, -123.56035185), -0.3908457193,
         398.00431060, 35084.84303, 4 * (271861.01258,), (19139.73099, 54617.00243)),
    ],
)  # fmt: skip
def test_a_trolley_at_rest(s, rope, centre, pitch, rear, haul, tension, loads):
    x = observe_at_rest(LineSines(tram_line(rest_motion(s, 1e3), **rope), 20))
    car = x.cars[0]
    body = car.turning
    np.testing.assert_allclose(body.centre[0], centre, atol=2e-8)
    np.testing.assert_allclose(body.angle, pitch, atol=1e-9)
    np.testing.assert_allclose(body.wheels[0].s, rear, atol=2e-8)
    np.testing.assert_allclose(car.haul_force, haul, rtol=1e-8)
    np.testing.assert_allclose([wheel.load[0] for wheel in body.wheels], loads, rtol=1e-8)
    shown = (x.contacts[0].tension_ahead, car.tension_behind, car.tension_ahead, x.contacts[1].tension_behind)
    np.testing.assert_allclose(np.concatenate(shown), tension, rtol=2e-9)


def test_a_trolley_in_motion():
    x = run_and_observe(LineSines(tram_line(Smooth(100.0, 10.0)), 6), 320)
    car = x.cars[0]
    body = car.turning
    loads = [wheel.load for wheel in body.wheels]
    shown = np.array([*body.centre.T, body.angle, x.contacts[0].tension_ahead, x.contacts[1].tension_behind,
                      *loads, car.haul_force])  # fmt: skip
    exact = {
        4: (100.94664, -28.38904, -0.329607, 689114, 733484, 12340, 63668, 47807),
        8: (132.69611, -40.52901, -0.357207, 721478, 765833, 20222, 54392, 29406),
        16: (207.16675, -71.04844, -0.384769, 775224, 819576, 18736, 55240, 31629),
        32: (353.55195, -138.01579, -0.427853, 807908, 852256, 16602, 55967, 34701),
    }
    allowed = {4: (24, 22, 8), 8: (37, 12, 48), 16: (3, 42, 50), 32: (3, 20, 16)}
    for t, want in exact.items():
        tension, load, haul = allowed[t]
        gap = np.abs(shown[:, np.argmin(np.abs(x.t - t))] - want)
        assert np.all(gap <= [1e-4, 1e-4, 2e-5, tension, tension, load, load, haul]), t


def test_a_trolley_pitches_on_a_straight_rope():
    l, N, EA, b = 400.0, 3e5, 1e8, 2.0

    def defect(w, rho, J=400.0):
        k = w * np.sqrt(rho * (1.0 + N / EA) / N) / (1.0 + N / EA)
        x = 0.5 * k * b
        return N * b * x * (1.0 / np.tan(x) + 1.0 / np.tan(0.5 * k * (l - b))) - J * w**2

    for rho, pitch in ((8.0, (3.0462985308, 6.0920141939, 9.1364901995)), (0.008, (38.7691492271,))):
        rope = {"mass_per_length": rho, "EA": EA, "length": l / (1.0 + N / EA)}
        front = (0.5 * (l + b)) / (1.0 + N / EA)
        car = Car(name="sled", mass=500.0, wheels=Wheels(base=b, inertia=400.0), travel=rest_motion(front, 1e3))
        shown = frequencies(line(rope, LEFT, car, anchor("right", l, 0.0), gravity=1e-7), 12)
        for w in pitch:
            assert np.abs(shown / w - 1.0).min() < 1e-7


def test_a_cabin_under_constant_acceleration_swings_twice_as_far_as_it_hangs_back():
    a = 1.5

    @dataclasses.dataclass(frozen=True)
    class Uniform(Smooth):
        phases = ((0.0, 1e3),)

        def position_with_rates(self, t, phase):
            return self.begin + 0.5 * a * t**2, a * t, a

    cabin = Hanger(mass=600.0, length=3.0, gyration=1.0)
    car = Car(name="cabin", mass=700.0, hanger=cabin, drive=HAUL, travel=Uniform(100.0, 0.0))
    rope = {"mass_per_length": 1e-3, "EA": 1e10, "length": 399.6}
    x = run_and_observe(LineSines(line(rope, LEFT, car, anchor("right", 400.0, 0.0), t_end=12.0), 2), 150)
    swing = x.cars[0].turning.angle
    assert swing.max() < 1e-4
    assert swing.min() == pytest.approx(-2.0 * np.arctan(a / 9.81), abs=2e-4)


def test_a_cabin_swings_with_the_carriage_that_grips_the_middle_of_a_rope():
    l, M, m, h, g, EA = 300.0, 300.0, 700.0, 4.0, 9.81, 1e8
    cabin = Hanger(mass=m, length=h, gyration=1.5)
    car = Car(name="cabin", mass=M + m, hanger=cabin, travel=rest_motion(0.5 * l, 1e3))
    chord = 299.5

    def pull(th):
        N = EA * (chord / (l * np.cos(th)) - 1.0)
        return 2.0 * N * np.sin(th) - (M + m) * g

    th = brentq(pull, 0.05, 0.3)
    N = EA * (chord / (l * np.cos(th)) - 1.0)
    Kx = 2.0 * (EA / (0.5 * l) * np.cos(th) ** 2 + N / (0.5 * chord / np.cos(th)) * np.sin(th) ** 2)
    mass = [[M + m, m * h], [m * h, m * h**2 + m * 1.5**2]]
    exact = np.sqrt(eigh(np.diag([Kx, m * g * h]), mass, eigvals_only=True))
    shown = frequencies(level_line(car, l, chord), 2)
    for w in exact:
        assert np.abs(shown / w - 1.0).min() < 1e-6


def test_a_cabin_that_rolls_freely_is_a_double_pendulum():
    car = Car(name="rider", mass=95.0, hanger=Hanger(mass=90.0, length=1.2), drive=Drive(mode="free", start=150.0))
    shown = frequencies(level_line(car, 300.0, 298.0, EA=1e11), 2)
    for w in (0.08679034, 12.468388):
        assert np.abs(shown / w - 1.0).min() < 2e-5


def test_a_mirrored_trolley_moves_alike():
    rope = {"mass_per_length": 6.0, "EA": 1e8, "length": 402.0}

    def moved(drop, start, thrust, angle, side):
        drive = Drive(mode="free", start=start, mu_r=0.01, k=0.5, thrust_table=((0.0, thrust), (3.0, thrust)),
                      thrust_angle=angle, thrust_at=(-0.4 * side, -0.2))  # fmt: skip
        wheels = Wheels(base=2.0, inertia=400.0, below=0.5, ahead=0.3 * side)
        car = Car(name="sled", mass=500.0, wheels=wheels, drive=drive)
        return run_and_observe(LineSines(line(rope, LEFT, car, anchor("right", 400.0, drop), t_end=6.0), 5), 60)

    x = moved(-20.0, 60.0, 6e3, 0.1, 1.0)
    one = x.cars[0].turning
    y = moved(20.0, 402.0 - one.wheels[0].s[0], -6e3, -0.1, -1.0)
    other = y.cars[0].turning
    assert one.centre[-1, 0] > 100.0
    np.testing.assert_allclose(one.centre, [400.0, -20.0] + other.centre * [-1.0, 1.0], atol=2e-4)
    np.testing.assert_allclose(one.angle, -other.angle, atol=1e-5)
    for a, b in zip(one.wheels, other.wheels[::-1], strict=True):
        np.testing.assert_allclose(a.load[1:], b.load[1:], atol=5.0)


def test_a_short_base_leaves_a_point_with_its_known_error():
    """The middle of two wheels runs m g b/(4 N) above the path of a point."""
    N, m, b, g = 3e5, 30.0, 2.0, 9.81
    length = 400.0 / (1.0 + N / 1e8)

    def depth(**body):
        front = 0.5 * (length + body["wheels"].base * length / 400.0) if body else 0.5 * length
        car = Car(name="sled", mass=m, travel=rest_motion(front, 1e3), drive=Drive(mode="haul"), **body)
        of = observe_at_rest(LineSines(level_line(car, length, 400.0), 4)).cars[0]
        return of.turning.centre[0, 1] if body else of.point[0, 1]

    gap = depth() - depth(wheels=Wheels(base=b, inertia=400.0))
    assert gap == pytest.approx(m * g * b / (4.0 * N), rel=5e-3)
    assert gap != pytest.approx(m * g * 0.99 * b / (4.0 * N), rel=5e-3)


def free_sled_line(thrust, angle, brake=1.5e3):
    drive = Drive(mode="free", start=60.0, mu_r=0.01, k=0.5, thrust_table=((0.0, thrust), (4.0, thrust)),
                  thrust_angle=angle, brakes=((50.0, brake),), rear_brakes=((50.0, brake / 3.0),))  # fmt: skip
    wheels = Wheels(base=2.0, inertia=400.0, below=0.5, ahead=0.3)
    car = Car(name="sled", mass=500.0, wheels=wheels, drive=drive)
    rope = {"mass_per_length": 6.0, "EA": 1e8, "length": 402.0}
    return line(rope, LEFT, car, anchor("right", 400.0, -20.0), t_end=4.0)


def hauled_cabin_line():
    car = Car(name="cabin", mass=900.0, hanger=Hanger(mass=700.0, length=4.0, gyration=1.0, damping=0.05),
              drive=Drive(mode="haul", mu_r=0.01, k=2.0), travel=Smooth(60.0, 8.0, 3.0))  # fmt: skip
    rope = {"mass_per_length": 6.0, "EA": 1e8, "length": 402.0}
    return line(rope, LEFT, car, anchor("right", 400.0, -20.0), t_end=8.0)


@pytest.mark.parametrize("scene", [free_sled_line(6e3, 0.1), hauled_cabin_line()])
def test_energy_is_what_drives_put_in_and_friction_takes(scene):
    x = run_and_observe(LineSines(scene, 5), 160)
    work = np.append(0.0, cumulative_simpson(sum(x.powers.values()), x=x.t))
    np.testing.assert_allclose(x.energy - x.energy[0], work, atol=1e-4 * np.ptp(x.energy))


@pytest.mark.parametrize("scene", [free_sled_line(3e3, 0.1, 0.0), hauled_cabin_line(), tram_line(Smooth(100.0, 10.0))])
def test_both_wings_agree(scene):
    scene = dataclasses.replace(scene, t_end=3.0)
    s = np.array([20.0, 200.0])
    one, other = run_and_observe(LineElements(scene), 60, s), run_and_observe(LineSines(scene, 12), 60, s)
    a, b = one.cars[0], other.cars[0]
    T, weight = a.tension_ahead.max(), 9.81 * scene.cars_on_rope[0].mass
    np.testing.assert_allclose(one.points, other.points, atol=1e-3)
    np.testing.assert_allclose(a.turning.centre, b.turning.centre, atol=1e-3)
    np.testing.assert_allclose(a.turning.angle, b.turning.angle, atol=1e-3)
    np.testing.assert_allclose(
        one.energy - other.energy, one.energy[0] - other.energy[0], atol=1e-4 * np.ptp(one.energy)
    )
    assert one.powers.keys() == other.powers.keys()
    for x, y in [(a, b), *zip(a.turning.wheels, b.turning.wheels, strict=True)]:
        np.testing.assert_allclose(x.tension_behind, y.tension_behind, atol=1e-3 * T)
        np.testing.assert_allclose(x.tension_ahead, y.tension_ahead, atol=1e-3 * T)
    for x, y in zip(a.turning.wheels, b.turning.wheels, strict=True):
        np.testing.assert_allclose(x.load, y.load, atol=2e-2 * weight)


def test_a_wheel_that_lifts_off_ends_the_run():
    system, work = LineSines(free_sled_line(9e3, 0.6), 5), Work()
    states = list(integrate(system, scheme("radau"), step_times_by_phase(system, 120), work=work))
    assert [event.name for event in work.events][-1] == "sled front wheel lifts off"
    x = system.observe(states, np.array([1.0]))
    load = x.cars[0].turning.wheels[1].load
    assert load[-1] == pytest.approx(0.0, abs=1.0)
    assert load[:-1].min() > 0.0
