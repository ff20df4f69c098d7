"""Slack, start and exit, energy, the failure catalogue and the atlas: each with a twin that must fail."""

import json
import math
from dataclasses import replace
from functools import cache
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from cablefem import Scene
from cablefem.newmark import StepFailure
from cablefem.response import Response
from validation.commands.atlas import page as pages
from validation.commands.atlas.catalogue import CATALOGUE, condition_holds, measure_failure_and_remedy
from validation.commands.atlas.study import CELLS, atlas, judged_cell
from validation.commands.sweep.job import response_faults
from validation.core import measures
from validation.core.design import design_numbers
from validation.core.flags import MAX_GAIN
from validation.core.methods import METHODS
from validation.core.refine import run_with_error_bars
from validation.core.running import run
from validation.core.trust import convergence_limit, max_relative_path_gap_past_slack
from validation.core.view import View
from validation.page.page import write_page

LEVEL = Scene.load("level")
LIGHT = LEVEL.variant(mu=0.01)


@cache
def level_run(method: str, resolution: int, steps: int) -> Response:
    return run(LEVEL, method, **{METHODS[method].resolution.setting: resolution, "steps": steps})


# --- slack ----------------------------------------------------------------------------------------------------------
FAR = [("following-p2", 10, 1000), ("following-p2", 20, 2000), ("fourier-kink", 30, 1500)]


@pytest.mark.parametrize("case", FAR)
def test_level_reaches_the_far_support_and_finds_the_onset(case):
    r = level_run(*case)
    assert r.reached >= 0.995
    # 0.831 for undamped elements; the sines agree because ripples are averaged away
    assert abs(r.slack_onset - 0.831) < 0.003
    assert r.switched == r.slack_onset
    assert r.flags == []


def test_paths_agree_after_the_onset_and_one_that_is_off_there_is_seen():
    runs = [level_run(*case) for case in FAR]
    assert max(max_relative_path_gap_past_slack(a, b, 0.95) for a, b in combinations(runs, 2)) < 0.02
    a, b = runs[:2]
    shifted = replace(b, v=b.v + 0.05 * b.max_deflection * (b.s_o > 0.9 * b.length))
    assert max_relative_path_gap_past_slack(a, shifted, 0.95) > 0.04
    assert math.isnan(max_relative_path_gap_past_slack(*[replace(a, slack_onset=None)] * 2, 0.95))


@pytest.mark.parametrize("scheme", ["trapezoidal", "newmark", "generalized-alpha"])
@pytest.mark.parametrize(("method", "resolution"), [("following-p2", 8), ("fourier-kink", 14)])
def test_every_scheme_and_solver_goes_on_past_the_onset(method, resolution, scheme):
    r = run(LEVEL, method, **{METHODS[method].resolution.setting: resolution, "steps": 300, "scheme": scheme})
    assert r.slack_onset is not None
    assert r.switched is not None
    assert r.reached > 0.97


def test_an_elastic_run_is_not_switched_and_a_tension_only_one_reports_its_onset():
    assert run(LEVEL, "following-p2", elements=8, steps=400, law="elastic").switched is None
    for method, resolution in (("following-p2", {"elements": 10}), ("fourier-kink", {"terms": 20})):
        r = run(LEVEL, method, steps=800, law="tension-only", **resolution)
        assert r.switched is None
        assert abs(r.slack_onset - 0.831) < 0.004  # a step is 0.00125


# --- start and exit ---------------------------------------------------------------------------------------------------
def displacements_at(r: Response, places) -> np.ndarray:
    return np.stack([np.interp(places, r.s_o / r.length, x) for x in (r.u, r.v)])


def test_a_light_mass_starts_right_with_graded_elements_and_steps_and_not_without():
    own = {"grading": 30.0, "entry": 0.1}
    reference = run(LIGHT, "following-p2", elements=40, steps=2400, **own)
    places = [0.02, 0.05]

    def error(**settings) -> float:
        gap = displacements_at(run(LIGHT, "following-p2", **settings), places) - displacements_at(reference, places)
        return float(np.hypot(*gap).max() / reference.max_deflection)

    assert error(elements=10, steps=600, **own) < 1e-3
    assert error(elements=10, steps=600) > 1e-3


def test_the_convergence_limit_is_where_gaps_stop_closing():
    runs = [level_run("fourier-kink", n, 40 * n) for n in (8, 16, 32)]
    limit = convergence_limit(runs)
    assert 0.80 < limit < runs[-1].reached
    # twin: noise on the finest from 0.5 on ends the answer there, to a stretch of 0.02
    finest = runs[-1]
    noise = 0.1 * finest.max_deflection * np.sin(40.0 * finest.s_o / finest.length) * (finest.s_o > 0.5 * finest.length)
    assert abs(convergence_limit([*runs[:2], replace(finest, v=finest.v + noise)]) - 0.5) <= 0.04
    with pytest.raises(ValueError, match="three runs"):
        convergence_limit(runs[:2])


# --- energy and failures ----------------------------------------------------------------------------------------------
def test_a_run_that_gains_energy_is_flagged_in_its_summary_and_a_sound_one_is_not():
    sound = level_run("following-p2", 10, 1000).summary()
    assert sound["flags"] == []
    assert sound["energy_gain"] < 0.01
    r = run(LEVEL, "fixed-p1-path", scheme="trapezoidal", law="elastic", elements=20, steps=500)
    assert r.energy_gain > 10.0 * MAX_GAIN
    assert "gains energy" in r.summary()["flags"][0]


def test_energy_gained_after_the_onset_is_flagged_apart():
    # a deep, stiff cable whips once slack: its paths do not agree between resolutions
    r = run(LEVEL.variant(sag_ratio=0.3), "following-p2")
    assert abs(r.slack_onset - 0.396) < 0.005  # four times finer: 0.3958
    assert "slack energy" in r.flag_kinds


def test_compression_of_less_than_an_element_is_flagged_and_slack_is_not():
    close = Scene.from_groups(sag_ratio=0.03882, slope=2.89, mu=0.1745, alpha=5285.0, speed_ratio=0.5754)
    r = run(close, "following-p1", elements=40, steps=1400, until=0.8)
    assert r.slack_onset is None
    assert "hidden slack" in r.flag_kinds
    # twin: a cable that is under tension all the way, and one that falls slack as a whole
    for until in (0.8, 0.9):
        assert run(LEVEL, "following-p2", elements=10, steps=500, until=until).flags == []


def test_waves_slower_than_the_mass_are_flagged():
    """Shortly before a cable falls slack they are so on any, which is no cause."""
    near = Scene.from_groups(sag_ratio=0.1353, slope=15.2, mu=0.3404, alpha=92.6, speed_ratio=0.6848)
    r = run(near, "following-p2", elements=20, steps=900, until=0.8)
    (slow,) = (x for x in r.flags if x.kind == "slow waves")
    place = slow.numbers["since"]
    assert 0.0 < slow.numbers["least"] < 0.6848**2
    k = np.searchsorted(r.s_o, place * r.length)
    speed = (r.s_o[k] - r.s_o[k - 1]) / (r.t[k] - r.t[k - 1])
    assert r.tension_min[k : k + 2].min() < near.cable.mass_per_length * speed**2
    # no bar holds from there on: neither paths nor design numbers go on
    assert View.of_scene(near).cut_to_valid_range(r).window == (0.02, pytest.approx(place, abs=1e-6))
    assert r.t[k - 1] <= measures.last_time_valid_in_all(r) <= r.t[k]
    later = replace(r, flags=[], slack_onset=place + 0.01)  # another solver's answer

    def prints_slack(counterpart):
        return "slack_onset" in {row["quantity"] for row in design_numbers(later, counterpart)}

    assert prints_slack(None)
    assert not prints_slack(SimpleNamespace(finest=r))
    # twin: a slower car on the same cable
    slower = run(near.variant(speed_ratio=0.4), "following-p2", elements=20, steps=900, until=0.8)
    assert "slow waves" not in slower.flag_kinds
    assert View.of_scene(near).cut_to_valid_range(slower).window == (0.02, min(0.8, slower.slack_onset_position_or_inf))


@pytest.mark.parametrize(
    ("scene", "method"),
    [(s, m) for s in ("level", "zipline", "tramway") for m in ("following-p2", "fourier-kink")]
    + [("level", "wavelet")],
)
def test_a_run_without_a_start_is_an_answer_too(scene, method):
    sound = METHODS[method]

    def build(*args, **kind):
        system = sound.build(*args, **kind)

        def start(phase, state):
            raise StepFailure(0.0, "no start", "try another")

        system.start = start
        return system

    r = run(Scene.load(scene), replace(sound, build=build))
    assert (r.status, r.cause) == ("incomplete", "no start")
    assert r.reached < 0.02
    assert "try another" in r.reason
    assert response_faults(r) == []


# --- catalogue --------------------------------------------------------------------------------------------------------
DEAR = (  # two seconds and more; `cablefem atlas` runs all
    "trapezoidal rule on a nonlinear cable", "constraint and average acceleration",
    "chain rule inside fixed P1 elements", "Gibbs oscillations of the tension",
    # and those that other tests see by their physics
    "Coriolis or convective terms dropped", "explicit steps too long", "slack of a deep stiff cable",
    "slack that is Gibbs",
)  # fmt: skip


@pytest.mark.parametrize(
    "row", [pytest.param(row, id=row["name"], marks=[pytest.mark.slow] * (row["name"] in DEAR)) for row in CATALOGUE]
)
def test_failure_shows_and_its_remedy_works(row):
    found = measure_failure_and_remedy(row)
    assert found["failure_shown"], found["failure"]
    assert found["remedy_works"], found["cure"]
    # the conditions can fail: each with the other's numbers, where they are numbers of the same kind
    if found["failure"].keys() == found["cure"].keys() and row["shows"] != row["cures"]:
        assert not condition_holds(row["shown"], found["cure"])
        assert not condition_holds(row["cured"], found["failure"])


# --- atlas ------------------------------------------------------------------------------------------------------------
SMALL = [{
    "name": "speed-mass", "title": "Speed and mass", "x": {"name": "V/c", "values": [0.3, 0.5]},
    "y": {"name": "mu", "values": [0.7]}, "scene": {"speed_ratio": "x", "mu": "y"},
    "methods": [["following-p2", {"elements": 3, "steps": 120}], ["fixed-p1-path", {"elements": 6, "steps": 120}]],
}]  # fmt: skip


@pytest.fixture(scope="module")
def small_atlas_folder(tmp_path_factory):
    """The folder of an atlas, at first interrupted."""
    folder = tmp_path_factory.mktemp("atlas")

    class Interrupted(Exception):
        pass

    def stop(label, fraction):
        if fraction >= 0.5:
            raise Interrupted

    with pytest.raises(Interrupted):
        atlas(folder, stop, maps=SMALL, rows=())
    first = (folder / CELLS).read_text()
    with (folder / CELLS).open("a") as file:
        file.write('\n["cut of')  # killed while writing
    atlas(folder, maps=SMALL, rows=CATALOGUE[6:7])
    return folder, first


def test_an_interrupted_atlas_goes_on_and_loses_nothing(small_atlas_folder):
    folder, first = small_atlas_folder
    assert 1 <= first.count('"speed-mass') < 4
    assert (folder / CELLS).read_text().startswith(first)
    result = json.loads((folder / "atlas.json").read_text())
    assert len(result["cells"]) == 4
    assert {cell["class"] for cell in result["cells"]} <= set(pages.CLASSES)
    assert {cell["cause"] for cell in result["cells"]} <= {None, *pages.CAUSES}


def test_a_map_tells_computed_cells_from_uncomputed_ones(small_atlas_folder, tmp_path):
    folder, _ = small_atlas_folder
    result = json.loads((folder / "atlas.json").read_text())
    found = pages.sections(folder)
    assert "4 of 4 cells" in found[1].summary
    assert (result["verdict"], found[0].verdict) == ("agree", "agree")  # the verdict comes first
    write_page("atlas", found, tmp_path / "report.html")
    result["cells"] = result["cells"][:3]
    (tmp_path / "atlas.json").write_text(json.dumps(result))
    assert "3 of 4 cells" in pages.sections(tmp_path)[1].summary
    assert "not computed" in pages.sections(tmp_path)[1].html


def test_a_remedy_that_does_not_help_makes_the_atlas_red(tmp_path):
    result = atlas(tmp_path, maps=(), rows=[CATALOGUE[6] | {"cured": "x.values()|max < 0"}])
    assert result["verdict"] == "disagree"
    assert pages.sections(tmp_path)[-1].verdict == "disagree"


def test_cells_are_judged_by_their_error_and_only_against_a_sure_reference():
    fine = level_run("following-p2", 20, 2000)
    assert judged_cell(level_run("following-p2", 10, 1000), fine, 1e-4)["class"] == "good"
    naive = judged_cell(run(LEVEL, "fixed-p1-naive", elements=20, steps=300), fine, 1e-4)
    assert (naive["class"], naive["cause"]) == ("wrong", "too coarse")
    assert judged_cell(level_run("following-p2", 10, 1000), fine, 0.03)["class"] == "not judged"
    broken = run(LEVEL, "fourier", terms=12, steps=300, scheme="central-difference")
    assert (broken.status, broken.cause, broken.switched) == ("incomplete", "unstable", None)
    assert judged_cell(broken, fine, 1e-4)["class"] == "wrong"
    assert judged_cell(broken, fine, 1e-4)["cause"] == "unstable"
    assert measures.WINDOW[1] > broken.reached


@pytest.mark.parametrize("terms", [1, 2, 3])
def test_a_ride_over_very_few_sines_has_an_answer_and_companions(terms):
    """One sine by itself has nothing to be graded by; companions of two and three have but one."""
    begin = Scene.load("zipline").replace({"drive.end": {"place": 60.0}})
    e = run_with_error_bars(begin, "fourier-kink", terms=terms, steps=300)
    assert [r.events[-1]["event"] for r in e.runs] == len(e.runs) * ["arrival"]
    assert e.finest.path_error is None or e.finest.path_error > 1e-4
