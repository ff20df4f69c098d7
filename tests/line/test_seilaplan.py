"""Twenty numbers that SEILAPLAN's own tests print of the skyline (test_calc_threshold.py), beside ours.

Its statics follow Zweifel (1960): parabolas, of which those of the path of the load have the sag of a load at mid-span.
"""

import numpy as np
import pytest

import cablefem as cf
from validation.commands.run.line import numbers_by_position

SKYLINE = cf.Line.load("skyline")
POLES = range(1, 6)
TOPS = np.array([contact.at for contact in SKYLINE.contact])  # (7, 2), down
WIDTHS = np.diff(TOPS[:, 0])
DROPS = np.diff(TOPS[:, 1])
CHORDS = np.hypot(WIDTHS, DROPS)
ROPE = 23.2  # N/m
BESIDE = 1.05  # m: just off a shoe
HAUL_ROPE = 7.3  # N/m, of which our line has none

EMPTY = [1.6, 2.2, 6.1, 9.0, 24.4]
LOADED = [20.0, 19.1, 21.3, 25.5, 43.4]
CLEARANCES = [8.0, 7.4, 9.1, 6.0, 9.0]
SADDLES = [38.2, 39.7, 44.6, 47.3, 61.6]


def numbers_at_positions(places):
    """Numbers with the load at each place."""
    return numbers_by_position(cf.run(SKYLINE.replace({"car.carriage.at": places})).rest)


@pytest.fixture(scope="module")
def numbers_at_mid_span():
    return numbers_at_positions((TOPS[:-1, 0] + WIDTHS / 2.0).tolist())


@pytest.fixture(scope="module")
def depths_of_empty_rope(numbers_at_mid_span):
    return [numbers_at_mid_span[0][f"knee_empty:pole-{i}"] for i in POLES]


def test_empty_knee_angles_are_alike(depths_of_empty_rope):
    assert depths_of_empty_rope == pytest.approx(EMPTY, abs=0.07)  # a parabola's tangents are those of a catenary here


def test_clearances_are_alike():
    """Its path of the load is that of the exact statics to 9 cm; the ground follows from what it prints."""
    drawn = [1249.04, 1235.15, 1217.35, 1188.68, 1176.07]  # of the path, less the 6.8 m demanded
    ground = np.array(drawn) + 6.8 - CLEARANCES
    heights = [1265.913 - row["depth:carriage"] for row in numbers_at_positions([27.0, 74.0, 131.0, 222.0, 258.0])]
    assert heights - ground == pytest.approx(CLEARANCES, abs=0.09)


def test_saddle_forces_count_half_the_rope_of_both_fields_twice():
    """The tension on the shoe already carries that rope; its haul rope, half of what lies above, is not in our line."""
    rows = numbers_at_positions(TOPS[1:-1, 0].tolist())
    ours = []
    for i in POLES:
        row = rows[i - 1]
        down = row[f"load_down:pole-{i}"]
        across = np.sqrt(row[f"load:pole-{i}"] ** 2 - down**2)
        down += 0.5 * ROPE * (CHORDS[i - 1] + CHORDS[i]) + 0.5 * HAUL_ROPE * CHORDS[:i].sum()
        ours.append(np.hypot(across, down) / 1e3)
    assert ours == pytest.approx(SADDLES, abs=0.08)
    smaller = [row[f"load:pole-{i}"] / 1e3 for i, row in zip(POLES, rows, strict=True)]
    assert np.subtract(SADDLES, smaller) == pytest.approx([1.4, 2.1, 2.6, 2.3, 1.9], abs=0.06)


def test_loaded_knee_angles_are_those_of_a_parabola_through_the_load_at_mid_span(
    numbers_at_mid_span, depths_of_empty_rope
):
    """It is steeper at a support than a rope with the load at mid-span, less steep than one with the load beside it."""
    middles = (TOPS[:-1, 1] + TOPS[1:, 1]) / 2.0
    tensions = np.array([109.9, 119.6, 131.1, 121.5, 106.0, 83.5]) * 1e3
    loaded = np.array([row["depth:carriage"] for row in numbers_at_mid_span]) - middles  # sags (6,)
    loaded += CHORDS**2 * HAUL_ROPE / 2.0 / (8.0 * tensions)
    unloaded = CHORDS**2 * ROPE / (8.0 * (70e3 - ROPE * middles))
    more = [
        np.degrees(
            np.arctan((side * DROPS + 4.0 * loaded) / WIDTHS) - np.arctan((side * DROPS + 4.0 * unloaded) / WIDTHS)
        )
        for side in (1.0, -1.0)
    ]  # at the upper and at the lower end of a field
    parabolas = depths_of_empty_rope + np.maximum(more[0][1:], more[1][:-1])
    assert parabolas == pytest.approx(LOADED, abs=0.2)  # its sags differ from ours by up to 3 cm
    near = numbers_at_positions(sorted([*(TOPS[1:-1, 0] - BESIDE).tolist(), *(TOPS[1:-1, 0] + BESIDE).tolist()]))
    for numbers, limit in ((numbers_at_mid_span, np.less), (near, np.greater)):
        ours = [max(row[f"knee:pole-{i}"] for row in numbers) for i in POLES]
        assert limit(ours, LOADED).all()
