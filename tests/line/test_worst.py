"""A line at rest without positions: its extremes are those of all places of its car."""

import pytest
from scipy.optimize import minimize_scalar

import cablefem as cf
from cablefem.scene import SceneError

GROUND = [[0.0, 30.0], [220.0, 61.0], [600.0, 80.0]]
TOML = """
[cable]
mass_per_length = 9.0
EA = 1.4e8
breaking_load = 1.1e6
tension = {at = "left", value = 3.1e5}
[[contact]]
name = "left"
kind = "anchor"
at = [0.0, 0.0]
[[contact]]
name = "right"
kind = "anchor"
at = [600.0, 45.0]
[[car]]
name = "car"
mass = 3700.0
hauled = true
below = 4.0
[[obstacle]]
name = "hut"
at = 301.7
top = 62.0
"""
LINE = cf.Line.from_toml(f"ground = {GROUND}\n{TOML}")


def design_values(line):
    return {row["quantity"]: row["value"] for row in cf.run(line).design}


@pytest.fixture(scope="module")
def design_values_of_line():
    return design_values(LINE)


@pytest.mark.parametrize(
    ("quantity", "sign"),
    [("tension_max", -1.0), ("clearance_car_min:car over the ground", 1.0), ("clearance_rope_min:hut", 1.0)],
)
def test_extremes_are_those_of_a_search_over_all_places(design_values_of_line, quantity, sign):
    def value(x):
        return sign * design_values(LINE.replace({"car.car.at": float(x)}))[quantity]

    best = minimize_scalar(value, bounds=(120.0, 480.0), method="bounded", options={"xatol": 1e-3})
    assert design_values_of_line[quantity] == pytest.approx(sign * best.fun, rel=1e-6)


def test_the_car_stands_exactly_over_an_obstacle(design_values_of_line):
    over = design_values(LINE.replace({"car.car.at": 301.7}))
    assert design_values_of_line["clearance_car_min:car over hut"] == pytest.approx(
        over["clearance_car_min:car over hut"], rel=1e-9
    )


@pytest.mark.parametrize("top", ["hut", "the ground"])
def test_a_car_that_passes_a_top_between_two_positions_is_as_low_as_over_it(top):
    """Its path sags between them: the clearance is that of the car over the top, not of a straight line."""
    ridge = [[0.0, 80.0], [290.0, 80.0], [301.7, 62.0], [310.0, 80.0], [600.0, 80.0]]
    line = LINE.replace({"ground": ridge, "car.car.at": [100.0, 520.0]})
    name = f"clearance_car_min:car over {top}"
    over = design_values(line.replace({"car.car.at": 301.7}))
    assert design_values(line)[name] == pytest.approx(over[name], rel=1e-12)


def test_other_cars_go_on_in_proportion_while_one_passes_an_obstacle():
    line = cf.Line.load("two-span").replace({"obstacle": [{"name": "hut", "at": 300.0, "top": -60.0}]})
    line = line.replace({"car.up.at": [100.0, 500.0], "car.down.at": [800.0, 1000.0]})
    answer = cf.run(line)
    assert answer.line.car[0].at == (100.0, 300.0, 500.0)
    assert answer.line.car[1].at == pytest.approx((800.0, 900.0, 1000.0))
    assert answer.line == cf.run(answer.line).line


@pytest.mark.slow
def test_a_check_of_all_places_agrees():
    assert cf.check(LINE).verdict.value == "agree"


def test_a_car_anywhere_needs_shoes_and_is_alone():
    skyline = cf.Line.load("skyline")
    anywhere = skyline.replace({"car.carriage.at": None})
    assert not anywhere.moves
    with pytest.raises(SceneError, match=r"contact.pole-1.shoe: missing"):
        anywhere.replace({"contact.pole-1.shoe": None})
    with pytest.raises(SceneError, match=r"car.up.at: missing; must be given for each of several cars"):
        cf.Line.load("two-span").replace({"car.up.at": None})


def test_a_rope_that_ends_on_the_ground_does_not_hit_it(cablefem, tmp_path):
    """Its clearance there is zero and rounding, in both computations."""
    line = cf.Line.from_toml(TOML).replace({"ground": [[0.0, 0.0], [300.0, 200.0], [600.0, 45.0]], "obstacle": []})
    (tmp_path / "ends.toml").write_text(line.replace({"car.car.at": [200.0, 400.0]}).to_toml())
    code, out, err = cablefem("check", "ends.toml")
    assert (code, err) == (0, "")
    assert "collide" not in out
