"""Lines in motion as a user writes them."""

import re

import numpy as np
import pytest

from cablefem.elements.line import solve
from cablefem.scene import Scene, SceneError
from cablefem.scene.line import Line
from cablefem.scene.moving import line_in_motion
from cablefem.scene.short import load_line_or_none
from tests.motion.lines import LEFT, RIGHT, ROPE, car, line

TEXT = """
[cable]
mass_per_length = 11.4
EA = 2.1e8
[[contact]]
name = "valley"
kind = "counterweight"
at = [0.0, 0.0]
tension = 3.8e5
[[contact]]
name = "tower"
kind = "saddle"
at = [700.0, -290.0]
[[contact]]
name = "mountain"
kind = "anchor"
at = [1200.0, -480.0]
[[car]]
name = "up"
mass = 6000.0
travel = {kind = "trapezoid", top_speed = 7.0, acceleration = 0.5, deceleration = 0.5, from = 60.0, to = 640.0}
[[car]]
name = "down"
mass = 4500.0
drive = {mode = "haul", drag_area = 12.0}
travel = {kind = "trapezoid", top_speed = 7.0, acceleration = 0.5, deceleration = 0.5, from = 1100.0, to = 760.0}
"""


def test_a_file_of_a_line_in_motion():
    found = line_in_motion(Line.from_toml(TEXT), solve)
    assert [c.name for c in found.contacts] == ["valley", "up", "tower", "down", "mountain"]
    up, down = found.cars_on_rope
    assert (up.drive_mode_or_haul_x, down.drive_mode_or_haul_x) == ("grip", "haul_x")
    assert down.drive.k == pytest.approx(0.5 * 1.2 * 12.0)
    assert found.prescribed_position_with_rates(down, 0.0, 0) == (1100.0, 0.0, -0.5)
    assert found.prescribed_position_with_rates(down, found.t_end, len(found.phases) - 1) == (760.0, 0.0, 0.0)
    assert found.prescribed_position_with_rates(up, found.t_end, len(found.phases) - 1)[0] == 640.0
    assert found.t_end == pytest.approx(580.0 / 7.0 + 14.0)


WHEELS = "wheels = {base = 4.0, inertia = 3e4, below = 3.0, ahead = 0.2}"
HANGER = "hanger = {mass = 5000.0, length = 5.5, gyration = 1.3, damping = 0.05}"


def test_two_wheels_and_a_cabin_from_a_file():
    text = TEXT.replace("mass = 6000.0", f"mass = 6000.0\n{WHEELS}").replace(
        "mass = 4500.0", f"mass = 5500.0\n{HANGER}"
    )
    found = line_in_motion(Line.from_toml(text), solve)
    up, down = found.cars_on_rope
    assert [x.name for x in found.contacts_and_wheels] == ["valley", "up.rear", "up.front", "tower", "down", "mountain"]
    assert (up.wheels.base, up.wheels.below, up.wheels.ahead) == (4.0, 3.0, 0.2)
    assert down.hanger.inertia == pytest.approx(5000.0 * 1.3**2)
    # c = 2 zeta omega (J + m h^2), omega^2 = m g h/(J + m h^2)
    about = 5000.0 * (1.3**2 + 5.5**2)
    omega = (5000.0 * 9.81 * 5.5 / about) ** 0.5
    assert down.hanger.damping_moment_per_rate(9.81) == pytest.approx(0.1 * omega * about)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("mass = 6000.0", f"mass = 6000.0\n{WHEELS}\n{HANGER}", r"car\[0\].hanger: too much beside wheels"),
        ("mass = 4500.0", f"mass = 4500.0\n{HANGER}", r"car\[1\].hanger.mass = 5000.0: must be < 4500 kg"),
        ("drag_area", "hitch = [0.0, -2.0], drag_area", r"car\[1\].drive.hitch: of a car on two wheels"),
        ("to = 640.0}", "to = 698.0}\n" + WHEELS.replace("4.0", "-4.0"), r"car\[0\].wheels.base = -4.0: must be"),
        ("to = 760.0}", f"to = 702.0}}\n{WHEELS}", "car.down.wheels: tower is in the way"),
        ('travel = {kind = "trapezoid", top_speed = 7.0', 'at = 5.0\ntravel = {kind = "trapezoid", top_speed = 7.0',
         r"car\[0\].travel: too much beside at"),
        (', from = 1100.0', "", "car.down.travel.from: missing"),
        ("mass = 4500.0", "mass = 4500.0\nhauled = true", r"car\[1\].hauled: of a car at rest"),
        ('drive = {mode = "haul", drag_area = 12.0}\ntravel = {kind = "trapezoid", top_speed = 7.0, '
         'acceleration = 0.5, deceleration = 0.5, from = 1100.0, to = 760.0}', "", r"car\[1\].hauled: missing"),
        ('drive = {mode = "haul", drag_area = 12.0}\ntravel = {kind = "trapezoid", top_speed = 7.0, '
         'acceleration = 0.5, deceleration = 0.5, from = 1100.0, to = 760.0}', f"hauled = true\n{WHEELS}",
         r"car\[1\].hauled: of a car at rest, which has no wheels"),
        ('kind = "trapezoid", top_speed = 7.0, acceleration = 0.5, deceleration = 0.5, from = 60.0, to = 640.0',
         'kind = "table", times = [0.0, 1.0, 2.0], positions = [0.0, 5.0, 12.0], from = 60.0',
         "car.up.travel: 8 m/s at its end, 2 s; must be 0, for another car moves until"),
        ('mode = "haul", drag_area = 12.0', 'mode = "free"', r"car\[1\].travel: must be given for a car that grips"),
        ('mode = "haul", drag_area = 12.0', 'mode = "fre"', r"car\[1\].drive.mode = 'fre'"),
        ("from = 1100.0", "from = 1200.5", "car.down.travel.from: 1200.5 m; must be from 1 to 1199 m, 1 m within"),
        ("from = 60.0", "from = 0.5", r"car.up.travel.from: 0.5 m; must be from 1 to 1\d+.\d+ m, 1 m within the ends"),
        ('mode = "haul", drag_area = 12.0}\ntravel = {kind = "trapezoid", top_speed = 7.0, acceleration = 0.5, '
         'deceleration = 0.5, from = 1100.0, to = 760.0}',
         'mode = "free", start = 900.0, end = {time = 60.0}, brake = [{from = 1400.0, force = 9.0}]}',
         r"car.down.drive.brake\[0\].from = 1400: must be < 1"),
        ('mode = "haul", drag_area = 12.0}\ntravel = {kind = "trapezoid", top_speed = 7.0, acceleration = 0.5, '
         'deceleration = 0.5, from = 1100.0, to = 760.0}',
         'mode = "free", start = 900.0, end = {time = 60.0}, brake = [{from = 800.0, force = 9.0}]}',
         r"car.down.drive.brake\[0\].from = 800: must be > 900 m, .*; brakes act to the right of it"),
    ],
)  # fmt: skip
def test_a_fault_of_a_file_is_one_sentence(old, new, says):
    with pytest.raises(SceneError, match=says) as error:
        line_in_motion(Line.from_toml(TEXT.replace(old, new, 1)), solve)
    assert len(error.value.faults) == 1


class BackAndForth:
    """At rest at 100 m, 10 m back, at rest, 20 m on, at rest: 10 s each."""

    stops = (100.0, 100.0, 90.0, 90.0, 110.0, 110.0)
    phases = tuple((10.0 * i, 10.0 * i + 10.0) for i in range(5))

    def position_with_rates(self, t, phase):
        first, last = self.stops[phase : phase + 2]
        speed = (last - first) / 10.0
        return first + speed * (t - 10.0 * phase), speed, 0.0


def test_the_direction_of_a_car_is_that_of_its_next_motion_and_stays_after_the_last():
    found = line(ROPE, LEFT, car("car", 2000.0, BackAndForth(), "haul"), RIGHT, t_end=50.0)
    assert [found.travel_direction(found.cars_on_rope[0], i) for i in range(5)] == [-1.0, -1.0, 1.0, 1.0, 1.0]


SPAN = """
[cable]
mass_per_length = 13.3
EA = 2.52e8
horizontal_tension = 450e3
[supports]
span = 700.0
drop = -341.0
[mass]
mass = 8100.0
wheels = {base = 4.0, inertia = 3e4, below = 3.0, ahead = 0.2}
[travel]
kind = "trapezoid"
top_speed = 7.0
acceleration = 0.5
deceleration = 3.0
from = 300.0
to = 330.0
[drive]
mode = "haul"
hitch = [0.0, -2.0]
"""


def test_one_span_whose_car_has_two_wheels_is_a_line_with_the_same_cable(tmp_path):
    (tmp_path / "span.toml").write_text(SPAN)
    found = load_line_or_none(tmp_path / "span.toml")
    point = SPAN.replace("wheels", "#").replace("hitch", "#")
    empty, same = found.solve_empty_line(solve), Scene.from_toml(point)
    assert empty.s[-1] * found.cable.mass_per_length == pytest.approx(13.3 * same.length)
    assert np.abs(empty.ahead[0, 0]) == pytest.approx(450e3, rel=1e-5)
    assert [x.name for x in line_in_motion(found, solve).contacts_and_wheels] == [
        "left",
        "car.rear",
        "car.front",
        "right",
    ]
    on_platform = found.replace({"car.car.travel.from": 4.5})
    with pytest.raises(SceneError, match=r"begins with its front wheel at 4.5 m; must be >= 5.\d+ m"):
        line_in_motion(on_platform, solve)
    (tmp_path / "span.toml").write_text(point)
    assert load_line_or_none(tmp_path / "span.toml") is None


FREE_TROLLEY = """
cable = {mass_per_length = 0.6, EA = 7e6, sag = 4.0}
supports = {span = 160.0, drop = 9.0}
mass = {mass = 95.0, wheels = {base = 0.35, inertia = 6.0}}
drive = {mode = "free", start = 2.0}
"""


def test_what_a_trolley_of_one_span_lacks_is_named_in_the_keys_of_its_file(tmp_path):
    (tmp_path / "zip.toml").write_text(FREE_TROLLEY)
    with pytest.raises(SceneError, match=r"^drive\.end\.time: missing; must be given with wheels or a hanger$"):
        line_in_motion(load_line_or_none(tmp_path / "zip.toml"), solve)


def test_a_line_of_one_span_takes_the_keys_of_its_file(tmp_path):
    def load(text):
        (tmp_path / "span.toml").write_text(text)
        return load_line_or_none(tmp_path / "span.toml")

    changes = {"mass.mass": 900.0, "travel.to": 320.0, "cable.horizontal_tension": 5e5, "supports.drop": -10.0}
    written = SPAN
    for key, value in changes.items():
        name = key.rpartition(".")[2]
        written = re.sub(rf"(?m)^{name} = .*$", f"{name} = {value}", written)
        assert f"{name} = {value}" in written
    changed = load(SPAN).replace(changes)
    assert changed.to_toml() == load(written).to_toml()
    assert changed.replace({"mass.mass": "+10%"}).car[0].mass == pytest.approx(990.0)
    assert changed.replace({"car.car.mass": 800.0, "travel.to": 310.0}).to_toml().count("310.0") == 1
    assert load(SPAN).replace({}).replace(changes).to_toml() == changed.to_toml()
    assert changed.model_copy(update={"name": "copy"}).replace({"car.car.mass": 800.0}).name == "copy"
    with pytest.raises(SceneError, match=r"^mass.mass = -3.0: must be a number > 0"):
        changed.replace({"mass.mass": -3.0})
    with pytest.raises(SceneError, match=r"^travel.too = 3.0: unknown key. Did you mean to?"):
        changed.replace({"travel.too": 3.0})


def test_what_takes_no_line_says_so():
    with pytest.raises(SceneError, match=r"mass.wheels: not modelled: run and check alone take it"):
        Scene.from_toml(SPAN)


def test_marks_along_a_rope_move_with_its_heat():
    heat = "expansion = 1.2e-5\nreference_temperature = 0.0\ntemperature = 50.0\n[[contact]]"
    ride = 'mode = "free", start = 200.0, end = {time = 9.0}, brake = [{from = 300.0, force = 9e3}]'
    text = TEXT[: TEXT.index("travel =")].replace("[[contact]]", heat, 1) + f"drive = {{{ride}}}\n"
    (found,) = line_in_motion(Line.from_toml(text), solve).cars_on_rope
    stretch = 1.0 + 50.0 * 1.2e-5
    assert found.drive.start == pytest.approx(200.0 * stretch, rel=1e-12)
    assert found.drive.brakes == ((pytest.approx(300.0 * stretch, rel=1e-12), 9e3),)
