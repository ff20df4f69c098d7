"""Lines at rest with held cars against elastic catenaries (shared text on lines, section 4)."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from cablefem.elements.system import LineElements
from cablefem.scene.bodies import Hanger, Wheels
from galerkin.lines import LineSines
from tests.motion.lines import ALONG_S, IN_X, LEFT, SPRUNG, THREE, WEIGHED, anchor, car, line, saddle

# s of the free contacts, points and haul forces of the cars: elastic catenaries to all digits
EXACT = {
    "three": (THREE, {2: 401.039137, 4: 821.100312}, [(180.494286, 0.737332), (618.612609, -9.579431)], -775.88172),
    "weight": (WEIGHED, {2: 618.284099}, [(247.812647, -38.424243)], None),
    "spring": (SPRUNG, {2: 618.051928}, None, None),
    "along s": (ALONG_S, {0: -6.802361}, [(640.052271, -148.607581)], 22261.47088),
    "in x": (IN_X, {0: -6.802361, 1: 650.0}, [(640.052271, -148.607581)], 22261.47088),
}


# wing -> its system, errors allowed to places [m] and to haul forces [N]
WINGS = {
    "elements": (lambda line: LineElements(line, elements=4), 1e-6, 1e-4),
    "sines": (lambda line: LineSines(line, 16), 2e-6, 1e-2),
}


@pytest.mark.parametrize("wing", WINGS)
@pytest.mark.parametrize("name", EXACT)
def test_contacts_slide_to_where_catenaries_put_them(name, wing):
    moving, s, points, haul = EXACT[name]
    build, of_places, of_forces = WINGS[wing]
    system = build(moving)
    x = system.observe([system.start(0, None)], np.array([100.0]))
    everything = {c.name: c for c in (*x.contacts, *x.cars)}
    for k, exact in s.items():
        assert everything[moving.contacts[k].name].s[0] == pytest.approx(exact, abs=of_places)
    for at, exact in zip(x.cars, points or [], strict=False):
        np.testing.assert_allclose(at.point[0], exact, atol=of_places)
    if haul is not None:
        assert x.cars[-1].haul_force[0] == pytest.approx(haul, abs=of_forces)


def test_tensions_at_rest():
    system = LineElements(WEIGHED, elements=4)
    x = system.observe([system.start(0, None)], np.array([0.0, 250.0]))
    assert x.contacts[0].tension_ahead[0] == pytest.approx(475797.4438, abs=1e-3)
    assert x.cars[0].tension_behind[0] == pytest.approx(479179.1553, abs=1e-3)
    assert x.cars[0].tension_ahead[0] == pytest.approx(490181.3837, abs=1e-3)
    assert x.contacts[1].tension_behind[0] == pytest.approx(5e5, abs=1e-3)
    np.testing.assert_allclose(x.tension[0], [475797.4438, 479179.1553], rtol=1e-6)


@pytest.mark.parametrize(
    "build",
    [
        lambda deep: LineElements(deep, elements=1, degree=4),
        lambda deep: LineSines(deep, 3),
    ],
)
def test_a_rope_that_sags_by_a_quarter_of_its_span_is_not_slack_on_the_coarsest_grid(build):
    length, span = 240.0, 200.0
    deep = line(
        {"mass_per_length": 5.0, "EA": 8e7, "length": length},
        anchor("left", 0.0, 0.0), car("light", 1.0, 120.0), anchor("right", span, 0.0),
    )  # fmt: skip
    system = build(deep)
    x = system.observe([system.start(0, None)], np.array([0.0]))
    a = brentq(lambda a: 2.0 * a * np.sinh(0.5 * span / a) - length, 20.0, 1e4)  # y = a cosh(x/a)
    weight_per_length = 5.0 * 9.81
    assert x.contacts[0].tension_ahead[0] == pytest.approx(weight_per_length * np.hypot(a, 0.5 * length), rel=0.02)


@pytest.mark.parametrize("wing", WINGS)
def test_a_grip_on_a_stretched_rope_holds_the_difference_of_its_tensions(wing):
    steep = line(
        {"mass_per_length": 0.35, "EA": 4e5, "length": 159.8},
        anchor("low", 0.0, 0.0), car("chair", 140.0, 90.0), anchor("high", 120.0, -110.0),
    )  # fmt: skip
    system = WINGS[wing][0](steep)
    chair = system.observe([system.start(0, None)], np.array([0.0])).cars[0]
    behind, ahead = chair.tension_behind[0], chair.tension_ahead[0]
    assert chair.grip_force[0] == pytest.approx(ahead - behind, rel=1e-6)
    tangents = [slope[0] / np.linalg.norm(slope[0]) for slope in (chair.slope_behind, chair.slope_ahead)]
    half_kink = 0.5 * np.arccos(tangents[0] @ tangents[1])
    assert chair.contact_force[0] == pytest.approx((behind + ahead) * np.sin(half_kink), rel=1e-6)


@pytest.mark.parametrize("wing", WINGS)
@pytest.mark.parametrize("mode", ["haul", "free"])
def test_a_cabin_in_wind_begins_at_the_angle_of_its_drag_over_its_weight(wing, mode):
    cabin = Hanger(mass=2500.0, length=5.5, gyration=1.3)
    place = {"travel": 300.0} if mode == "haul" else {"travel": None, "start": 300.0}
    held = replace(car("cabin", 3100.0, mode=mode, k=6.0, wind=20.0, **place), hanger=cabin)
    windy = line({"mass_per_length": 13.3, "EA": 2.52e8, "length": 778.168}, LEFT, held, anchor("top", 700.0, -341.0))
    system = WINGS[wing][0](windy)
    x = system.observe([system.start(0, None)], np.array([0.0])).cars[0]
    assert x.turning.angle[0] == pytest.approx(np.arctan(6.0 * 20.0**2 / (2500.0 * 9.81)), rel=1e-8)
    if mode == "haul":  # a free one is held by the rope
        np.testing.assert_allclose(x.point[0], (279.1715661521, -111.7131642027), atol=1e-5)  # elastic catenary
        assert x.turning.acceleration[0] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("wing", WINGS)
@pytest.mark.parametrize("size", [2, 3, 4])
def test_a_car_hangs_on_three_spans_and_does_not_stand_on_a_compressed_rope(wing, size):
    spans = line(
        {"mass_per_length": 7.5, "EA": 1.3e8, "length": 905.0},
        LEFT, saddle("first", 220.0, -80.0), car("car", 2500.0, 300.0, "haul", "x"), saddle("second", 640.0, -210.0),
        anchor("right", 860.0, -250.0),
    )  # fmt: skip
    system = LineElements(spans, elements=size) if wing == "elements" else LineSines(spans, 3 * size)
    x = system.observe([system.start(0, None)], np.array([0.0]))
    assert x.cars[0].tension_ahead[0] == pytest.approx(88600.6012, rel=1e-4)  # elastic catenaries
    assert x.contacts[-1].tension_behind[0] == pytest.approx(101508.3519, rel=1e-4)


@pytest.mark.parametrize("wing", WINGS)
def test_a_held_rider_on_two_wheels_has_no_friction_before_it_rolls(wing):
    wheels = Wheels(base=0.8, inertia=30.0, below=0.7)
    rider = replace(car("rider", 100.0, None, "free", start=15.0, mu_r=0.02, release=0.5), wheels=wheels)
    fibre = line({"mass_per_length": 0.25, "EA": 2.5e5, "length": 98.5}, LEFT, rider, anchor("right", 100.0, 12.0))
    system = WINGS[wing][0](fibre)
    rear, front = system.observe([system.start(0, None)], np.array([0.0])).cars[0].turning.wheels
    slopes = np.array([rear.slope_behind, rear.slope_ahead, front.slope_behind, front.slope_ahead])[:, 0]
    tensions = 2.5e5 * (np.linalg.norm(slopes, axis=1) - 1.0)
    assert tensions[0] == pytest.approx(tensions[1], abs=1.0)  # friction would be 12 N
    hold = float(system.hold[0] if wing == "elements" else system.holds[1])
    assert hold == pytest.approx(tensions[3] - tensions[2], abs=1.0)


def test_fine_elements_between_two_wheels_on_a_slope_are_not_folded():
    """The first guess moved the rear wheel beyond nodes, and a rope compressed between both wheels was called slack."""
    wheels = Wheels(base=1.5, inertia=6.0, below=0.3)
    sled = replace(car("sled", 20.0, None, "free", start=10.0), wheels=wheels)
    rope = {"mass_per_length": 3.0, "EA": 5e7, "length": 200.43}
    pitches = []
    for size in (12, 150):
        system = LineElements(line(rope, LEFT, sled, anchor("right", 200.0, 12.0)), elements=size)
        x = system.observe([system.start(0, None)], np.array([9.0])).cars[0].turning
        pitches.append(x.angle[0])
        for wheel in x.wheels:
            assert wheel.tension_behind[0] == pytest.approx(wheel.tension_ahead[0], rel=1e-3)
    assert pitches[0] == pytest.approx(pitches[1], abs=1e-8)
