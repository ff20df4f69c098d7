"""A line at rest by exact catenaries and by elements: numbers known beforehand, and the equations themselves."""

from dataclasses import replace

import numpy as np
import pytest

from cablefem import catenary_line
from cablefem.elements import line as elements
from cablefem.scene import SceneError
from cablefem.scene.line import Line, LineState, NoLine
from tests.line.lines import ASTER, SPRUNG, THREE, TRAMWAY, WEIGHED, car, changed, defects, line

WITNESSES = {"catenaries": catenary_line.solve, "elements": elements.solve}


@pytest.fixture(params=WITNESSES)
def solve(request):
    return WITNESSES[request.param]


def one(given, solve) -> LineState:
    (state,) = line(*given).rest(solve).positions
    assert isinstance(state, LineState), state
    return state


def test_three_spans_with_a_gripping_and_a_hauled_car(solve):
    state = one(THREE, solve)
    np.testing.assert_allclose(state.s[1:5], [180.0, 401.039137, 620.0, 821.100312], rtol=0, atol=1e-6)
    np.testing.assert_allclose(state.place[[1, 3], 1], [0.737332, -9.579431], rtol=0, atol=1e-6)
    behind = [395101.3921, 400376.5890, 398578.7868, 399496.2040, 395974.6087]
    ahead = [395166.3080, 397670.5028, 400376.5890, 398578.7868, 399496.2040]
    np.testing.assert_allclose(state.tensions[1:, 0], behind, rtol=0, atol=2e-4)
    np.testing.assert_allclose(state.tensions[:-1, 1], ahead, rtol=0, atol=2e-4)
    assert state.haul[3] == pytest.approx(-775.88172, abs=1e-4)
    assert np.isnan(np.delete(state.haul, 3)).all()


def test_counterweight_at_the_right_end(solve):
    state = one(WEIGHED, solve)
    np.testing.assert_allclose(state.s, [0.0, 250.0, 618.284099], rtol=0, atol=1e-6)
    assert state.place[1, 1] == pytest.approx(-38.424243, abs=1e-6)
    told = [state.tensions[0, 1], *state.tensions[1]]
    np.testing.assert_allclose(told, [475797.4438, 479179.1553, 490181.3837], rtol=0, atol=2e-4)


def test_spring_instead_of_the_anchor(solve):
    state = one(SPRUNG, solve)
    assert state.s[1] == pytest.approx(250.0, abs=1e-4)
    assert state.s[2] == pytest.approx(618.051928, abs=1e-6)
    np.testing.assert_allclose(state.place[0], [0.235857, -0.012434], rtol=0, atol=1e-6)


def test_one_span_tramway_with_a_counterweight_at_the_left_end(solve):
    rest = line(*TRAMWAY).rest(solve)
    (state,) = rest.positions
    assert rest.empty.s[-1] == pytest.approx(1300.0 - 4.014737, abs=1e-6)
    # counted from the left end of the empty line here, from 4.014737 m before it in the numbers
    np.testing.assert_allclose(state.s, np.array([-6.802361, 650.0, 1300.0]) - 4.014737, rtol=0, atol=1e-6)
    assert state.place[1, 1] == pytest.approx(-148.607581, abs=1e-6)
    assert state.haul[1] == pytest.approx(22261.47088, abs=1e-4)
    np.testing.assert_allclose(state.tensions[1], 396588.7073, rtol=0, atol=2e-4)
    for found in (state, rest.empty):
        assert found.tensions[-1, 0] == pytest.approx(433576.5376, abs=2e-4)


def test_seilaplan(solve):
    rest = Line.load("skyline").rest(solve)
    assert rest.empty.s[-1] == pytest.approx(330.908794, abs=1e-6)
    exact = [110438.79, 119370.18, 132122.47, 122143.86, 107195.94, 84077.84]
    sag = [3.36, 4.46, 6.24, 5.21, 3.82, 2.61]
    printed = 1e3 * np.array([109.9, 119.6, 131.1, 121.5, 106.0, 83.5])
    for i, state in enumerate(rest.positions):
        k = next(k for k, p in enumerate(state.case.stations) if p.is_car)
        N, (x, y) = state.tensions[k, 0], state.place[k]
        chord = np.interp(x, state.place[[k - 1, k + 1], 0], state.place[[k - 1, k + 1], 1])
        assert exact[i] == pytest.approx(N, abs=0.02)
        assert printed[i] == pytest.approx(N, rel=0.012)
        assert y - chord == pytest.approx(sag[i], abs=0.0051)
    assert rest.positions[2].tensions[0, 1] == pytest.approx(133154.0, abs=0.5)


def test_code_aster(solve):
    state = one(ASTER, solve)
    np.testing.assert_allclose(np.diff(state.s)[:2], 104.99845, rtol=0, atol=6e-6)
    np.testing.assert_allclose(state.tensions[1:3], 3175.6, rtol=0, atol=0.05)
    np.testing.assert_allclose(state.middle[:2, 1], 13.9370, rtol=0, atol=5e-5)
    np.testing.assert_allclose(state.middle[:2, 1], 13.930, rtol=6e-4)


def test_deepest_point_of_a_field():
    state = one(ASTER, catenary_line.solve)
    assert catenary_line.deepest(state, 0, 1) == pytest.approx(13.9370, abs=5e-5)
    loaded = one(TRAMWAY, catenary_line.solve)
    assert catenary_line.deepest(loaded, 0, 2) == pytest.approx(
        loaded.place[1, 1] + 480.0 / 1200.0 * loaded.place[1, 0]
    )


HOT = "temperature = 35.0\nreference_temperature = 10.0\nexpansion = 1.2e-5\nice = 1.3"
LAWS = {"three": (THREE, ""), "weighed": (WEIGHED, ""), "sprung": (SPRUNG, ""), "tramway": (TRAMWAY, "")}
LAWS |= {f"{name}, warm and iced": (given, HOT) for name, (given, _) in LAWS.items()}


@pytest.mark.parametrize("name", LAWS)
def test_laws_of_statics_hold(solve, name):
    (state,) = changed(*LAWS[name]).rest(solve).positions
    assert max(defects(state).values()) < 1e-9


def test_laws_see_what_is_wrong():
    state, weighed = one(THREE, catenary_line.solve), one(TRAMWAY, catenary_line.solve)
    unequal = replace(state, ahead=state.ahead * np.array([1.0, 1.0, 1.0 + 1e-6, 1.0, 1.0, 1.0])[:, None])
    assert defects(unequal)["saddle"] > 9e-7
    assert defects(replace(state, haul=-state.haul))["car"] > 1e-3
    assert defects(replace(state, s=state.s * (1.0 + 1e-6)))["rope"] > 1e-8
    stations = tuple(replace(p, force=p.force * 1.01) for p in weighed.case.stations)
    assert defects(replace(weighed, case=replace(weighed.case, stations=stations)))["counterweight"] > 1e-3


def test_heat_lengthens_and_ice_weighs():
    rest = changed(THREE, HOT).rest(catenary_line.solve)
    case = rest.positions[0].case
    assert case.heat == pytest.approx(1.0 + 25.0 * 1.2e-5)
    assert case.weight == pytest.approx((9.0 + 1.3) * 9.81)
    assert rest.empty.case.heat == 1.0


def test_elements_converge_with_order_eight_at_their_ends():
    (deep,) = elements.solve([line(*ASTER).case(0, 220.0)], 2)
    (exact,) = catenary_line.solve([line(*ASTER).case(0, 220.0)])
    (fine,) = elements.solve([line(*ASTER).case(0, 220.0)], 4)
    coarse, finer = (np.abs(x.s - exact.s).max() for x in (deep, fine))
    assert coarse < 1e-6
    assert finer < coarse / 2**6


def test_a_rope_that_leaves_over_the_pulley_takes_the_energy_of_its_weight_along():
    """Forgotten, the elements' tension at a counterweight 150 m up is G + q y instead of G, 2.7 percent off."""
    case = line(*WEIGHED).case(0, None)
    forgotten = replace(case.stations[-1], force=5e5 + case.weight * case.stations[-1].y)
    state, right = elements.solve([replace(case, stations=(*case.stations[:-1], forgotten)), case])
    assert defects(right)["counterweight"] < 1e-11
    assert np.abs(state.tensions - right.tensions)[-1, 0] / 5e5 > 0.02


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ((TRAMWAY[0], {**TRAMWAY[1], "tension": 2e4}, TRAMWAY[2]), "a tension of 20000 N at weight does not carry it"),
        ((dict(THREE[0], length=510.0), *THREE[1:5]), "too short to reach"),
        ((THREE[0], THREE[1], dict(THREE[2], at=[400.0, 60.0]), *THREE[3:5]), "the rope lifts off first"),
    ],
)
def test_empty_line_without_rest(solve, given, says):
    with pytest.raises(SceneError, match=says):
        line(*given).rest(solve)


def test_a_position_without_rest_leaves_the_others(solve):
    rope, left, first, second, right, *_ = THREE
    heavy = car("car", 12000.0, [200.0, 402.0, 600.0, 920.0])
    found = line({**rope, "length": 1023.0}, left, {**first, "at": [400.0, 6.0]}, second, right, heavy).rest(solve)
    assert [isinstance(x, NoLine) for x in found.positions] == [False, False, False, True]
    assert "the rope lifts off first" in str(found.positions[3])


def test_a_case_without_rest_leaves_the_others(solve):
    good = line(*TRAMWAY).case(0, 1300.0)
    light = replace(good.stations[0], force=2e4)
    found = solve([good, replace(good, stations=(light, *good.stations[1:])), good])
    assert [isinstance(x, NoLine) for x in found] == [False, True, False]


def test_a_car_on_a_shoe_is_not_felt(solve):
    rope, left, first, second, right, *_ = THREE
    on = line(rope, left, first, second, right, car("car", 4000.0, [397.0, 300.0])).rest(solve)
    off = line(rope, left, first, second, right).rest(solve)
    np.testing.assert_allclose(on.positions[0].place, off.positions[0].place, rtol=0, atol=1e-9)
    both = line(rope, left, first, second, right, car("a", 40.0, 397.0), car("b", 40.0, 402.0)).rest(solve)
    assert "two cars on the shoe of first" in str(both.positions[0])
