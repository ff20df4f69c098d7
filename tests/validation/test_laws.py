"""Laws in SI see what both wings share: scene data, static shape, units, travel; right runs keep them."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest

from cablefem import Scene
from cablefem.response import Fields, Response
from cablefem.scene import Catenary, catenary
from tests.scene.test_ride import ZIP
from tests.validation.ladders import ladder_without_coarser_runs, run_ladder
from validation.core import laws
from validation.core.running import run
from validation.core.scene_data import OneSpanData

WINDOW = (0.02, 0.40)


def row_of_drive(r):
    """The law of the drive of a ride, without bars."""
    rows = check_all_laws(ladder_without_coarser_runs(r))
    return next(h for h in rows if (h.law or h.quantity) == "drive")


def check_all_laws(x, window=WINDOW):
    """Check one law after the other; those of a ride all the way."""
    return laws.law_rows_in_si(x, (0.0, 1.0) if x.finest.drive == "free" else window)


def row_by_law(x, window=WINDOW):
    return {h.law or h.quantity: h for h in check_all_laws(x, window)}


def is_broken(h):
    """Return whether a defect is beyond three times its bar."""
    return not h.gap <= 3.0 * h.allowed


def broken_laws(x):
    """Return the laws that a ladder breaks."""
    return {name for name, h in row_by_law(x).items() if is_broken(h)}


def breaks_a_law(x):
    return any(is_broken(h) for h in check_all_laws(x))


@pytest.fixture(scope="module")
def level_ladder():
    right = run_ladder(Scene.load("level"))
    assert broken_laws(right) == set()
    return right


@pytest.mark.parametrize("name", ["cruise", "inclined", "tramway"])
def test_right_answers_keep_every_law(name):
    scene = Scene.load(name)
    found = row_by_law(run_ladder(scene, elements=12, steps=1200, until=0.3), (0.02, 0.3))
    assert {name: h for name, h in found.items() if not h.gap <= 2.0 * h.allowed} == {}
    others = {"compression"}
    others |= {"tension on both sides", "drive", "car at rest"} if scene.drive.mode == "grip" else set()
    others |= {"displacement from velocity"} if name == "tramway" else set()  # slow: few frames in a swing
    assert set(found) == set(laws.LAWS) - others


def test_a_right_ride_keeps_every_law(ride_ladder):
    found = row_by_law(ride_ladder)
    assert {name: h for name, h in found.items() if not h.gap <= 2.0 * h.allowed} == {}
    assert set(found) == set(laws.LAWS) - {"compression", "travel"}


def with_groups(scene, **changes):
    """Return the scene with wrong groups, which both wings get."""
    wrong = scene.variant()
    wrong.__dict__["groups"] = replace(scene.groups, **changes)
    return wrong


def with_catenary(scene, **changes):
    wrong = scene.variant()
    wrong.__dict__["catenary"] = replace(scene.catenary, **changes)
    return wrong


LEVEL, INCLINED = Scene.load("level"), Scene.load("inclined")
SAG = Scene.from_groups(sag_ratio=0.03, alpha=700.0, mu=0.4, speed_ratio=0.3, slope=4.0)
SHARED = {
    "H from the length 0.5 % off": (LEVEL, with_catenary(LEVEL, horizontal_tension=1.005 * LEVEL.horizontal_tension)),
    "mu 1 % off": (LEVEL, with_groups(LEVEL, mu=1.01 * LEVEL.mu)),
    "alpha 5 % off": (LEVEL, with_groups(LEVEL, alpha=1.05 * LEVEL.alpha)),
    "EA 5 % off": (LEVEL, LEVEL.variant(alpha=0.95 * LEVEL.alpha)),
    "sigma 1 % off": (LEVEL, with_groups(LEVEL, sigma=1.01 * LEVEL.sigma)),
    "sag 2 % off": (SAG, with_catenary(SAG, horizontal_tension=SAG.horizontal_tension / 1.02)),
    "sign of the drop": (INCLINED, with_catenary(INCLINED, drop=-INCLINED.supports.drop)),
}


@pytest.mark.parametrize("fault", SHARED)
def test_what_both_wings_share_is_seen(fault):
    scene, wrong = SHARED[fault]
    assert breaks_a_law(run_ladder(wrong, claims=scene))


RIDER = Scene.from_toml(ZIP + "end = {time = 1.0}\n"), {"elements": 8, "steps": 100}
HAULED = Scene.load("tramway"), {"elements": 8, "steps": 200, "until": 0.05}


@pytest.mark.parametrize(("scene", "how"), [RIDER, HAULED], ids=["clamped", "on its rope"])
def test_a_car_that_begins_elsewhere_than_at_its_rest_is_seen(scene, how):
    """By the TOML: the rest of a car one percent heavier, and a start 1 % of the deflection too deep."""
    right = run_ladder(scene, **how)
    assert "car at rest" not in broken_laws(right)
    heavier = scene.replace({"mass.mass": 1.01 * scene.mass.mass})
    assert "car at rest" in broken_laws(run_ladder(heavier, claims=scene, **how))
    y = right.finest.y.copy()
    y[0] += 0.01 * right.finest.max_deflection
    assert "car at rest" in broken_laws(ladder_without_coarser_runs(replace(right.finest, y=y)))


def test_a_wrong_unit_of_time_is_seen(monkeypatch):
    scale = Scene.time_scale.fget
    monkeypatch.setattr(Scene, "time_scale", property(lambda self: 1.01 * scale(self)))
    assert "momentum of the mass" in broken_laws(run_ladder(LEVEL.variant()))


def test_a_wrong_curvature_of_the_shared_catenary_is_seen(monkeypatch):
    """Both wings have one of their own in their equations; what they observe goes by this one."""
    static = catenary.tension_and_shape_derivatives

    def bent(*at):
        return (*static(*at)[:3], *(1.02 * bend for bend in static(*at)[3:]))

    monkeypatch.setattr(catenary, "tension_and_shape_derivatives", bent)
    assert "momentum of the mass" in broken_laws(run_ladder(LEVEL.variant()))


@pytest.mark.parametrize(
    ("fault", "law"),
    [
        (lambda r: replace(r, fields=replace(r.fields, T=1.01 * r.fields.T, T_behind=1.01 * r.fields.T_behind,
                                             T_ahead=1.01 * r.fields.T_ahead)), "stretch"),
        (lambda r: replace(r, fields=replace(r.fields, T_static=1.01 * r.fields.T_static)), "forces at rest"),
        (lambda r: replace(r, velocity=1.01 * r.velocity), "momentum of the mass"),
        (lambda r: replace(r, slack_onset=0.40, slack_at=0.5, switched=0.40), "slack onset"),
        (lambda r: replace(r, tension_min=0.95 * r.tension_min), "least tension"),
        (lambda r: replace(r, contact=1.01 * r.contact), "momentum of the mass"),
        (lambda r: replace(r, t=1.01 * r.t), "travel"),
        (lambda r: replace(r, fields=replace(r.fields, x=1.001 * r.fields.x)), "ends at rest"),
        (lambda r: replace(r, fields=replace(r.fields, dv=1.05 * r.fields.dv)), "parts of the energy"),
        (lambda r: replace(r, fields=replace(r.fields, du=1.05 * r.fields.du)), "up to the mass"),
    ],
)  # fmt: skip
def test_an_altered_answer_breaks_the_law_it_concerns(level_ladder, fault, law):
    assert law in broken_laws(level_ladder.map(fault))


def test_a_slack_onset_told_late_is_seen():
    x = run_ladder(Scene.load("level"), elements=40, steps=1600, until=0.9)
    late = x.map(lambda r: replace(r, slack_onset=r.slack_onset + 0.03, switched=r.switched + 0.03))
    right, wrong = (row_by_law(y, (0.02, 0.89))["slack onset"] for y in (x, late))
    assert right.gap == 0.0
    assert wrong.gap > 3.0 * wrong.allowed


def test_displacement_follows_from_velocity_where_the_mass_stands_on_a_station(level_ladder):
    """The mass stands on one at every frame: the velocity behind it alone would leave 0.8 percent."""
    assert row_by_law(level_ladder)["displacement from velocity"].gap < 0.004


def test_changes_that_cancel_in_a_mean_leave_it_uncertain():
    right = laws.Defect(np.arange(4.0), np.array([[3.0], [1.0], [2.0], [0.0]]), averaged=True)
    finer = np.array([[2.0], [2.0], [1.0], [1.0]])  # the same mean by chance
    assert right.column_distances(right.value, finer) == pytest.approx(0.5)
    assert right.column_distances(right.value, right.value + 2.0) == pytest.approx(2.0)


@pytest.mark.parametrize("steps", [400, 401])  # slack begins after an even and an odd number of steps
def test_a_rope_that_falls_slack_has_no_compression_however_sparse_its_steps(steps):
    x = run_ladder(LEVEL, elements=12, steps=steps, until=0.9)
    assert row_by_law(x, (0.02, 0.89))["compression"].allowed < 1e-3


# --- every number of a response: 5 % off in both wings breaks a law ------------------------------------------------

ARRAYS = [name for name, f in Response.__dataclass_fields__.items() if f.type == "Array"]
NUMBERS = [*ARRAYS, "length", "horizontal_tension", *(f"fields.{name}" for name in Fields.__dataclass_fields__)]
UNHELD = {
    "acceleration": "shown nowhere, a contact force of the first order is what tells it",
    "tension_min_at": "for the flag of hidden slack alone",
    "F_haul": "there is none on a gripped car; see the ride",
    "fields.T_pointwise": "the paper's, ripples and all; an answer's tension is T",
    "fields.T_behind_pointwise": "the same",
    "fields.T_ahead_pointwise": "the same",
}
RIDE_NUMBERS = [
    "F_haul", "powers.thrust", "powers.drag", "powers.friction", "powers.brake", "powers.hold", "event.t", "event.s_o",
    "event.speed",
]  # fmt: skip
TOML = (
    ZIP + "release = 1.0\nwind = -3.0\nrolling_friction = 0.02\nthrust = {times = [0.5, 3.0], forces = [40.0, 70.0]}\n"
    "brake = [{from = 25.0, force = 40.0}, {from = 41.9, force = 170.0}]\nend = {place = 45.0}"
)
RODE = {"elements": 8, "steps": 300}


def response_with_wrong_number(r, name, factor=1.05):
    """Return the response with one of its numbers wrong by a factor."""
    part, _, of = name.rpartition(".")
    if part == "fields":
        return replace(r, fields=replace(r.fields, **{of: factor * getattr(r.fields, of)}))
    if part == "powers":
        return replace(r, powers=r.powers | {of: factor * r.powers[of]})
    if part == "event":
        return replace(r, events=[x | {of: factor * x[of]} for x in r.events])
    return replace(r, **{name: factor * getattr(r, name)})


@pytest.fixture(scope="module")
def ride_ladder():
    return run_ladder(Scene.from_toml(TOML), **RODE)


@pytest.mark.parametrize("name", [name for name in NUMBERS if name not in UNHELD])
def test_a_wrong_number_breaks_a_law(level_ladder, name):
    assert breaks_a_law(level_ladder.map(lambda r: response_with_wrong_number(r, name)))


@pytest.mark.parametrize("name", RIDE_NUMBERS)
def test_a_wrong_number_of_a_ride_breaks_a_law(ride_ladder, name):
    assert breaks_a_law(ride_ladder.map(lambda r: response_with_wrong_number(r, name)))


def test_a_coarser_ride_that_ends_earlier_is_held_as_far_as_it_goes(ride_ladder):
    def early(r):
        f = r.fields
        last = {x.name: value[:-3] for x in dataclasses.fields(f) if (value := getattr(f, x.name)).shape[0] == f.t.size}
        return replace(r, fields=replace(f, **last))

    shorter = replace(ride_ladder, space=replace(ride_ladder.space, runs=tuple(map(early, ride_ladder.space.runs))))
    assert all(np.isfinite(h.allowed) for h in row_by_law(shorter).values())


def test_a_coarser_run_that_does_not_say_what_a_law_asks_for_leaves_no_bar(ride_ladder):
    silent = tuple(replace(r, contact=np.nan * r.contact) for r in ride_ladder.time.runs)
    found = row_by_law(replace(ride_ladder, time=replace(ride_ladder.time, runs=silent)))
    assert found["momentum of the mass"].allowed == np.inf
    assert np.isfinite(found["travel" if "travel" in found else "drive"].allowed)


def test_events_that_are_told_elsewhere_and_a_stop_of_a_car_that_rolls_are_seen(ride_ladder):
    r = ride_ladder.finest
    assert r.speed[-1] > 0.1

    def gap_with_events(events):
        return row_of_drive(replace(r, events=events)).gap

    right = gap_with_events(r.events)
    stop = {"event": "stop", "t": float(r.t[-1]), "s_o": float(r.s_o[-1]), "speed": 0.0}
    assert gap_with_events([*r.events, stop]) > 100.0 * right
    for i, event in enumerate(r.events):
        assert gap_with_events([*r.events[:i], *r.events[i + 1 :]]) >= 1.0, event
        for name in ("t", "s_o", "speed") if event["speed"] > 0.1 else ("t", "s_o"):
            wrong = event | {name: 1.01 * event[name]}
            assert gap_with_events([*r.events[:i], wrong, *r.events[i + 1 :]]) > 100.0 * right, (event, name)


def test_brakes_that_begin_at_one_place_are_one_event():
    both = "brake = [{from = 25.0, force = 40.0}, {from = 25.0, force = 60.0}]\nend = {place = 45.0}\n"
    r = run(Scene.from_toml(ZIP + both), "following-p2", **RODE)
    assert [event["event"] for event in r.events].count("brake") == 1
    assert row_of_drive(r).gap < 1e-9


def test_a_turn_or_a_stop_that_is_told_late_is_seen():
    """A car on a level rope swings through the valley until friction holds it."""
    valley = ZIP.replace("drop = 15.0", "drop = 0.0") + "rolling_friction = 0.02\n"
    r = run(Scene.from_toml(valley), "following-p2", **RODE)
    kinds = [event["event"] for event in r.events]
    assert {"turn", "stop"} <= set(kinds)
    assert row_of_drive(r).gap < 1e-9
    for i, event in enumerate(r.events):
        k = min(int(np.searchsorted(r.t, event["t"])) + 20, r.t.size - 1)
        late = event | {"t": float(r.t[k]), "s_o": float(r.s_o[k])}
        if event["event"] == "turn":
            late["speed"] = float(r.speed[k])
        events = [*r.events[:i], late, *r.events[i + 1 :]]
        row = row_of_drive(replace(r, events=events))
        assert row.gap > row.allowed, event


@pytest.mark.slow
def test_a_rider_back_from_a_slack_cable_keeps_its_law():
    """Slack next to the far support, where the rider turns: s_o says nothing of when that was."""
    cable = "[cable]\nmass_per_length = 1.0\nEA = 1.5e7\nsag = 7.2\n[supports]\nspan = 137.0\ndrop = 15.0\n"
    car = "[mass]\nmass = 200.0\n[drive]\nmode = 'free'\nstart = 1.4\nend = {time = 12.0}\nthrust = 75.0\n"
    car += "brake = [{from = 115.0, force = 600.0}]\n"
    r = run(Scene.from_toml(cable + car), "following-p2", elements=6, steps=2000)
    assert r.switched is not None
    assert r.s_o[-1] < 0.95 * r.s_o.max()
    found = row_by_law(ladder_without_coarser_runs(r))
    assert max(found["strain at the mass"].gap, found["compression"].gap) < 1e-9
    assert row_by_law(ladder_without_coarser_runs(replace(r, switched=None)))["strain at the mass"].gap > 1e-3


@pytest.mark.parametrize(("slack", "kept"), [(0.4, True), (0.9, False)])
def test_energy_is_held_until_the_cable_is_slack(ride_ladder, slack, kept):
    r = ride_ladder.finest
    f, half = r.fields, 0.5 * r.t[-1]
    wrong = replace(f, du=f.du * np.where(f.t > half, 1.5, 1.0)[:, None])
    onset = float(np.interp(slack * r.t[-1], r.t, r.s_o)) / r.length
    after = replace(r, fields=wrong, slack_onset=onset, switched=onset)
    gap, before = (row_by_law(ladder_without_coarser_runs(x))["energy"].gap for x in (after, r))
    assert (gap <= before) is kept


def test_nothing_is_said_of_the_cable_beside_a_car_that_rolls_back_at_once(ride_ladder):
    beside = {"tension up to the mass", "up to the mass"}
    assert beside <= set(row_by_law(ride_ladder))
    back = run(Scene.from_toml(ZIP.replace("drop = 15.0", "drop = -90.0")), "following-p2", **RODE)
    assert back.s_o.max() < 1.1 * back.s_o[0]
    found = row_by_law(ladder_without_coarser_runs(back))
    assert not beside & set(found)
    assert all(np.isfinite(h.gap) for h in found.values())


# what both wings take the drive for -> what the scene says of it
DRIVES = {
    "drag 5 % off": ("drag_area = 0.6", "drag_area = 0.57"), "no wind": ("wind = -3.0", "wind = 0.0"),
    "the wind from behind": ("wind = -3.0", "wind = 3.0"), "friction 5 % off": ("friction = 0.02", "friction = 0.019"),
    "thrust 2 % off": ("[40.0, 70.0]", "[39.2, 68.6]"), "thrust 2 % longer": ("[0.5, 3.0]", "[0.49, 2.94]"),
    "brake 5 % off": ("force = 40.0", "force = 38.0"), "last brake 5 % off": ("force = 170.0", "force = 160.0"),
    "brake 1 % late": ("from = 25.0", "from = 24.75"),
    "release 5 % longer": ("release = 1.0", "release = 0.95"), "start 1 % off": ("start = 2.0", "start = 1.98"),
    "end 1 % off": ("place = 45.0", "place = 44.55"),
}  # fmt: skip


def ladder_claiming_scene(x, text):
    """Return a ladder whose answers are of another scene than they say."""
    toml = Scene.from_toml(text).to_toml()
    return x.map(lambda r: replace(r, scene_toml=toml))


@pytest.mark.parametrize("fault", DRIVES)
def test_a_wrong_drive_of_both_wings_is_seen(ride_ladder, fault):
    taken, said = DRIVES[fault]
    assert taken in TOML
    assert breaks_a_law(ladder_claiming_scene(ride_ladder, TOML.replace(taken, said)))


def test_the_judge_reads_the_toml_by_itself(level_ladder):
    given = OneSpanData(level_ladder.finest.scene_toml, level_ladder.finest.length)
    assert (given.rho, given.mass, given.span) == (1.0, 2002.3720103, 2000.0)
    assert given.prescribed == ("length", 2002.3720103)
    hanging = Catenary.from_length(given.span, given.drop, given.rho * given.gravity, given.prescribed[1])
    assert hanging.horizontal_tension == pytest.approx(level_ladder.finest.horizontal_tension, rel=1e-9)


def test_a_table_is_kept_to_rounding_by_few_steps():
    """Its kinks of the acceleration are no faults of the travel; one place told wrong is."""
    table = "times = [0.0, 9.0, 17.0, 27.0, 36.0, 46.0]\npositions = [0.0, 120.0, 240.0, 400.0, 560.0, 690.0]"
    text = Scene.library_text("tramway").replace("top_speed = 10.0", table)
    scene = Scene.from_toml(text.replace("accelerate_cruise_brake", "table"))
    r = run(scene, "following-p2", elements=4, steps=60)
    assert row_by_law(ladder_without_coarser_runs(r), (0.02, 0.9))["travel"].gap < 1e-12
    wrong = replace(r, scene_toml=r.scene_toml.replace("240.0", "240.001"))
    assert row_by_law(ladder_without_coarser_runs(wrong), (0.02, 0.9))["travel"].gap > 1e-7


def test_a_law_follows_axial_waves_within_its_windows():
    """A soft rope rings three times in a window: that the weight's moment swings there is no defect."""
    soft = {"cable.EA": 2e7, "cable.length": 2060.0, "supports.drop": 400.0, "travel.speed": 40.0}
    lively = run_ladder(Scene.load("level").replace(soft), elements=12, steps=6000, until=0.8)
    law = row_by_law(lively, (0.02, 0.8))["moment of momentum"]
    assert law.gap < 0.2 * law.allowed
