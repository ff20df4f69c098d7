"""Files of lines: what they say, and what is refused in a sentence that names the field."""

import tomllib

import pytest

from cablefem.scene import Scene, SceneError
from cablefem.scene.line import Line
from tests.line.lines import THREE, TRAMWAY, car, line

ROPE, LEFT, FIRST, SECOND, RIGHT, GRIP, HAULED = THREE
WEIGHT, ANCHOR, CAR = TRAMWAY[1:]


@pytest.mark.parametrize("name", Line.library())
def test_a_built_in_line_reads_back(name):
    found = Line.load(name)
    assert found.title
    assert Line(**tomllib.loads(found.to_toml())) == found


def test_positions_are_a_number_a_list_or_a_range():
    span = {"from": 1.0, "to": 2.0, "count": 3}
    for at, places in ((5.0, (5.0,)), ([5, 7.5], (5.0, 7.5)), (span, (1.0, 1.5, 2.0))):
        assert line(*THREE[:5], car("a", 1.0, at)).car[0].at == places


def test_a_scene_of_one_span_refuses_a_line_in_one_sentence():
    with pytest.raises(SceneError, match=r"^this needs one span with"):
        Scene.load("two-span")


@pytest.mark.parametrize(
    ("parts", "says"),
    [
        ((ROPE, LEFT, dict(FIRST, friction=0.1), RIGHT), r"contact\[1\].friction: not modelled"),
        ((ROPE, LEFT, dict(FIRST, name="a.b"), RIGHT), r"contact\[1\].name = 'a.b': must be letters"),
        ((ROPE, LEFT, dict(FIRST, kind="tower"), RIGHT), r"contact\[1\].kind = 'tower': unknown"),
        ((ROPE, LEFT, dict(FIRST, kind="anchor", shoe=None), RIGHT), "between the ends it must be a saddle"),
        ((ROPE, dict(LEFT, kind="saddle"), RIGHT), "an end must be an anchor, a spring or a counterweight"),
        ((ROPE, LEFT), "contact: must be at least two"),
        ((ROPE, dict(LEFT, at=[1.0, 0.0]), RIGHT), r"contact\[0\].at = \[1.0, 0.0\]: must be \[0, 0\]"),
        ((ROPE, LEFT, dict(RIGHT, at=[1.0, 20.0])), "less steep"),
        ((ROPE, LEFT, SECOND, FIRST, RIGHT), r"contact\[2\].at = \[400.0, -30.0\]: x must be > 820 m, that of second"),
        ((ROPE, LEFT, dict(RIGHT, shoe=2.0)), "shoe = 2.0: only a saddle has it"),
        ((ROPE, dict(WEIGHT, tension=None), RIGHT), "tension: missing; must be given for a counterweight"),
        (({**ROPE, "length": None}, WEIGHT, dict(WEIGHT, name="b", at=[9.0, 0.0])), "two counterweights"),
        ((ROPE, WEIGHT, ANCHOR), "cable.length: too much beside a counterweight"),
        (({**ROPE, "length": None}, LEFT, RIGHT), "exactly one of length, tension must be given"),
        (({**ROPE, "length": None, "tension": {"at": "lift", "value": 1.0}}, LEFT, RIGHT), "Did you mean left"),
        ((ROPE, LEFT, RIGHT, dict(CAR, name="left")), "name = 'left': given twice"),
        ((ROPE, LEFT, RIGHT, dict(CAR, at=[])), r"car\[0\].at = \[\]: must be a number, a list"),
        ((ROPE, LEFT, RIGHT, dict(CAR, at=1020.0)), "car.car.at: from 1020 to 1020 m; must be > 0 and < 1020 m"),
        ((ROPE, LEFT, dict(FIRST, shoe=None), RIGHT, car("a", 1.0, [300.0, 500.0])), "contact.first.shoe: missing"),
        ((ROPE, LEFT, FIRST, RIGHT, car("a", 1.0, [30.0, 500.0]), car("b", 1.0, [60.0, 500.0])), "at position 2: must"),
        ((ROPE, LEFT, FIRST, RIGHT, car("a", 1.0, [1.0, 2.0]), car("b", 1.0, [4.0, 5.0, 6.0])), "lists of 2 and of 3"),
        ((ROPE, LEFT, dict(FIRST, shoe=390.0), dict(SECOND, shoe=40.0), RIGHT), "contact.second.shoe: reaches first"),
    ],
)
def test_a_fault_is_one_sentence_that_names_the_field(parts, says):
    given = [{k: x for k, x in part.items() if x is not None} for part in parts]
    with pytest.raises(SceneError, match=says) as error:
        line(*given)
    assert len(error.value.faults) == 1


@pytest.mark.parametrize("table", ["supports", "mass", "travel", "drive"])
def test_tables_of_one_span_do_not_belong_to_a_line(table):
    with pytest.raises(SceneError, match=f"{table}: not modelled: it belongs to one span between two anchors"):
        line(*THREE, **{table: {}})
