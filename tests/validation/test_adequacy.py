"""The advice: the rung it chooses, what it says, whether it is right; its file and its page."""

import json

import numpy as np
import pytest
from markupsafe import Markup

from cablefem import Scene, SceneError
from validation.commands.advise import page
from validation.commands.advise import study as adequacy
from validation.commands.advise.study import LADDER, relative_gaps_by_need
from validation.core.running import run
from validation.core.view import View

LEVEL = Scene.load("level")
TAUT = Scene.from_groups(sag_ratio=0.006, slope=7.0, mu=0.13, alpha=147.0, speed_ratio=0.13, name="taut")
NAMES = [f"{model} + {load}" for model, load in LADDER]


@pytest.fixture(scope="module")
def level_advice(tmp_path_factory):
    """Advice on the paper's scene to 5 percent, in a folder."""
    out, progress = tmp_path_factory.mktemp("level"), []
    content = adequacy.advise(LEVEL, 0.05, out, lambda label, done, note="": progress.append((label, done)))
    return content, out, progress


def test_the_level_scene_needs_a_stretching_cable_for_its_path_and_little_for_ten_times_the_error_of_its_tension(
    level_advice,
):
    content, _, progress = level_advice
    lines = {r["name"]: r for r in content["rungs"]}
    assert content["asked"] == {"path": 0.05, "tension": 0.5}  # as `check` asks
    assert content["least"] == {"path": "stretching + mass", "tension": "sagged + force"}
    assert content["meets"]
    assert content["path_error"] <= 0.05 < content["tension_error"] <= 0.5
    assert lines["string + mass"]["tension_error"] > 0.5 >= lines["sagged + force"]["tension_error"]
    assert list(lines) == NAMES
    assert lines["sagged + mass"]["path_error"] > 1.0  # a sag that cannot stretch holds the cable up
    assert {label for label, _ in progress} == {"full model", "cheaper models", "methods"}
    assert all(0.0 <= done <= 1.0 for _, done in progress)


def test_the_run_that_is_advised_does_what_is_said_of_it(level_advice):
    content, _, _ = level_advice
    fine = run(LEVEL, "following-p2", elements=40, steps=2000, until=0.8)
    view = View.of_scene(LEVEL).cut_to_valid_range(fine)
    r = run(LEVEL, content["method"], model=content["model"], load=content["load"], until=0.8, **content["settings"])
    found = relative_gaps_by_need(r, fine, view)
    for need, bar in content["full"]["gaps"].items():  # what is said was measured against a coarser full run
        assert found[need] == pytest.approx(content["gaps"][need], abs=bar + 1e-4)


def test_an_advice_that_is_there_is_kept_and_another_tolerance_is_another_advice(level_advice, monkeypatch):
    content, out, _ = level_advice
    monkeypatch.setattr(adequacy, "advice", lambda *args: {"asked": "again"})
    assert adequacy.advise(LEVEL, 0.05, out) == content == json.loads((out / "advice.json").read_text())
    assert adequacy.advise(LEVEL, 0.04, out / "other") == {"asked": "again"}
    assert adequacy.advise(TAUT, 0.05, out / "other") == {"asked": "again"}


def test_a_taut_light_scene_needs_little():
    """Tight, stiff and slow with a light mass: linear, but not without the mass's inertia."""
    found = adequacy.advice(TAUT, 0.05)
    index = NAMES.index(found["name"])
    assert 0 < index < NAMES.index("stretching + mass")
    below = found["rungs"][index - 1]
    assert max(below["path_error"], 0.1 * below["tension_error"]) > 0.05
    assert max(found["path_error"], 0.1 * found["tension_error"]) <= 0.05


def test_a_zip_line_s_timetable_needs_the_load_path_and_no_more(tmp_path):
    found = adequacy.advise(Scene.load("zipline"), 2e-2, tmp_path)
    assert found["least"]["timetable"] == "quasi-static"
    off = {r["name"]: r["gaps"]["timetable"] for r in found["rungs"]}
    assert off["chord"] > off["empty cable"] > 2e-2 > off["quasi-static"] > off["full + mass"]
    assert found["meets"]
    (section,) = page.sections(tmp_path)
    assert "timetable, quasi-static" in section.summary


@pytest.mark.parametrize("tol", [0.0, -0.1, 1.0, float("nan")])
def test_a_tolerance_that_makes_no_sense_is_refused(tol, tmp_path):
    with pytest.raises(ValueError, match="tol must lie in"):
        adequacy.advise(LEVEL, tol, tmp_path)
    assert not list(tmp_path.iterdir())


TOL = 0.07


@pytest.mark.parametrize("seed", [pytest.param(31, marks=pytest.mark.slow), 32])
def test_random_advice_is_right(seed):
    """The rungs it chose are within what was asked of a finer full model, and the next cheaper ones are not.

    Rungs by the other solver, which shares no formula with the ladder's.
    """
    scene = random_scene(np.random.default_rng(seed))
    found = adequacy.advice(scene, TOL)
    full = found["full"]["settings"]
    finer = {"elements": round(1.5 * full["elements"]), "steps": 2 * full["steps"], "scheme": full["scheme"]}
    view = View.of_scene(scene)
    truth = run(scene, adequacy.REFERENCE, **finer, until=view.last_needed_relative_position)
    view = view.cut_to_valid_range(truth)

    def meets(index, need):
        model, load = LADDER[index]
        r = run(
            scene,
            "fourier-kink",
            model=model,
            load=load,
            terms=30,
            steps=1500,
            until=view.last_needed_relative_position,
        )
        return relative_gaps_by_need(r, truth, view)[need] <= found["asked"][need]

    for need, name in found["least"].items():
        index = NAMES.index(name)
        assert index == len(LADDER) - 1 or meets(index, need), (scene, need, name)
        assert index == 0 or not meets(index - 1, need), (scene, need, name)


def random_scene(rng):
    """A scene in the range in which the solvers are meant to work; refused combinations are drawn again."""
    ratios = {"sag_ratio": (0.005, 0.2), "mu": (0.05, 5.0), "alpha": (50.0, 1e4)}
    while True:
        drawn = {name: float(np.exp(rng.uniform(*np.log(ends)))) for name, ends in ratios.items()}
        try:
            return Scene.from_groups(**drawn, slope=rng.uniform(0.0, 45.0), speed_ratio=rng.uniform(0.1, 0.8))
        except SceneError:
            continue


# --- the page -------------------------------------------------------------------------------------------------------


def advice_page_text(tmp_path, gaps, **other):
    """Text of the page of advice to 5 percent, from distances (path, tension) of models, the full one last."""
    names = NAMES[: len(gaps) - 1] + NAMES[-1:]
    rungs = [
        {"name": name, "gaps": dict(zip(("path", "tension"), gap, strict=True)), "seconds": 0.1, "settings": {}}
        for name, gap in zip(names, gaps, strict=True)
    ]
    asked = {"path": 0.05, "tension": 0.5}
    least = {need: next(r["name"] for r in rungs if r["gaps"][need] <= enough) for need, enough in asked.items()}
    advice = {
        "tol": 0.05, "asked": asked, "rungs": rungs, "full": rungs[-1], "least": least, "method": None, "meets": True,
        "drive": "grip", "candidates": [], "slack_onset": None, "wheelbase": 1.0,
    }  # fmt: skip
    (tmp_path / "advice.json").write_text(json.dumps(advice | other))
    return Markup(page.sections(tmp_path)[0].html).striptags()


def test_what_the_full_run_s_error_could_turn_is_said_to_be_uncertain(tmp_path):
    text = advice_page_text(tmp_path, [(0.0505, 0.9), (0.01, 0.52), (1e-3, 0.2)]).replace("\u202f", " ")
    assert text.count("Too close") == 2
    assert "Too close to the tolerance of the path to be certain: string + force." in text
    assert "Too close to the tolerance of the tension to be certain: string + mass." in text
    assert "The path needs string + mass (asked: 5.0 %). Off by: string + force 5.1 %, string + mass 1.0 %" in text


def test_a_scene_that_falls_slack_at_once_is_said_to_need_the_full_model(tmp_path):
    assert "slack at sₒ/l = 0.030" in advice_page_text(tmp_path, [(1e-3, 2e-2)], slack_onset=0.03)


def test_a_need_that_no_model_meets_is_not_said_to_be_met(tmp_path):
    gaps = {"path": 1e-4, "tension": 21.5}
    settings = {"elements": 36}
    full = {"name": "full + mass", "gaps": gaps, "seconds": 1.0, "settings": settings}
    least = dict.fromkeys(gaps, "full + mass")
    unmet = {"full": full, "least": least, "method": "following-p2", "settings": settings, "seconds": 1.0}
    advice_page_text(tmp_path, [(1e-4, 0.2)], meets=False, **unmet)
    said = page.sections(tmp_path)[0].summary
    assert "path, full + mass; tension, none is sure to be; no run meets all" in said


def test_the_page_says_the_advice_and_shows_the_ladder(level_advice):
    _, out, _ = level_advice
    found = page.sections(out)
    html = "".join(str(s.html) for s in found)
    assert found[0].verdict == "agree"
    assert "path, stretching + mass; tension, sagged + force; cheapest run: " in found[0].summary
    assert html.count("<figure") == 1
    assert all(name in html for name in NAMES)
    assert len({s.id for s in found}) == len(found)
