"""Values of --set, and the grid that they make."""

import pytest

from cablefem.scene.described import set_dotted_key
from validation.core import grid


@pytest.mark.parametrize(
    ("pair", "values"),
    [
        ("mass.mass=60", [60]),
        ("drive.wind = -8,-4.5,0", [-8, -4.5, 0]),
        ("mass.mass=40:80:3", [40.0, 60.0, 80.0]),
        ("car.up.at=[50,60]", [[50, 60]]),
        ("car.up.at=[50,60],[70,80]", [[50, 60], [70, 80]]),
        ("scheme=trapezoidal", ["trapezoidal"]),
        ("mass.mass=+1%", ["+1%"]),
    ],
)
def test_values_are_read(pair, values):
    assert grid.parse_key_and_values(pair) == (pair.split("=")[0].strip(), values)


@pytest.mark.parametrize(
    "pair",
    ["mass.mass", "mass.mass=", "=3", *(f"mass.mass={x}" for x in ("1:2:0", "a:b:c", "60:100:2.5", "60:100:1001"))],
)
def test_what_is_no_value_is_said(pair):
    with pytest.raises(ValueError, match="--set"):
        grid.parse_key_and_values(pair)


def test_several_keys_make_a_grid():
    points = grid.grid_points(["mass.mass=40,60,40", "drive.wind=-8,0"])
    assert [tuple(p.values()) for p in points] == [(40, -8), (40, 0), (60, -8), (60, 0)]
    assert len(grid.grid_points(["x=1,1.0,true"])) == 2
    with pytest.raises(ValueError, match="given twice"):
        grid.grid_points(["mass.mass=1", "mass.mass=2"])
    with pytest.raises(ValueError, match="at most"):
        grid.grid_points(["mass.mass=1:2:200", "drive.wind=0:1:200"])


def test_values_go_where_the_key_says():
    data = {"mass": {"mass": 80.0}, "contact": [{"name": "valley", "tension": 3e5}, {"name": "tower"}]}
    set_dotted_key(data, "mass.mass", "-5%")
    set_dotted_key(data, "contact.valley.tension", 4e5)
    set_dotted_key(data, "contact.1.shoe", 6.0)
    set_dotted_key(data, "drive.wind", -3.0)
    assert data == {
        "mass": {"mass": 76.0}, "contact": [{"name": "valley", "tension": 4e5}, {"name": "tower", "shoe": 6.0}],
        "drive": {"wind": -3.0},
    }  # fmt: skip
    for key, fault in {
        "contact.peak.tension": r"such entry\. Known: valley, tower",
        "mass.mass.mass": "no table",
    }.items():
        with pytest.raises(ValueError, match=fault):
            set_dotted_key(data, key, 1.0)
    with pytest.raises(ValueError, match="does not give"):
        set_dotted_key(data, "cable.EA", "+1%")
    with pytest.raises(ValueError, match=r"Did you mean mass\?"):
        set_dotted_key(data, "mass.mas", "+1%")
    data["contact"][1]["at"] = [700.0, -290.0]
    with pytest.raises(ValueError, match=r"is a list; write all of it, as contact\.tower\.at=\[700\.0, -290\.0\]"):
        set_dotted_key(data, "contact.tower.at.1", -100.0)
