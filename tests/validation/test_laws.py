"""Laws in SI see what both wings share: scene data, static shape, units, travel; right runs keep them."""

from __future__ import annotations

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from cablefem import Scene
from cablefem.response import Fields, Response
from cablefem.scene import Catenary, catenary
from tests.scene.test_ride import ZIP
from validation.core import evidence, laws
from validation.core.running import run

WINDOW = (0.02, 0.40)
COARSE = {"elements": 10, "steps": 400, "until": 0.42}
# largest defects, as parts of the laws' scales, of the coarse runs that are judged here
RIGHT = {
    "stretch": 2e-3, "tension on both sides": 2e-3, "momentum of the mass": 1e-5, "energy": 3e-3, "travel": 1e-9,
    "drive": 1e-9, "place of the mass": 1e-9, "strain at the mass": 1e-9, "speed of the mass": 1e-4,
    "fields at the mass": 5e-4, "tension up to the mass": 5e-3, "summed over time": 2e-2,
    "up to the mass": 1e-2,
    "parts of the energy": 1e-3, "power": 3e-3, "momentum of the cable": 1e-3, "moment of momentum": 1e-3,
}  # fmt: skip
AT_REST = 1e-6


def answer(scene, **told):
    """Run a scene and let its response claim to be of another."""
    r = run(scene, "following-p2", **COARSE)
    return replace(r, scene_toml=told["claims"].to_toml()) if told else r


@pytest.fixture(scope="module")
def level():
    return answer(Scene.load("level"))


def broken(r, right=RIGHT):
    """Return the laws that a response breaks."""
    gaps = {held.law: held.gap for held in laws.hold(r, (0.0, 1.0) if r.drive == "free" else WINDOW)}
    allowed = {name: right.get(name, AT_REST if name.endswith("at rest") else np.inf) for name in gaps}
    return {name for name in gaps if gaps[name] > allowed[name]}


@pytest.mark.parametrize("name", ["level", "cruise", "inclined", "tramway", "zipline", "kevlar"])
def test_right_answers_keep_every_law(name):
    scene = Scene.load(name)
    free = scene.drive.mode == "free"
    if free:  # let go at once, the undamped rule rings along the cable
        scene = Scene.from_toml(scene.to_toml().replace("[drive]", "[drive]\nrelease = 1.0"))
    # sums by trapezoids are exact for the trapezoidal rule, of first order for one that takes its balance inside a step
    how = {"steps": 1500, "scheme": "trapezoidal"} if free else {"steps": 300}
    r = run(scene, "following-p2", elements=8, until=0.3, **how)
    assert broken(r) == set()
    others = {"compression", *({"tension on both sides", "drive"} if scene.drive.mode == "grip" else ())}
    others |= {"travel"} if free else set()
    others |= {"summed over time"} if name in ("tramway", "kevlar") else set()  # slow: few frames in a swing
    assert {held.law for held in laws.hold(r, WINDOW)} == set(laws.LAWS) - others


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
    assert broken(answer(scene)) == set()
    assert broken(answer(wrong, claims=scene))


def test_a_wrong_unit_of_time_is_seen(monkeypatch):
    scale = Scene.time_scale.fget
    monkeypatch.setattr(Scene, "time_scale", property(lambda self: 1.01 * scale(self)))
    assert "momentum of the mass" in broken(answer(LEVEL.variant()))


def test_a_wrong_curvature_of_the_shared_catenary_is_seen(monkeypatch):
    """Both wings have one of their own in their equations; what they observe goes by this one."""
    static = catenary.static
    monkeypatch.setattr(catenary, "static", lambda *at: (*static(*at)[:3], *(1.02 * bend for bend in static(*at)[3:])))
    assert "momentum of the mass" in broken(answer(LEVEL.variant()))


@pytest.mark.parametrize(
    ("fault", "law"),
    [
        (lambda r: replace(r, fields=replace(r.fields, T=1.01 * r.fields.T, T_behind=1.01 * r.fields.T_behind,
                                             T_ahead=1.01 * r.fields.T_ahead)), "stretch"),
        (lambda r: replace(r, fields=replace(r.fields, T_static=1.01 * r.fields.T_static)), "forces at rest"),
        (lambda r: replace(r, velocity=1.01 * r.velocity), "momentum of the mass"),
        (lambda r: replace(r, contact=1.01 * r.contact), "momentum of the mass"),
        (lambda r: replace(r, t=1.01 * r.t), "travel"),
        (lambda r: replace(r, fields=replace(r.fields, x=1.001 * r.fields.x)), "ends at rest"),
        (lambda r: replace(r, fields=replace(r.fields, dv=1.05 * r.fields.dv)), "energy"),
        (lambda r: replace(r, fields=replace(r.fields, du=1.05 * r.fields.du)), "up to the mass"),
    ],
)  # fmt: skip
def test_an_altered_answer_breaks_the_law_it_concerns(level, fault, law):
    assert law not in broken(level)
    assert law in broken(fault(level))


# --- every number of a response: 5 % off in both wings breaks a law ------------------------------------------------

ARRAYS = [name for name, f in Response.__dataclass_fields__.items() if f.type == "Array"]
NUMBERS = [*ARRAYS, "length", "horizontal_tension", *(f"fields.{name}" for name in Fields.__dataclass_fields__)]
UNHELD = {
    "acceleration": "shown nowhere, a contact force of the first order is what tells it",
    "tension_min": "least of a basis with its ripples, for the flag of hidden slack alone",
    "tension_min_at": "the same",
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
    "brake = [{from = 25.0, force = 40.0}]\nend = {place = 45.0}"
)
RODE = {"elements": 8, "steps": 600, "scheme": "trapezoidal"}
RIGHT_RIDE = RIGHT | {
    "momentum of the mass": 5e-4, "energy": 1e-4, "power": 2e-5, "parts of the energy": 1e-4,
    "tension on both sides": 3e-4, "momentum of the cable": 1e-4, "fields at the mass": 2e-4,
    "up to the mass": 0.1,  # the undamped rule rings along the cable
}  # fmt: skip


def off(r, name, factor=1.05):
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
def ride():
    return run(Scene.from_toml(TOML), "following-p2", **RODE)


@pytest.mark.parametrize("name", [name for name in NUMBERS if name not in UNHELD])
def test_a_wrong_number_breaks_a_law(level, name):
    assert broken(off(level, name))


@pytest.mark.parametrize("name", RIDE_NUMBERS)
def test_a_wrong_number_of_a_ride_breaks_a_law(ride, name):
    assert not broken(ride, RIGHT_RIDE)
    assert broken(off(ride, name), RIGHT_RIDE)


def test_laws_are_held_as_long_as_all_companions_go(ride):
    f = ride.fields
    early = {x.name: value[:-3] for x in dataclasses.fields(f) if (value := getattr(f, x.name)).shape[0] == f.t.size}
    stopped = replace(ride, fields=replace(f, **early))
    assert all(np.isfinite(held.changed) for held in laws.hold(ride, (0.0, 1.0), (ride, stopped)))
    silent = replace(ride, contact=np.nan * ride.contact)
    assert not all(np.isfinite(held.changed) for held in laws.hold(ride, (0.0, 1.0), (ride, silent)))


def test_a_rider_back_from_a_slack_cable_keeps_its_law():
    """Slack next to the far support, where the rider turns: s_o says nothing of when that was."""
    cable = "[cable]\nmass_per_length = 1.0\nEA = 1.5e7\nsag = 7.2\n[supports]\nspan = 137.0\ndrop = 15.0\n"
    car = "[mass]\nmass = 200.0\n[drive]\nmode = 'free'\nstart = 1.4\nend = {time = 12.0}\nthrust = 75.0\n"
    car += "brake = [{from = 115.0, force = 600.0}]\n"
    r = run(Scene.from_toml(cable + car), "following-p2", elements=6, steps=500)
    assert r.switched is not None
    assert r.s_o[-1] < 0.95 * r.s_o.max()
    gaps = {held.law: held.gap for held in laws.hold(r, (0.0, 1.0))}
    assert max(gaps["strain at the mass"], gaps["compression"]) < 1e-9
    gaps = {held.law: held.gap for held in laws.hold(replace(r, switched=None), (0.0, 1.0))}
    assert gaps["strain at the mass"] > 1e-3


@pytest.mark.parametrize(("slack", "kept"), [(0.4, True), (0.9, False)])
def test_energy_is_held_until_the_cable_is_slack(ride, slack, kept):
    f, half = ride.fields, 0.5 * ride.t[-1]
    wrong = replace(f, du=f.du * np.where(f.t > half, 1.5, 1.0)[:, None])
    onset = float(np.interp(slack * ride.t[-1], ride.t, ride.s_o)) / ride.length
    after = replace(ride, fields=wrong, slack_onset=onset, switched=onset)
    gap, before = (next(x.gap for x in laws.hold(r, (0.0, 1.0)) if x.law == "energy") for r in (after, ride))
    assert (gap <= before) is kept


def test_nothing_is_said_of_the_cable_beside_a_car_that_rolls_back_at_once(ride):
    beside = {"tension up to the mass", "up to the mass"}
    assert beside <= {held.law for held in laws.hold(ride, (0.0, 1.0))}
    back = run(Scene.from_toml(ZIP.replace("drop = 15.0", "drop = -90.0")), "following-p2", **RODE)
    assert back.s_o.max() < 1.1 * back.s_o[0]
    found = list(laws.hold(back, (0.0, 1.0)))
    assert not beside & {held.law for held in found}
    assert all(np.isfinite(held.gap) for held in found)


# what a scene says of its drive -> what both wings take it for
DRIVES = {
    "drag 5 % off": ("drag_area = 0.6", "drag_area = 0.63"), "no wind": ("wind = -3.0", "wind = 0.0"),
    "the wind from behind": ("wind = -3.0", "wind = 3.0"), "friction 5 % off": ("friction = 0.02", "friction = 0.021"),
    "thrust 2 % off": ("[40.0, 70.0]", "[40.8, 71.4]"), "thrust 2 % longer": ("[0.5, 3.0]", "[0.51, 3.06]"),
    "brake 5 % off": ("force = 40.0", "force = 42.0"), "brake 1 % late": ("from = 25.0", "from = 25.25"),
    "release 5 % longer": ("release = 1.0", "release = 1.05"), "start 1 % off": ("start = 2.0", "start = 2.02"),
    "end 1 % off": ("place = 45.0", "place = 45.45"),
}  # fmt: skip


@pytest.mark.parametrize("fault", DRIVES)
def test_a_wrong_drive_of_both_wings_is_seen(fault):
    right, wrong = DRIVES[fault]
    assert right in TOML
    r = run(Scene.from_toml(TOML.replace(right, wrong)), "following-p2", **RODE)
    assert not broken(r, RIGHT_RIDE)
    assert broken(replace(r, scene_toml=TOML), RIGHT_RIDE)


def test_the_judge_reads_the_toml_by_itself(level):
    given = evidence.Given(level.scene_toml, level.length)
    assert (given.rho, given.mass, given.span) == (1.0, 2002.3720103, 2000.0)
    assert given.asked == ("length", 2002.3720103)
    hanging = Catenary.from_length(given.span, given.drop, given.rho * given.gravity, given.asked[1])
    assert hanging.horizontal_tension == pytest.approx(level.horizontal_tension, rel=1e-9)


def test_a_table_is_kept_to_rounding_by_few_steps(monkeypatch):
    """Its kinks of the acceleration are no faults of the travel; one place told wrong is."""
    table = "times = [0.0, 9.0, 17.0, 27.0, 36.0, 46.0]\npositions = [0.0, 120.0, 240.0, 400.0, 560.0, 690.0]"
    text = Scene.library_text("tramway").replace("top_speed = 10.0", table)
    scene = Scene.from_toml(text.replace("accelerate_cruise_brake", "table"))
    r = run(scene, "following-p2", elements=4, steps=60)

    def gap(r):
        return next(held.gap for held in laws.hold(r, (0.02, 0.9)) if held.law == "travel")

    assert gap(r) < 1e-12
    assert gap(replace(r, scene_toml=r.scene_toml.replace("240.0", "240.001"))) > 1e-7
    monkeypatch.setattr(laws, "_before", lambda t, s, knots: laws.CubicSpline(t, s)(knots))
    assert gap(r) > 1e-8


def test_splines_in_one_go_are_those_of_scipy():
    """Lengths of curves and integrals of sides of any size, next to each other; short curves are straight."""
    rng = np.random.default_rng(4)
    sides = [3.7 * np.sort(rng.random(count)) for count in (2, 3, 4, 7, 3, 20, 2, 5)]
    ends = np.cumsum([s.size for s in sides])
    y = rng.standard_normal((ends[-1], 5))
    found = laws._pieces(np.concatenate(sides), y[:, :4], y[:, 4], ends)
    at, weights = np.polynomial.legendre.leggauss(3)
    for s, end in zip(sides, ends, strict=True):
        mine, piece = y[end - s.size : end], slice(end - s.size, end - 1)
        spline = make_interp_spline(s, mine, k=min(3, s.size - 1))
        h = 0.5 * np.diff(s)
        points = s[:-1, None] + h[:, None] * (1.0 + at)
        straight = np.repeat((np.diff(mine, axis=0) / np.diff(s)[:, None])[:, None], 3, axis=1)
        slope = spline(points, 1) if s.size > 3 else straight
        for k in (0, 2):
            length = h * (np.hypot(slope[..., k], slope[..., k + 1]) @ weights)
            np.testing.assert_allclose(found[k // 2][piece], length, rtol=1e-11)
        np.testing.assert_allclose(found[2][piece], h * (spline(points)[..., 4] @ weights), rtol=0.0, atol=1e-11)
    assert all(x[ends[:-1] - 1].max() == 0.0 for x in found)
