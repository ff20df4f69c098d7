"""A line at rest by exact catenaries and by elements: numbers known beforehand, and the equations themselves."""

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from cablefem import catenary_line
from cablefem.elements import line as elements
from cablefem.scene import Cable, Scene, SceneError, Supports
from cablefem.scene.line import Line, LineState, NoLineAtRest
from cablefem.scene.statics import gripped_rest
from tests.line.lines import (
    ASTER,
    EIGHT_SPANS,
    FOUR_CARS,
    NEAR_THE_END,
    SPRUNG,
    STEEP_AND_LIGHT,
    THREE,
    TRAMWAY,
    WEIGHED,
    car,
    contact,
    line,
    line_with_tables,
)
from validation.commands.check.line import check_line
from validation.commands.oracles.study import Task
from validation.commands.run.line import answer_line
from validation.oracles import line as oracle

WITNESSES = {"catenaries": catenary_line.solve, "elements": elements.solve}


@pytest.fixture(params=WITNESSES)
def solver(request):
    return WITNESSES[request.param]


def single_state(given, solve) -> LineState:
    (state,) = line(*given).solve_at_rest(solve).positions
    assert isinstance(state, LineState), state
    return state


@pytest.mark.parametrize("case", list(oracle.cases()), ids=lambda case: case.name)
@pytest.mark.parametrize("name", oracle.METHODS)
def test_numbers_known_beforehand(case, name):
    row = Task("line", case, name).compute_row()
    assert row["verdict"] == case.expected, row


def test_spring_instead_of_the_anchor(solver):
    state = single_state(SPRUNG, solver)
    assert state.s[1] == pytest.approx(250.0, abs=1e-4)
    assert state.s[2] == pytest.approx(618.051928, abs=1e-6)
    np.testing.assert_allclose(state.points[0], [0.235857, -0.012434], rtol=0, atol=1e-6)


def test_seilaplan(solver):
    rest = Line.load("skyline").solve_at_rest(solver)
    assert rest.empty.s[-1] == pytest.approx(330.908794, abs=1e-6)
    sag = [3.36, 4.46, 6.24, 5.21, 3.82, 2.61]
    for i, state in enumerate(rest.positions):
        k = next(k for k, p in enumerate(state.case.stations) if p.is_car)
        (x, y), ends = state.points[k], state.points[[k - 1, k + 1]]
        assert y - np.interp(x, *ends.T) == pytest.approx(sag[i], abs=0.0051)
    assert rest.positions[2].station_tensions[0, 1] == pytest.approx(133154.0, abs=0.5)


def test_deepest_point_of_a_field():
    state = single_state(ASTER, catenary_line.solve)
    assert catenary_line.sag_between_stations(state, 0, 1) == pytest.approx(13.9370, abs=5e-5)
    loaded = single_state(TRAMWAY, catenary_line.solve)
    below = loaded.points[1, 1] + 480.0 / 1200.0 * loaded.points[1, 0]
    assert catenary_line.sag_between_stations(loaded, 0, 2) == pytest.approx(below)


HOT = "temperature = 35.0\nreference_temperature = 10.0\nexpansion = 1.2e-5\nice = 1.3"


def test_heat_lengthens_and_ice_weighs():
    rest = line_with_tables(THREE, HOT).solve_at_rest(catenary_line.solve)
    case = rest.positions[0].case
    assert case.thermal_stretch == pytest.approx(1.0 + 25.0 * 1.2e-5)
    assert case.weight == pytest.approx((9.0 + 1.3) * 9.81)
    assert rest.empty.case.thermal_stretch == 1.0


def test_elements_converge_with_order_eight_at_their_ends():
    cases = [line(*ASTER).case_at_position(0, 220.0)]
    (exact,) = catenary_line.solve(cases)
    coarse, finer = (np.abs(elements.solve(cases, n)[0].s - exact.s).max() for n in (2, 4))
    assert coarse < 1e-6
    assert finer < coarse / 2**6


def test_a_rope_that_leaves_over_the_pulley_takes_the_energy_of_its_weight_along():
    """Forgotten, the elements' tension at a counterweight 150 m up is G + q y instead of G, 2.7 percent off."""
    case = line(*WEIGHED).case_at_position(0, None)
    forgotten = replace(case.stations[-1], force=5e5 + case.weight * case.stations[-1].y)
    state, right = elements.solve([replace(case, stations=(*case.stations[:-1], forgotten)), case])
    assert right.station_tensions[-1, 0] == pytest.approx(5e5, rel=1e-11)
    assert np.abs(state.station_tensions - right.station_tensions)[-1, 0] / 5e5 > 0.02


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ((dict(THREE[0], length=510.0), *THREE[1:5]), "too short to reach"),
        ((THREE[0], THREE[1], dict(THREE[2], at=[400.0, 60.0]), *THREE[3:5]), "the rope lifts off first"),
    ],
)
def test_empty_line_without_rest(solver, given, says):
    with pytest.raises(SceneError, match=says):
        line(*given).solve_at_rest(solver)


def level_line_under_counterweight(force):
    cable, weight, end = TRAMWAY[:3]
    return line(cable, {**weight, "tension": force}, {**end, "at": [1200.0, 0.0]})


@pytest.fixture(scope="module")
def smallest_force():
    """Level and empty it is w b/2 min(cosh z/z) (Irvine, Cable Structures, 1981, 1.2)."""
    z = np.linspace(1.0, 1.4, 1001)
    return float(0.5 * TRAMWAY[0]["mass_per_length"] * 9.81 * 1200.0 * np.min(np.cosh(z) / z))


def test_a_counterweight_too_light_is_named_with_the_force_that_would_do(smallest_force):
    for force, says in ((5e4, "a tension of 50000 N at weight does not carry it"), (9e4, "weight must hold it")):
        with pytest.raises(SceneError, match=says) as error:
            level_line_under_counterweight(force).solve_at_rest(catenary_line.solve)
    named = float(re.search(r"weight must hold it with at least (\d+) N", str(error.value)).group(1))
    assert smallest_force * (1.0 - 1e-3) < named < 1.02 * smallest_force  # the stretch of the rope lowers it a little
    assert level_line_under_counterweight(named).solve_at_rest(catenary_line.solve).states


def test_a_counterweight_has_the_same_smallest_force_by_elements(smallest_force):
    lines = [level_line_under_counterweight(share * smallest_force) for share in (0.97, 1.02)]
    too_light, enough = elements.solve([given.empty_line_case(None) for given in lines])
    assert isinstance(too_light, NoLineAtRest)
    assert isinstance(enough, LineState)


def test_a_trial_in_which_the_rope_hangs_plumb_is_refused_without_a_warning():
    """Warnings are errors here. A car of 44 t on a rope that a counterweight of 200 kN holds has no rest."""
    heavy = line(
        {"mass_per_length": 6.0, "EA": 1.1e8},
        contact("low", "anchor", 0.0, 0.0),
        contact("tower", "saddle", 400.0, -60.0, shoe=4.0),
        contact("top", "counterweight", 800.0, -140.0, tension=2e5),
        car("carrier", 43775.0, {"from": 20.0, "to": 780.0, "count": 77}),
    )
    states = heavy.solve_at_rest(catenary_line.solve)
    assert set(states.refused) == set(range(77))


def test_the_force_that_would_do_is_enough_for_all_positions():
    positions = {"car.up.at": np.linspace(50.0, 710.0, 23), "car.down.at": np.linspace(488.0, 1148.0, 23)}
    few = {key: at.tolist() for key, at in positions.items()}
    given = Line.load("two-span").replace({"contact.0.tension": 8.6e4, **few})
    sentence = answer_line(given).outcome.sentence
    named = float(re.search(r"valley must hold it with at least (\d+) N", sentence).group(1))
    assert answer_line(given.replace({"contact.0.tension": named})).status == "complete"
    assert answer_line(given.replace({"contact.0.tension": 0.97 * named})).status == "incomplete"


def test_a_position_without_rest_leaves_the_others(solver):
    rope, left, first, second, right, *_ = THREE
    heavy = car("car", 12000.0, [200.0, 402.0, 600.0, 920.0])
    found = line({**rope, "length": 1023.0}, left, {**first, "at": [400.0, 6.0]}, second, right, heavy).solve_at_rest(
        solver
    )
    assert [isinstance(x, NoLineAtRest) for x in found.positions] == [False, False, False, True]
    assert "the rope lifts off first" in str(found.positions[3])


def test_a_car_too_heavy_for_its_rope_is_not_called_a_short_rope(solver):
    rope, left, *_ = THREE
    found = line(
        {**rope, "length": 402.0}, left, contact("end", "anchor", 400.0, -30.0), car("car", 1e9, [200.0])
    ).solve_at_rest(solver)
    assert "no tension below EA" in str(found.positions[0])


def test_an_empty_line_without_rest_names_the_tension_that_does_not_do():
    """Level and empty, a rope needs 0.754 times span and weight per length at its ends."""
    ends = contact("left", "anchor", 0.0, 0.0), contact("right", "anchor", 600.0, 0.0)
    for share, does in ((0.8, True), (0.75, False)):
        tension = {"at": "left", "value": share * 600.0 * 9.0 * 9.81}
        given = line({"mass_per_length": 9.0, "EA": 1.4e9, "tension": tension}, *ends)
        if does:
            assert given.solve_at_rest(catenary_line.solve).states
            continue
        with pytest.raises(SceneError, match=r"with cable.tension.value = 39730.5 N at left"):
            given.solve_at_rest(catenary_line.solve)


def test_a_case_without_rest_leaves_the_others(solver):
    good = line(*TRAMWAY).case_at_position(0, 1300.0)
    light = replace(good.stations[0], force=2e4)
    found = solver([good, replace(good, stations=(light, *good.stations[1:])), good])
    assert [isinstance(x, NoLineAtRest) for x in found] == [False, True, False]


@pytest.mark.parametrize("given", [STEEP_AND_LIGHT, EIGHT_SPANS, FOUR_CARS], ids=["steep", "eight spans", "four cars"])
def test_fine_elements_come_to_the_catenary_from_afar(given):
    """They were lost where a rope goes slack on the way to rest, and stopped a step too early on long lines."""
    sound = line(*given).solve_at_rest(catenary_line.solve)
    fine = line(*given).solve_at_rest(partial(elements.solve, elements=32))
    np.testing.assert_allclose(fine.states[0].points, sound.states[0].points, rtol=0, atol=1e-9)


@pytest.mark.parametrize("given", [STEEP_AND_LIGHT, EIGHT_SPANS, FOUR_CARS], ids=["steep", "eight spans", "four cars"])
def test_sound_lines_agree(given):
    assert check_line(line(*given, obstacle=[{"name": "tree", "at": 500.0, "top": 900.0}])).verdict.value == "agree"


def test_a_car_close_to_the_end_of_a_long_line_is_within_the_rounding_of_coordinates():
    assert check_line(line(*NEAR_THE_END)).verdict.value == "agree"


def test_a_car_on_a_shoe_is_not_felt(solver):
    rope, left, first, second, right, *_ = THREE
    on = line(rope, left, first, second, right, car("car", 4000.0, [397.0, 300.0])).solve_at_rest(solver)
    off = line(rope, left, first, second, right).solve_at_rest(solver)
    np.testing.assert_allclose(on.positions[0].points, off.positions[0].points, rtol=0, atol=1e-9)
    both = line(rope, left, first, second, right, car("a", 40.0, 397.0), car("b", 40.0, 402.0)).solve_at_rest(solver)
    assert "two cars on the shoe of first" in str(both.positions[0])


def test_the_path_of_a_car_does_not_jump_at_the_ends_of_a_shoe(solver):
    at = [693.9999, 694.0001, 700, 705.9999, 706.0001]
    given = Line.load("two-span").replace({"car.down.at": 1100.0, "car.up.at": at})
    result = answer_line(given, rest=given.solve_at_rest(solver))
    depths = [row["depth:up"] for row in result.numbers]
    assert [row["on:up"] for row in result.numbers] == [None, "tower", "tower", "tower", None]
    np.testing.assert_allclose(np.diff(depths)[[0, 3]], 0.0, rtol=0, atol=3e-4)
    assert depths[2] == pytest.approx(-290.0, abs=1e-9)


def test_a_tower_carries_the_car_on_its_shoe():
    given = Line.load("two-span").replace({"car.up.at": [690.0, 700.0], "car.down.at": 1136.0})
    hanging, on_shoe = answer_line(given).numbers
    assert hanging["load:tower"] == hanging["pressure:tower"]
    assert on_shoe["load_down:tower"] == pytest.approx(on_shoe["pressure_down:tower"] + 6000.0 * 9.81)
    assert on_shoe["load:tower"] > 136e3 > hanging["load:tower"]


def test_numbers_beyond_all_bounds_are_no_rest():
    def spoilt(cases):
        return [replace(state, s=state.s * np.nan) for state in catenary_line.solve(cases)]

    with pytest.raises(SceneError, match="no state of rest was found"):
        line(*THREE).solve_at_rest(spoilt)


def two_span_with_heavy_car(*at):
    return Line.load("two-span").replace({"car.up.mass": 8e4, "car.up.at": [*at], "car.down.at": 1136.0})


def test_a_rope_that_cannot_carry_its_cars_says_why():
    near, far = two_span_with_heavy_car(50, 200).solve_at_rest(catenary_line.solve).positions
    assert "828945 N of cars on the rope; valley holds it with 380000 N" in str(near) + str(far)


def test_a_car_too_heavy_to_come_onto_a_shoe_is_named_with_its_contact():
    (position,) = two_span_with_heavy_car(700).solve_at_rest(catenary_line.solve).positions
    assert "up does not come onto the shoe of tower" in str(position)


def test_one_span_is_the_statics_of_a_scene_but_for_the_strain():
    """A scene counts weight and stiffness per stretched metre, a line per unstretched one: T/EA apart."""
    for EA in (1e8, 1e10):
        scene = Scene(
            cable=Cable(mass_per_length=9.0, EA=EA, horizontal_tension=4e5), supports=Supports(span=500.0, drop=60.0)
        )
        mu = 3000.0 / (scene.rho * scene.length)
        rest = gripped_rest(0.4, replace(scene.groups, mu=mu))
        (x, y), N = rest.car_point[0] * scene.length, float(rest.ahead[0]) * scene.horizontal_tension
        tension = {"at": "left", "value": float(scene.catenary.tension(0.0))}
        rope = {"mass_per_length": 9.0, "EA": EA, "tension": tension}
        ends = ({"name": "left", "kind": "anchor", "at": [0, 0]}, {"name": "right", "kind": "anchor", "at": [500, 60]})
        state = single_state((rope, *ends, car("car", 3000.0, float(x), hauled=False)), catenary_line.solve)
        apart = max(abs(state.points[1, 1] - y) / y, abs(state.station_tensions[1, 1] - N) / N)
        assert apart < 2.0 * N / EA


def test_a_position_known_to_have_no_rest_is_not_tried_again():
    """Also where the length follows from a counterweight, so that each solver computes it anew."""
    counts = []

    def counted(cases):
        counts.append(len(cases))
        return catenary_line.solve(cases)

    heavy = Line.load("two-span").replace({"car.up.mass": 60000.0, "car.up.at": [50, 300], "car.down.at": [488, 738]})
    first = heavy.solve_at_rest(counted)
    again = heavy.solve_at_rest(counted, first.refused)
    assert list(first.refused) == [1]
    assert counts == [1, 2, 1, 1]
    assert again.refused == first.refused
    assert set(again.states) == {0}


def test_a_tension_that_is_the_same_at_all_positions_is_largest_at_the_first():
    """T at the upper anchor is that of the counterweight plus the weight of the rope per height."""
    answer = answer_line(Line.load("two-span"))
    assert answer.tension_max["value"] == pytest.approx(3.8e5 + 11.4 * 9.81 * 480.0, rel=1e-3)
    assert answer.tension_max["position"] == 1
