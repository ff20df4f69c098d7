"""Laws in SI see what both wings share: scene data, static shape, units, travel; right runs keep them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cablefem import Scene
from cablefem.scene import Catenary
from validation.core import laws
from validation.core.running import run

WINDOW = (0.02, 0.40)
COARSE = {"elements": 10, "steps": 400, "until": 0.42}
# largest defects, as parts of the laws' scales, of the coarse runs that are judged here
RIGHT = {"stretch": 2e-3, "tension on both sides": 2e-3, "momentum of the mass": 1e-5, "energy": 3e-3, "travel": 1e-9}
AT_REST = 1e-6


def answer(scene, **told):
    """Run a scene and let its response claim to be of another."""
    r = run(scene, "following-p2", **COARSE)
    return replace(r, scene_toml=told["claims"].to_toml()) if told else r


@pytest.fixture(scope="module")
def level():
    return answer(Scene.load("level"))


def broken(r):
    """Return the laws that a response breaks."""
    gaps = {held.law: held.gap for held in laws.hold(r, WINDOW)}
    allowed = {name: RIGHT.get(name, AT_REST if name.endswith("at rest") else np.inf) for name in gaps}
    return {name for name in gaps if gaps[name] > allowed[name]}


@pytest.mark.parametrize("name", ["level", "cruise", "inclined", "tramway", "zipline", "kevlar"])
def test_right_answers_keep_every_law(name):
    scene = Scene.load(name)
    free = scene.drive.mode == "free"
    # sums by trapezoids are exact for the trapezoidal rule, of first order for one that takes its balance inside a step
    how = {"steps": 1500, "scheme": "trapezoidal"} if free else {"steps": 300}
    r = run(scene, "following-p2", elements=8, until=0.3, **how)
    assert broken(r) == set()
    others = {"compression", "tension on both sides" if scene.drive.mode == "grip" else "", "travel" if free else ""}
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
    ],
)  # fmt: skip
def test_an_altered_answer_breaks_the_law_it_concerns(level, fault, law):
    assert law not in broken(level)
    assert law in broken(fault(level))


def test_the_judge_reads_the_toml_by_itself(level):
    given = laws.Given.read(level.scene_toml)
    assert (given.rho, given.mass, given.span) == (1.0, 2002.3720103, 2000.0)
    assert given.asked == ("length", 2002.3720103)
    hanging = Catenary.from_length(given.span, given.drop, given.rho * given.gravity, given.asked[1])
    assert hanging.horizontal_tension == pytest.approx(level.horizontal_tension, rel=1e-9)
