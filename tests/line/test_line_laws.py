"""Laws of a line at rest and the second computation of its printed numbers, each with a planted fault that is seen."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from cablefem import catenary_line
from cablefem.elements import line as elements
from cablefem.scene.line import Line
from tests.line.lines import SPRUNG, THREE, TRAMWAY, WEIGHED, car, line
from validation.commands.run.line import answer_line, max_and_min_rows
from validation.commands.run.worst import with_added_positions
from validation.core.agreement import Verdict
from validation.core.line_laws import printed_number_rows, statics_law_rows
from validation.page import line as page

HOT = {"temperature": 35.0, "reference_temperature": 10.0, "expansion": 1.2e-5, "ice": 1.3}
COLD = {"diameter": 0.04, "ice": {"thickness": 0.01, "density": 900.0}}
LINES = {"three": THREE, "weighed": WEIGHED, "sprung": SPRUNG, "tramway": TRAMWAY}
TIED = ({"mass_per_length": 9.0, "EA": 1.4e8, "tension": {"at": "left", "value": 4e5}}, *THREE[1:])


def line_with_rope(parts, **keys):
    return line({**parts[0], **keys}, *parts[1:])


def disagreeing_laws(rows):
    return {row.law for row in rows if row.verdict is not Verdict.AGREE}


@pytest.mark.parametrize("weather", [{}, HOT, COLD], ids=["plain", "hot", "iced"])
@pytest.mark.parametrize("name", LINES)
@pytest.mark.parametrize("solve", [catenary_line.solve, elements.solve], ids=["catenaries", "elements"])
def test_laws_hold_on_sound_answers(name, weather, solve):
    sound = line_with_rope(LINES[name], **weather)
    assert not disagreeing_laws(statics_law_rows(sound.to_toml(), sound.solve_at_rest(solve)))


@pytest.mark.parametrize(
    ("sound", "changes", "law"),
    [
        (line_with_rope(THREE, **HOT), {"cable.expansion": 0.0}, "shape and stretch"),
        (line_with_rope(THREE, **HOT), {"cable.ice": 1e-9}, "weight of each piece"),
        (line_with_rope(THREE, **HOT), {"cable.ice": 1e-9}, "rope, loads and reactions"),
        (line_with_rope(THREE, **COLD), {"cable.diameter": 0.0404}, "weight of each piece"),
        (line(*THREE), {"cable.length": 1024.5001}, "unstretched length"),
        (line(*TIED), {"cable.tension.value": 4.0001e5}, "tension of the empty line"),
        (line(*THREE), {"cable.EA": 1.401e8}, "shape and stretch"),
        (line(*THREE), {"car.grip.mass": 4000.1}, "balance of cars"),
        (line(*THREE), {"car.hauled.at": 618.62}, "points of contacts and cars"),
        (line(*THREE), {"contact.first.at": [400.0, -30.001]}, "points of contacts and cars"),
        (line(*TRAMWAY), {"contact.weight.tension": 3.8001e5}, "tension at the counterweight"),
        (line(*SPRUNG), {"contact.left.stiffness": [2.001e6, 5e6]}, "force of springs"),
    ],
)  # fmt: skip
def test_laws_see_an_answer_to_another_line(sound, changes, law):
    assert law in disagreeing_laws(
        statics_law_rows(sound.to_toml(), sound.replace(changes).solve_at_rest(catenary_line.solve))
    )


def test_laws_see_forces_that_saddles_and_cars_cannot_give():
    sound = line(*THREE)
    rest = sound.solve_at_rest(catenary_line.solve)
    state = rest.positions[0]
    slipping = replace(state, ahead=state.ahead * np.array([1.0, 1.0, 1.0 + 1e-6, 1.0, 1.0, 1.0])[:, None])
    lifted = replace(state, ahead=np.where(np.arange(6)[:, None] == 2, state.ahead - [0.0, 2e5], state.ahead))
    unhauled = replace(state, haul=-state.haul)
    planted = {
        "tension past saddles and hauled cars": slipping, "saddles press down": lifted, "balance of cars": unhauled,
    }  # fmt: skip
    for law, wrong in planted.items():
        assert law in disagreeing_laws(statics_law_rows(sound.to_toml(), replace(rest, positions=[wrong])))


GROUND = [[0.0, 5.0], [300.0, -60.0], [800.0, -260.0], [1300.0, -420.0]]
TREE = {"name": "tree", "at": 300.0, "top": -90.0}
FEW = {"car.up.at": [50, 320, 698, 704], "car.down.at": [488, 702, 900, 1142]}
TRAM = with_added_positions(Line.load("two-span").replace(FEW | {"ground": GROUND, "obstacle": [TREE]}))


def laws_broken_by_files(folder, result, edit=lambda folder: None, html=lambda text: text, of=TRAM):
    """What a judge of the line `of` finds wrong in the files and the page of a result."""
    result.write(folder, 1.0)
    text = "".join(section.html + section.summary for section in page.rest_sections(folder))
    edit(folder)
    return disagreeing_laws(printed_number_rows(of.to_toml(), result.rest, folder, html(text), page.WORDS))


@pytest.mark.parametrize("given", [TRAM, line_with_rope(SPRUNG, **HOT), Line.load("skyline")], ids=lambda x: x.name)
def test_printed_numbers_are_as_computed(tmp_path, given):
    assert not laws_broken_by_files(tmp_path, answer_line(given), of=given)


@pytest.mark.parametrize(
    "kind", ["rise", "pressure", "load", "haul", "tension_min", "safety_factor", "rope_over", "sag"]
)
def test_a_number_one_percent_off_is_seen(tmp_path, kind):
    result = answer_line(TRAM)
    wrong = [
        {name: x * 1.01 if name.partition(":")[0] == kind and x is not None else x for name, x in row.items()}
        for row in result.numbers
    ]
    seen = laws_broken_by_files(tmp_path, replace(result, numbers=wrong, design=max_and_min_rows(TRAM, wrong)))
    assert {f"positions.csv, {kind}", "design"} <= seen


def test_a_clearance_that_forgets_what_hangs_below_is_seen(tmp_path):
    bare = TRAM.replace({"car.up.below": 0.0, "car.down.below": 0.0})
    assert {"positions.csv, clearance_car", "design"} <= laws_broken_by_files(tmp_path, answer_line(bare))


def test_a_car_on_a_shoe_at_the_depth_of_the_empty_rope_is_seen(tmp_path):
    result = answer_line(TRAM)
    wrong = [{**row, "depth:up": row["depth:up"] + 0.3} if row["on:up"] else row for row in result.numbers]
    assert "positions.csv, depth" in laws_broken_by_files(tmp_path, replace(result, numbers=wrong))


def shift_columns(folder):
    file = folder / "positions.csv"
    head, *rows = file.read_text().splitlines()
    file.write_text("\n".join([head, *("," + row.rpartition(",")[0] for row in rows)]) + "\n")


def rewriting(name, old, new):
    def edit(folder):
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new))

    return edit


def drawing(change):
    def edit(folder):
        file = folder / "ropes.json"
        ropes = json.loads(file.read_text())
        change(ropes["profile"], ropes["depths"])
        file.write_text(json.dumps(ropes))

    return edit


def lower_rope(profile, depths):
    depths["2"] = [depth + 1e-3 for depth in depths["2"]]


def lose_number_of_profile(profile, depths):
    profile["y_rest"][3] = None


def lose_number_of_rope(profile, depths):
    depths["2"][3] = None


def lose_end_of_profile(profile, depths):
    profile["y_rest"].pop()


def write_letter_in_last_cell(folder):
    file = folder / "profile.csv"
    file.write_text(file.read_text().rstrip().rpartition(",")[0] + ",x\n")


@pytest.mark.parametrize(
    ("edit", "seen"),
    [
        (shift_columns, "positions.csv, depth"),
        (rewriting("profile.csv", "y_highest,y_lowest", "y_lowest,y_highest"), "profile.csv, y_lowest"),
        (write_letter_in_last_cell, "profile.csv"),
        (drawing(lower_rope), "ropes.json"),
        (drawing(lose_number_of_profile), "ropes.json"),
        (drawing(lose_number_of_rope), "ropes.json"),
        (drawing(lose_end_of_profile), "ropes.json"),
        (rewriting("summary.json", '"outcome_kind": "collides"', '"outcome_kind": "carries"'), "outcome"),
        (rewriting("summary.json", "hits tree", "hits bush"), "outcome"),
        (rewriting("summary.json", '"position": 4', '"position": 3'), "design, positions of cars"),
    ],
)  # fmt: skip
def test_a_fault_in_a_file_is_seen(tmp_path, edit, seen):
    assert seen in laws_broken_by_files(tmp_path, answer_line(TRAM), edit)


@pytest.mark.parametrize(("old", "new"), [(" kN", " MN"), ("largest tension", "tension"), ("up 50", "up 60")])
def test_a_fault_in_the_page_is_seen(tmp_path, old, new):
    seen = laws_broken_by_files(tmp_path, answer_line(TRAM), html=lambda text: text.replace(old, new))
    assert seen <= {"page", "page, cars"}
    assert seen


def test_a_column_without_second_computation_is_seen(tmp_path):
    result = answer_line(TRAM)
    more = [{**row, "wear:tower": 1.0} for row in result.numbers]
    assert "positions.csv, wear" in laws_broken_by_files(tmp_path, replace(result, numbers=more))


def test_a_wrong_state_writes_no_nan_and_breaks_laws(tmp_path):
    sound = line(*THREE)
    rest = sound.solve_at_rest(catenary_line.solve)
    state = rest.positions[0]
    wrong = replace(rest, positions=[replace(state, s=state.s[::-1])])
    answer_line(sound, rest=wrong).write(tmp_path, 1.0)
    for file in tmp_path.iterdir():
        assert "nan" not in file.read_text().lower()
    assert "shape and stretch" in disagreeing_laws(statics_law_rows(sound.to_toml(), wrong))


def test_of_many_cars_a_number_names_its_position(tmp_path):
    """Of 45 chairs of a lift each row and the outcome had forty-five names."""
    rope, *ends = TRAMWAY[:3]
    chairs = [car(f"chair {k}", 80.0, [100.0 * k, 100.0 * k + 50.0], below=3.0) for k in range(1, 12)]
    lift = line({**rope, "breaking_load": 3e6}, *ends, *chairs)
    result = answer_line(lift)
    assert "chair" not in result.outcome.sentence
    assert re.search(r"kN at position [12]$", result.outcome.sentence)
    assert not laws_broken_by_files(tmp_path, result, of=lift)
    wrong = laws_broken_by_files(tmp_path, result, html=lambda text: text.replace("position 2", "position 1"), of=lift)
    assert wrong == {"page, cars"}


def test_the_outcome_names_a_broken_rope_first_then_what_collides():
    assert answer_line(TRAM).outcome.kind == "collides"
    assert "up hits tree by" in answer_line(TRAM).outcome.sentence
    broken = answer_line(TRAM.replace({"cable.breaking_load": 4e5})).outcome
    assert broken.kind == "breaks"
    assert broken.sentence.startswith("the rope is loaded beyond its breaking load: 4")
    assert "would collide: " in broken.sentence
    assert answer_line(TRAM.replace({"ground": [], "obstacle": []})).outcome.kind == "carries"
