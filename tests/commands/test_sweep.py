"""A sweep: points numbered once and for all, rows written whole, and nothing lost or done twice when something dies."""

import contextlib
import gc
import itertools
import math
import os
import re
import signal
import subprocess
import sys
import time
import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from pandas import DataFrame

from cablefem import catenary_line
from cablefem.scene import Scene, SceneError
from cablefem.scene.line import Line
from cablefem.scene.moving import line_in_motion
from validation import cli, run
from validation.commands.sweep import command as sweep_command
from validation.commands.sweep import engine, job
from validation.commands.sweep.page import _split_by_axis, sections
from validation.commands.sweep.study import Study, built_in_studies
from validation.core.agreement import Agreement, Bound, Verdict
from validation.core.store import Refused

distributed = pytest.importorskip("distributed")

# Dask's own: sockets and event loops of clusters that are gone
NOISE = ("ResourceWarning", "RuntimeWarning", "DeprecationWarning", "UserWarning")
pytestmark = [pytest.mark.filterwarnings(f"ignore::{kind}") for kind in NOISE]

GRID_TOML = """
scene = "level"
method = "following-p2"
settings = {elements = 3, steps = 30}
[vary]
"mass.mass" = [1000, 2000.0, 3000]
speed_ratio = {from = 0.2, to = 0.4, count = 3}
"""
GRID = tomllib.loads(GRID_TOML)
RANGE = {"cable.sag": [50.0, 100.0], "mu": {"from": 0.05, "to": 5.0, "log": True}}
SAMPLE = {"kind": "sobol", "count": 12, "seed": 7, "range": RANGE}


def test_a_grid_has_all_combinations_once():
    study = Study.from_table(GRID)
    points = [study.point(i) for i in range(len(study))]
    assert len(study) == 9
    assert len({tuple(p.values()) for p in points}) == 9
    assert sorted({p["speed_ratio"] for p in points}) == pytest.approx([0.2, 0.3, 0.4])
    with pytest.raises(Refused, match="scenes 0 to 8"):
        study.point(9)


def test_a_sample_stays_in_its_ranges_and_is_the_same_again():
    for kind in ("sobol", "latin_hypercube", "random"):
        first, again, other = (
            Study.from_table({"scene": "level", "method": "fourier", "sample": SAMPLE | {"kind": kind, "seed": seed}})
            for seed in (7, 7, 8)
        )
        points = [first.point(i) for i in range(12)]
        assert points == [again.point(i) for i in range(12)]
        assert points != [other.point(i) for i in range(12)]
        assert all(50.0 <= p["cable.sag"] < 100.0 and 0.05 <= p["mu"] < 5.0 for p in points)
        # by the logarithm: half of the points below the geometric mean
        assert 4 <= sum(p["mu"] < 0.5 for p in points) <= 8


def test_a_point_changes_the_scene_and_nothing_else():
    study = Study.from_table(GRID | {"sample": SAMPLE, "vary": None})
    point = study.point(3)
    scene = study.scene_at(point)
    assert scene.sag == pytest.approx(point["cable.sag"], rel=1e-9)
    assert scene.mu == pytest.approx(point["mu"], rel=1e-12)
    assert pytest.approx(Study.from_table(GRID).scene_at({"mass.mass": 1000}).cable.EA) == scene.cable.EA


def test_a_study_of_groups_needs_no_base_scene():
    axes = {"sag_ratio": [0.01, 0.2], "alpha": [50, 1e4], "mu": [0.1, 1.0], "speed_ratio": [0.1, 0.8], "slope": [0, 45]}
    study = Study.from_table({"method": "following-p2", "tol": 1e-2, "sample": {"count": 3, "range": axes}})
    for i in range(3):
        point, scene = study.point(i), study.scene_at(study.point(i))
        assert scene.slope == pytest.approx(point["slope"], abs=1e-9)
        assert (scene.mu, scene.alpha) == pytest.approx((point["mu"], point["alpha"]), rel=1e-9)


def test_a_study_reads_back_without_the_file_of_its_scene_and_points_keep_their_numbers(tmp_path):
    (tmp_path / "own.toml").write_text(Scene.library_text("inclined"), encoding="utf-8")
    (tmp_path / "asked.toml").write_text(GRID_TOML.replace("level", "own.toml"), encoding="utf-8")
    file = Study.load(tmp_path / "asked.toml")
    assert file.name == "asked"
    axes = {"mu": {"from": 0.1, "to": 1.0, "log": True}, "slope": [0, 45], "travel": {"choices": ["constant_speed"]}}
    grid = {"mu": {"from": 0.1, "to": 1.0, "count": 3}, "slope": [0, 20, 45], "sag_ratio": {"choices": [0.1, 0.2]}}
    others = {"alpha": {"choices": [500]}, "speed_ratio": {"choices": [0.3]}}
    axes |= others | {"sag_ratio": [0.1, 0.2]}
    grid |= others
    how = {"method": "following-p2", "tol": 1e-2}
    for asked in (
        Study.from_table(how | {"sample": {"count": 4, "range": axes}}),
        Study.from_table(how | {"vary": grid}),
        file,
    ):
        kept = Study.from_table(tomllib.loads(asked.to_toml()))
        assert (kept.scene, kept.method, kept.settings) == (asked.scene, asked.method, asked.settings)
        assert [kept.point(i) for i in range(len(kept))] == [asked.point(i) for i in range(len(asked))]
        assert kept.to_toml() == asked.to_toml()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"jobb": "run"}, "jobb = 'run': unknown key. Did you mean job?"),
        ({"job": "walk"}, "job = 'walk': unknown."),
        ({"method": "following-p3"}, "Did you mean following-p"),
        ({"method": None}, "tol: missing"),
        ({"tol": 2.0}, "tol = 2.0: must be a number from 1e-06 to 0.2"),
        ({"scene": "levle"}, "Did you mean level?"),
        ({"vary": {"mass.weight.of": []}}, "vary.mass.weight.of = []"),
        ({"vary": {"moss.mass": [1.0]}}, "moss.mass: must be a key of the scene"),
        ({"vary": {"mu": {"from": 2.0, "to": 1.0, "count": 3}}}, "vary.mu.to = 1: must be > 2, where the range begins"),
        ({"vary": {"mu": {"from": -2.0, "to": 1.0, "count": 3, "log": True}}}, "mu.from = -2: must be > 0 with log"),
        ({"vary": {"mu": {"from": 2.0, "to": 3.0, "count": 1}}}, "vary.mu.count = 1: must be a whole number from 2"),
        ({"vary": {"mu": {"from": 2.0, "count": 2}}}, "vary.mu.to: missing; must be a number"),
        ({"vary": {}}, "vary = {}: must be a table of at least one axis"),
        ({"vary": None, "sample": {"range": {"mu": [0.1, 1.0]}}}, "sample.count: missing; must be a whole number"),
        ({"vary": None, "sample": SAMPLE | {"kind": "sobl"}}, "sample.kind = 'sobl': unknown. Did you mean sobol?"),
        ({"truth": {"every": 10}}, "truth.finer: missing; must be a whole number from 1 to 1000"),
        ({"truth": True}, "truth = True: must be a table [truth]"),
        ({"vary": {"travel.top_speed": [1.0]}}, "travel.top_speed = 1.0: unknown key."),
        ({"sample": SAMPLE}, "exactly one of"),
        ({"seconds": -1}, "seconds = -1: must be"),
        ({"job": "power", "tol": 1e-3}, "case: missing; job 'power' needs it"),
        ({"settings": {"elemets": 3}}, "settings.elemets: unknown key. Did you mean elements?"),
        ({"method": None, "vary": {"method": ["fourier", "wavelt"]}}, "method = 'wavelt': unknown. Did you mean wavel"),
        ({"method": "fourier"}, "settings.elements: unknown key."),
        ({"job": "power", "settings": {"families": "wied"}}, "settings.families = 'wied': unknown. Did you mean wide?"),
        ({"scene": None}, "sag_ratio: missing; without a base scene, sag_ratio, mu, alpha, speed_ratio must be axes"),
        ({"scene": "bare", "vary": {"cable.sag": [50.0]}}, "scene bare has no [mass] and [travel]"),
        ({"settings": {"elements": -3}}, "settings.elements must lie in [1, 100000], got -3"),
        ({"tol": 1e-2}, "settings.elements: tol chooses it; leave one of them out"),
        ({"job": "check", "tol": 1e-2}, "method: job 'check' does not take it"),
        ({"vary": {"mass.mass": [1.0], "mu": [0.5]}}, "mass.mass: mu sets it, too; leave one of them out"),
        ({"vary": {"model": ["strng"]}}, "model = 'strng': unknown. Did you mean string?"),
        ({"vary": {"mass": [1.0]}}, "mass: must be a key of the scene with its dot"),
        ({"vary": {"model": ["quasi-static"]}}, "model = 'quasi-static': unknown."),
        ({"settings": {}, "vary": {"tol": [1e-2, 5]}}, "tol must lie in [1e-06, 0.2], got 5"),
        ({"vary": None, "sample": SAMPLE | {"range": {"mu": [1, 2, 3]}}}, "mu = [1, 2, 3]: must be [low, high]"),
    ],
)
def test_a_faulty_study_says_what_is_wrong(change, said):
    with pytest.raises(Refused, match=r".") as refused:
        Study.from_table({k: v for k, v in (GRID | change).items() if v is not None})
    assert said in str(refused.value)


def test_stiffness_over_tension_and_the_modulus_of_wires_are_two_axes():
    """The section follows: each is refused beside what both give."""
    rope = Scene.load("tramway").replace({"cable.E": 1.6e11, "cable.section": 1e-3, "cable.EA": 1.6e8})
    axes = {"alpha": [300.0, 600.0], "cable.E": [1.2e11, 1.6e11]}
    study = Study.from_table({"scene": tomllib.loads(rope.to_toml()), "method": "following-p2", "vary": axes})
    scenes = [study.scene_at(study.point(i)) for i in range(4)]
    assert [(round(scene.alpha), scene.cable.E) for scene in scenes] == list(itertools.product(*axes.values()))
    with pytest.raises(Refused, match=r"cable\.section: alpha sets it, too"):
        Study.from_table({"method": "following-p2", "scene": "tramway", "vary": axes | {"cable.section": [1e-3]}})


def test_a_study_of_planted_faults_takes_cases_alone():
    power = {"job": "power", "tol": 1e-3}
    for axes, said in (
        ({"case": [0.5]}, "case = 0.5: must be a whole number"),
        ({"case": [1], "mass.mass": [60.0]}, "mass.mass: job 'power' draws its scenes by case"),
    ):
        with pytest.raises(Refused, match=said):
            Study.from_table(power | {"vary": axes})


def test_keys_of_a_scene_need_no_quotes():
    """[vary] mass.mass = [...] is a table within a table in TOML."""
    dotted = tomllib.loads("vary.mass.mass = [60, 80]\nvary.drive.brake.0.force = {from = 1.0, to = 2.0, count = 2}")
    study = Study.from_table({"scene": "zipline", "method": "following-p2"} | dotted)
    assert study.point(1) == {"mass.mass": 60, "drive.brake.0.force": 2.0}


def test_what_has_no_meaning_in_a_drive_gives_way():
    study = Study.load("reliability")
    driven = [study.scene_at(study.point(3) | {"drive.mode": mode}).drive for mode in ("grip", "haul", "free")]
    assert [drive.mode for drive in driven] == ["grip", "haul", "free"]
    assert driven[0].rolling_friction == 0.0
    assert driven[1].end is not None


def test_the_studies_that_come_along_are_sound():
    for name in built_in_studies():
        study = Study.load(name)
        assert study.title
        for index in range(0, len(study), max(1, len(study) // 7)):
            with contextlib.suppress(SceneError):  # a hostile scene may be refused
                scene = study.scene_at(study.point(index))
                assert scene.car if isinstance(scene, Line) else scene.mass is not None


# --- rows -------------------------------------------------------------------------------------------------------------


def test_a_row_holds_the_run(tmp_path):
    study = Study.from_table(GRID)
    row = job.row_of_point_or_failure(study, 4, study.point(4))
    assert (row["status"], row["method"], row["index"]) == ("complete", "following-p2", 4)
    assert row["mass.mass"] == 2000.0
    assert row["max_deflection"] > 1.0
    assert math.isfinite(row["mu"])
    engine.write_parquet_rows(tmp_path, study, [row])
    stored = engine.read_rows(tmp_path).loc[4]
    assert stored["max_deflection"] == row["max_deflection"]


def test_a_row_holds_all_design_numbers_and_the_clearance_of_the_nearest_obstacle(tmp_path):
    """A study of riders over trees told neither clearance nor safety factor."""
    trees = {"obstacle": [{"name": "oak", "at": 40.0, "top": 30.0}, {"name": "fir", "at": 20.0, "top": 12.0}]}
    scene = Scene.load("zipline").replace({"cable.breaking_load": 90e3, "drive.end.place": 50.0} | trees)
    study = Study.from_table(
        {"scene": scene, "method": "following-p2", "settings": {"steps": 100}, "vary": {"mass.mass": [70.0, 90.0]}}
    )
    rows = [job.row_of_point_or_failure(study, i, study.point(i)) for i in range(2)]
    engine.write_parquet_rows(tmp_path, study, rows)
    (tmp_path / "study.toml").write_text(study.to_toml(), encoding="utf-8")
    stored = engine.read_rows(tmp_path).loc[0]
    assert stored["safety_factor_min"] == pytest.approx(90e3 / stored["tension_max"], rel=1e-12)
    assert stored["safety_factor_min_bar"] > 0.0
    s_o = np.linspace(0.0, 40.0, 2001)
    over_fir = 12.0 - np.interp(20.0, scene.catenary.x(s_o), scene.catenary.y(s_o))
    assert 0.0 < over_fir - stored["clearance_rope_min"] < 2.0  # the car presses the rope down
    assert stored["clearance_car_min"] <= stored["clearance_rope_min"]


def test_a_row_of_a_car_that_grips_holds_the_clearance_at_the_far_support():
    """Runs ended at 0.95 of the length: of two masts the nearer one was told, with the larger clearance."""
    masts = {"obstacle": [{"name": "near", "at": 900.0, "top": 300.0}, {"name": "far", "at": 1960.0, "top": 90.0}]}
    scene = Scene.load("level").replace(masts)
    study = Study.from_table(
        {
            "scene": scene,
            "method": "following-p2",
            "settings": {"elements": 4, "steps": 200},
            "vary": {"mu": [0.2, 0.3]},
        }
    )
    row = job.row_of_point_or_failure(study, 0, study.point(0))
    s_o = np.linspace(0.0, scene.length, 2001)
    over_far = 90.0 - np.interp(1960.0, scene.catenary.x(s_o), scene.catenary.y(s_o))
    assert row["clearance_car_min"] < over_far


def test_an_axis_takes_numbers_words_and_tables_side_by_side(tmp_path):
    """A percentage or a table beside a number broke the sweep after its scenes were computed."""
    axes = {"mass.mass": [1000, "+10%"], "cable.damping": [0.0, 0.1], "travel.kind": ["constant_speed"]}
    brakes = {"drive.brake": [[], [{"from": 280.0, "force": 600.0}]]}
    study = Study.from_table(GRID | {"vary": axes | brakes})
    rows = [{"index": i, **study.point(i), "status": "complete"} for i in range(len(study))]
    engine.write_parquet_rows(tmp_path, study, rows)
    stored = engine.read_rows(tmp_path)
    assert list(stored["mass.mass"].unique()) == ["1000", "+10%"]
    assert list(stored["drive.brake"].unique()) == ["[]", '[{"from": 280.0, "force": 600.0}]']
    assert list(stored["cable.damping"].unique()) == [0.0, 0.1]
    assert set(stored["travel.kind"]) == {"constant_speed"}


def test_rows_of_a_version_with_fewer_results_are_read_beside_ours(tmp_path, monkeypatch):
    """A sweep begun before an upgrade broke at its end."""
    study = study_of_count(2)
    rows = [{"index": i, **study.point(i), "status": "complete", "speed_max": 3.0} for i in range(2)]
    with monkeypatch.context() as before:
        before.setattr(job, "DESIGN", ["tension_max"])
        engine.write_parquet_rows(tmp_path, study, rows[:1])
    for _ in range(2):
        stored = engine.read_rows(tmp_path)
        assert stored["speed_max"].tolist() == pytest.approx([math.nan, 3.0][: len(stored)], nan_ok=True)
        engine.write_parquet_rows(tmp_path, study, rows[1:])


def test_a_damaged_file_of_rows_is_named_and_other_files_beside_rows_are_left_alone(tmp_path):
    folder = tmp_path / "mu=3"  # as others name parts of Parquet
    study = study_of_count(2)
    for i in range(2):
        engine.write_parquet_rows(folder, study, [{"index": i, **study.point(i), "status": "complete"}])
    (folder / "rows" / "notes.txt").write_text("mine")
    assert engine.read_rows(folder)["mu"].tolist() == [study.point(i)["mu"] for i in range(2)]
    (folder / "rows" / "00000001-1.parquet").write_bytes(b"")
    with pytest.raises(Refused, match=r"rows/00000001-1\.parquet: damaged.* delete it, and the same command"):
        engine.finished_indices(folder)


def test_whatever_happens_to_a_scene_is_a_row(monkeypatch):
    refused = Study.from_table(GRID | {"vary": {"cable.EA": [1.0, 2.0]}})
    assert job.row_of_point_or_failure(refused, 0, refused.point(0))["status"] == "refused"
    assert "cable.EA" in job.row_of_point_or_failure(refused, 0, refused.point(0))["reason"]
    monkeypatch.setattr(job, "_run_row", lambda *given: 1 / 0)
    failed = job.row_of_point_or_failure(Study.from_table(GRID), 1, {})
    assert (failed["status"], failed["cause"]) == ("failed", "ZeroDivisionError")


def test_a_check_tells_why_a_run_broke_and_beside_it_which_rows_do_not_agree(tmp_path, monkeypatch):
    told = run(Scene.load("level"), "following-p2", elements=3, steps=30)
    broken = replace(told, status="incomplete", cause="Newton stalled", reason="stalled")
    rows = [Agreement(name, 1.0, Bound("law"), law=law) for name, law in (("tension", ""), ("tension", "mean"))]
    either = SimpleNamespace(finest=broken)
    found = SimpleNamespace(a=either, b=either, rows=rows, verdict=Verdict.DISAGREE)
    monkeypatch.setattr("validation.check", lambda *given, **how: found)
    study = Study.from_table(
        {k: x for k, x in GRID.items() if k not in ("method", "settings")} | {"job": "check", "tol": 1e-2}
    )
    row = job.row_of_point_or_failure(study, 4, study.point(4))
    assert (row["status"], row["cause"], row["not_agreed"]) == ("incomplete", "Newton stalled", "tension")
    engine.write_parquet_rows(tmp_path, study, [row])
    (tmp_path / "study.toml").write_text(study.to_toml(), encoding="utf-8")
    outcome = sections(tmp_path)[0].html
    assert "Newton stalled" in outcome
    assert "tension" not in outcome


def test_the_page_says_why_scenes_have_no_answer(tmp_path):
    """They were counted as complete in neither way, and their reason was in the rows alone."""
    study = Study.from_table(GRID | {"vary": {"cable.EA": [1.0, 2.0]}})
    engine.write_parquet_rows(
        tmp_path, study, [job.row_of_point_or_failure(study, i, study.point(i)) for i in range(2)]
    )
    (tmp_path / "study.toml").write_text(study.to_toml(), encoding="utf-8")
    outcome = sections(tmp_path)[0]
    assert outcome.summary == "2 of 2 scenes, 0 complete, 2 refused, 0 without an answer"
    assert "cable.EA" in outcome.html


def test_the_page_says_what_is_hit_on_the_way_and_what_does_not_agree(tmp_path):
    """A rider through a tree was a dot "stopped in the brake", and scenes that disagree had to be looked up in rows."""
    study = study_of_count(2)
    end = {"outcome_kind": "arrives", "outcome": "arrives at 90 m", "speed_max": 9.0}
    hit = end | {"outcome": "would hit fir; arrives at 90 m", "verdict": "disagree", "not_agreed": "tension"}
    rows = [job.row_of_point_or_failure(study, i, study.point(i)) | x for i, x in enumerate((end, hit))]
    engine.write_parquet_rows(tmp_path, study, rows)
    (tmp_path / "study.toml").write_text(study.to_toml(), encoding="utf-8")
    scenes = sections(tmp_path)[-1].html
    assert '"values": ["arrived", "would hit; arrived"]' in scenes
    assert '"values": [null, "tension"]' in scenes


def test_the_page_of_planted_faults_counts_verdicts_by_fault(tmp_path, monkeypatch):
    monkeypatch.setattr(job, "_check_row", lambda *given: {"status": "complete", "verdict": "disagree"})
    study = Study.load("power")
    engine.write_parquet_rows(tmp_path, study, [job.row_of_point_or_failure(study, i, study.point(i)) for i in (0, 60)])
    (tmp_path / "study.toml").write_text(study.to_toml(), encoding="utf-8")
    assert set(engine.read_rows(tmp_path)["fault"]) == {"none", "mass.mass +1 %"}
    assert "mass.mass +1 %" in sections(tmp_path)[0].html


def test_a_third_axis_of_small_values_is_cut_into_parts_by_values_of_its_scenes():
    """A map was headed 0.00418 to 0.0245 where no scene has less than 0.005."""
    friction = np.linspace(0.005, 0.065, 24)
    parts = _split_by_axis(DataFrame({"drive.rolling_friction": friction}), "drive.rolling_friction")
    assert [title for title, _ in parts] == ["0.00500 to 0.0233", "0.0259 to 0.0441", "0.0467 to 0.0650"]
    assert sum(len(part) for _, part in parts) == 24


def test_a_scene_of_a_folder_with_a_blank_has_a_command_that_can_be_given(tmp_path):
    folder = tmp_path / "two words"
    study = study_of_count(1)
    engine.write_parquet_rows(folder, study, [job.row_of_point_or_failure(study, 0, study.point(0))])
    (folder / "study.toml").write_text(study.to_toml(), encoding="utf-8")
    assert f'"study": "\'{folder}/study.toml\'"' in sections(folder)[-1].html


def test_a_method_that_cannot_roll_is_a_row():
    study = Study.from_table({"scene": "zipline", "method": "fixed-hermite", "vary": {"mass.mass": [80.0]}})
    row = job.row_of_point_or_failure(study, 0, study.point(0))
    assert (row["status"], row["cause"]) == ("refused", "method")


@pytest.mark.parametrize("asked", [{"job": "run"}, {"job": "advise"}])
def test_rides_with_a_tolerance_and_no_method_are_run_by_one_that_can_ride(asked):
    study = Study.from_table(
        {"scene": "zipline", "tol": 0.2, "vary": {"mass.mass": [80.0], "drive.end.place": [60.0]}} | asked
    )
    row = job.row_of_point_or_failure(study, 0, study.point(0))
    assert (row["status"], row.get("cause")) == ("complete", None)
    assert row["path_error"] <= 0.2


def test_a_scene_that_hangs_is_cut_off(monkeypatch):
    def endless(*given):
        while True:
            time.sleep(0.01)

    monkeypatch.setattr(job, "_run_row", endless)
    monkeypatch.setattr(job, "FRESH", 0.0)
    study = Study.from_table(GRID | {"seconds": 0.3})
    row = job.row_of_point_or_failure(study, 2, study.point(2))
    assert (row["status"], row["cause"]) == ("cut off", "time")
    assert 0.3 <= row["seconds"] < 30.0


# --- the engine -------------------------------------------------------------------------------------------------------


def rows_or_dying_worker(study, number_unknowns):
    """Rows of a job of no work; with a path as the study's title scene 2 kills its worker once, scene 7 always."""
    rows = []
    for i, point in number_unknowns:
        if study.title and (i == 7 or (i == 2 and not Path(study.title).exists())):
            Path(study.title).touch()
            os._exit(3)
        rows.append({"index": i, **point, "status": "complete", "seconds": 1e-3, "reached": 0.5 * i})
    return rows


def study_of_count(count, title=""):
    sample = {"count": count, "range": {"mu": [0.1, 1.0]}}
    return Study.from_table({"scene": "level", "method": "fourier", "sample": sample, "title": title})


@pytest.fixture(scope="module")
def dask_cluster():
    import dask

    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        distributed.LocalCluster(1, threads_per_worker=1, dashboard_address=None, silence_logs=50) as cluster,
    ):
        yield {"scheduler": cluster.scheduler_address, "work": rows_or_dying_worker}


def test_a_sweep_goes_on_where_it_stopped_and_does_nothing_twice(tmp_path, dask_cluster):
    study, seen = study_of_count(60), []

    def interrupted(label, done, note):
        if done >= 10 / 60:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        engine.sweep(study, tmp_path, progress=interrupted, **dask_cluster)
    before = engine.finished_indices(tmp_path)
    assert 10 <= len(before) < 60
    tally = engine.sweep(study, tmp_path, progress=lambda label, done, note: seen.append(done), **dask_cluster)
    assert tally.status.total() == 60 - len(before)
    rows = engine.read_rows(tmp_path)
    assert rows.index.tolist() == list(range(60))
    np.testing.assert_array_equal(rows["mu"], [study.point(i)["mu"] for i in range(60)])
    again = engine.sweep(study, tmp_path, **dask_cluster)
    assert (again.status.total(), again.done) == (0, 60)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # what is lost would be one
def test_an_interrupt_while_memory_is_collected_is_not_lost(tmp_path, dask_cluster):
    """Python ignores what is raised then; Dask has a callback there."""

    def interrupt(phase, info):
        signal.raise_signal(signal.SIGINT)

    def collect(label, done, note):
        if 0.0 < done < 1.0 and interrupt not in gc.callbacks:
            gc.callbacks.append(interrupt)
            try:
                gc.collect()
            finally:
                gc.callbacks.remove(interrupt)

    with pytest.raises(KeyboardInterrupt, match="scenes are stored"):
        engine.sweep(study_of_count(60), tmp_path, progress=collect, **dask_cluster)
    assert engine.sweep(study_of_count(60), tmp_path, **dask_cluster).done == 60


@pytest.mark.parametrize("there", ["study.toml", pytest.param("rows/*.parquet", marks=pytest.mark.slow)])
def test_an_interrupt_ends_a_sweep_at_once_while_workers_start_and_while_they_compute(tmp_path, there):
    """The terminal sends Ctrl-C to the workers, too."""
    arguments = [sys.executable, "-m", "validation.cli", "sweep", "throughput", "--workers", "1", "--out", tmp_path]
    here = Path(cli.__file__).parents[1]
    with subprocess.Popen(arguments, cwd=here, stderr=subprocess.PIPE, text=True, start_new_session=True) as sweep:
        while not any(tmp_path.glob(there)):
            time.sleep(0.05)
        time.sleep(1.0)
        os.killpg(sweep.pid, signal.SIGINT)
        _, said = sweep.communicate(timeout=30.0)
    assert sweep.returncode == 130
    assert re.fullmatch(rf"cablefem: interrupted; \d+ of 1000 scenes are stored in {tmp_path}; .*\n", said)


def test_a_changed_study_in_a_used_folder_is_refused(tmp_path, dask_cluster):
    engine.sweep(study_of_count(2), tmp_path, **dask_cluster)
    with pytest.raises(Refused, match=r"another study \(other: sample\); nothing was written"):
        engine.sweep(study_of_count(3), tmp_path, **dask_cluster)


def test_scenes_of_a_worker_that_dies_are_tried_again_one_by_one_and_one_that_always_kills_is_a_row(
    tmp_path, dask_cluster
):
    tally = engine.sweep(study_of_count(8, str(tmp_path / "died")), tmp_path / "out", **dask_cluster)
    assert (tmp_path / "died").exists()
    assert dict(tally.status) == {"complete": 7, "died": 1}
    row = engine.read_rows(tmp_path / "out").loc[7]
    assert row["status"] == "died"
    assert "died" in row["reason"]


@pytest.mark.slow  # the README's study in .ci/commands starts workers, too
def test_a_cluster_of_its_own_and_the_page(tmp_path):
    engine.sweep(Study.from_table(GRID), tmp_path, workers=1)
    (tmp_path / "study.toml").write_text(GRID_TOML, encoding="utf-8")
    first, maps, scenes = sections(tmp_path)
    assert "9 of 9 scenes" in first.summary
    assert "Largest deflection of the car over mass.mass and speed_ratio" in maps.html
    assert f'"study": "{tmp_path}/study.toml"' in scenes.html


def test_a_scheduler_that_is_not_there_is_said(tmp_path, monkeypatch):
    client = distributed.Client
    monkeypatch.setattr(distributed, "Client", lambda address, timeout: client(address, timeout="0.2s"))
    with pytest.raises(Refused, match=r"--scheduler tcp://127\.0\.0\.1:9"):
        engine.sweep(study_of_count(2), tmp_path, scheduler="tcp://127.0.0.1:9", work=rows_or_dying_worker)


def test_the_command_line_lists_studies_and_prints_scenes(capsys, tmp_path):
    assert cli.main(["sweep"]) == 0
    assert "throughput" in capsys.readouterr().out
    assert cli.main(["sweep", "throughput", "--scene", "3"]) == 0
    printed = capsys.readouterr().out
    assert Scene.from_toml(printed).mu > 0.0
    assert cli.main(["sweep", "thruoghput"]) == 2
    assert "Did you mean throughput?" in capsys.readouterr().err
    (tmp_path / "study.toml").touch()
    assert cli.main(["sweep", "throughput", "--out", str(tmp_path)]) == 2
    assert "holds study.toml" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("study", "index", "command"),
    [
        ("throughput", 3, "run SCENE.toml --method following-p2 --tol 0.01"),
        ("power", 60, "check SCENE.toml --tol 0.001 --second-set mass.mass=+1%"),
        ("reliability", 0, "run SCENE.toml --method following-p4 --set elements=8 --set steps=120"),
    ],
)
def test_a_printed_scene_says_the_command_that_answers_it(cablefem, study, index, command):
    """The planted fault and the settings were left out: what the row holds could not be found again."""
    code, out, _ = cablefem("sweep", study, "--scene", str(index))
    assert code == 0
    assert out.splitlines()[0] == f"# scene {index} of {study}: cablefem {command}"


@pytest.mark.parametrize(
    ("rows", "checked", "code", "said"),
    [
        ([("complete", "agree", None)], True, 0, "1 agree"),
        ([("complete", "agree", None), ("complete", "disagree", None)], True, 1, "1 agree, 1 disagree"),
        ([("complete", "agree", "none"), ("complete", "disagree", "EA +1 %")], True, 0, "planted fault: 1 disagree"),
        ([("complete", "disagree", "none")], True, 1, "1 disagree"),
        ([("complete", "too coarse", None)], False, 0, "1 too coarse"),
        ([("refused", None, None)], False, 2, "scene 0, refused: mass.mass = -1"),
        ([("complete", None, None), ("refused", None, None)], False, 0, "1 complete, 1 refused"),
        ([("failed", None, None)], False, 1, "scene 0, failed: mass.mass = -1"),
    ],
)
def test_a_sweep_says_its_verdicts_and_ends_with_them(capsys, rows, checked, code, said):
    """A study whose solvers disagreed, or whose scenes were all refused, ended with 0."""
    table = DataFrame(rows, columns=["status", "verdict", "fault"]).assign(reason="mass.mass = -1")
    assert sweep_command._print_outcomes(table, checked=checked) == code
    assert said in capsys.readouterr().out


def test_every_key_of_a_study_is_printed_with_a_meaning(cablefem):
    from validation.commands.sweep.study import FREE, GROUPS, Sample, Study, Truth

    code, out, _ = cablefem("sweep", "--keys")
    assert code == 0
    printed = {line.split()[0] for line in out.splitlines() if line}
    parts = {"": Study, "sample.": Sample, "truth.": Truth}
    fields = {f"{before}{name}" for before, part in parts.items() for name in part.model_fields}
    assert printed >= (fields - {"sample", "truth"}) | {*GROUPS, *FREE}


def test_lines_of_the_study_move_and_take_their_fault():
    """Every case is a line that the solvers accept; a fault changes one number by a percent."""
    study = Study.load("power-lines")
    keys = set()
    for number in (0, 1, 2, 3, 60, 61, 62, 63, 64, 65, 69):
        line, key = study.scene_and_fault_key({"case": number})
        assert line_in_motion(line, catenary_line.solve).cars_on_rope
        assert (key is None) is (number < 60)
        if key is not None:
            keys.add(key.split(".")[-1])
            assert line.replace({key: "+1%"}) != line
    assert keys >= {"mass", "EA", "mass_per_length", "top_speed"}
