"""The pytest plugin: its fixtures judge, its summary tells, and its loading costs nothing."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytest_plugins = ["pytester"]

# Blocked and loaded by name, so that it is the same with and without this package being installed.
PLUGIN = ("-p", "no:cablefem", "-p", "cablefem.pytest_plugin")

TESTS = """
import numpy as np
import pytest
from validation.core.foreign import ForeignPath
from validation.core.running import run


def solver(scene):
    r = run(scene, "following-p2", elements=6, steps=200)
    return r.s_o, r.v, r.u


def wrong(scene):
    s_o, v, u = solver(scene)
    return s_o, 1.1 * v, u


@pytest.fixture(scope="module")
def ours(cable_scene):
    return run(cable_scene("level"), "following-p2", elements=8, steps=300)


def test_right(cable_scene, assert_agree, ours):
    level = cable_scene("level")
    assert_agree(ForeignPath.of(level, *solver(level), name="right"), ours, path=1e-2)


def test_wrong(cable_scene, assert_agree, ours):
    level = cable_scene("level")
    assert_agree(ForeignPath.of(level, *wrong(level), name="wrong"), ours, path=1e-2)


def test_checked(cable_check):
    assert cable_check("level", solver, tol=0.1, with_tol=2e-2).verdict.value == "agree"


def test_checked_wrong(cable_check):
    cable_check("level", wrong, tol=0.1, with_tol=2e-2)


def nan(scene):
    s_o, v, u = solver(scene)
    return s_o, v * np.nan, u


def test_refused(cable_check):
    cable_check("level", nan, tol=0.1, with_tol=2e-2)


def test_unknown_scene(cable_scene, cable_check):
    with pytest.raises(ValueError):
        cable_scene("levl")
    cable_check("levl")


def test_with_tolerance(cable_check):
    cable_check("level", solver, with_tol=-1.0)  # refused before a check is computed


def test_bound(assert_agree, ours):
    assert_agree(ours, ours, path=-1.0)


def test_other_scene(cable_scene, assert_agree, ours):
    assert_agree(run(cable_scene("level").replace({"mass.mass": 1.0}), "following-p2", elements=8, steps=300), ours)


def test_line_and_span(assert_agree, ours):
    from cablefem.scene.line import Line
    from validation.commands.run.line import answer_line

    assert_agree(answer_line(Line.load("skyline")), ours)


def test_tolerance(cable_check):
    cable_check("level", tol=7.0)


def test_solver_on_a_line(cable_check):
    cable_check("over-tower", solver)  # refused before the line is computed


def test_ours_alone(cable_check):
    assert cable_check("level", tol=0.1).verdict.value == "agree"
"""


@pytest.fixture
def plugin_outcome(pytester):
    pytester.makepyfile(TESTS)
    pytester.makeini("[pytest]\nfilterwarnings = error")
    return pytester.runpytest(*PLUGIN)


def test_fixtures_pass_the_right_and_fail_the_wrong_and_the_summary_tells_all(plugin_outcome):
    plugin_outcome.assert_outcomes(passed=3, failed=10)
    plugin_outcome.stdout.fnmatch_lines([
        "*wrong and following-p2 disagree",
        "*path_max: gap 0.*, allowed 0.01, largest at s_o/l = 0.*; asked for: path 0.01*",
        "*level: disagree",
        "*path_max: gap 0.*, allowed 0.0*(its error bar) + allowed to wrong 0.02; of u and v; agrees if its v is*0.9*",
        "*= agreement of cable solvers =*",
    ])  # fmt: skip
    for said in (
        "scene = 'levl': no built-in",
        "tol must lie in",
        "path must lie in [0, 1], got -1.0",
        "with_tol must lie in [0, 1], got -1.0",
        "disagree, they answer different scenes",
        "a solver of your own is compared on one span",
    ):
        assert said in plugin_outcome.stdout.str()
    for file in ("assertions.py", "foreign.py", "study.py", "testing.py", "described.py", "agreement.py"):
        assert file not in plugin_outcome.stdout.str(), "frames of the library are hidden"
    assert "nan: v[0] is not a finite number" in plugin_outcome.stdout.str()
    printed = plugin_outcome.stdout.str().partition("= agreement of cable solvers =")[2].splitlines()
    lines = {line.rpartition("::")[2].rstrip(")"): line for line in printed if "::" in line and " (" in line}
    assert lines["test_right"].startswith("agree          right and following-p2: path_max ")
    assert lines["test_wrong"].startswith("disagree       wrong and following-p2: path_max: gap 0.")
    assert lines["test_other_scene"].startswith("disagree ")
    assert lines["test_other_scene"].count(";") == 0  # gap, what is allowed and where
    assert lines["test_line_and_span"].startswith("not comparable ")
    assert lines["test_checked"].startswith("agree          level, solver: ")
    # allowed to the user's solver, beside our bar: not what was asked of ours
    assert re.search(r" of 0\.0[23]\d* allowed", lines["test_checked"])
    assert lines["test_checked_wrong"].startswith("disagree       level, wrong: path_")
    assert lines["test_ours_alone"].startswith("agree          level, following-p2 and fourier-kink: ")


def test_a_session_without_agreement_checks_says_nothing(pytester):
    pytester.makepyfile("def test_nothing(): pass")
    outcome = pytester.runpytest(*PLUGIN)
    outcome.assert_outcomes(passed=1)
    assert "agreement of cable solvers" not in outcome.stdout.str()


@pytest.mark.slow  # builds and installs the wheel
def test_a_project_with_a_package_called_validation_is_left_alone(tmp_path):
    root = Path(__file__).parents[2]
    wheels, venv, project = (tmp_path / name for name in ("wheels", "venv", "project"))
    subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", wheels, root], check=True, cwd=tmp_path
    )
    subprocess.run([sys.executable, "-m", "venv", venv], check=True)
    python = venv / "bin" / "python"
    (site,) = (venv / "lib").glob("python*/site-packages")
    (site / "theirs.pth").write_text("\n".join(path for path in sys.path if path.endswith("site-packages")))
    (wheel,) = wheels.glob("*.whl")
    subprocess.run([python, "-m", "pip", "install", "-q", "--no-deps", wheel], check=True)
    (project / "validation").mkdir(parents=True)
    (project / "validation" / "__init__.py").write_text("LIMIT = 3\n")
    (project / "test_own.py").write_text(
        "import validation\n\n\ndef test_own():\n    assert validation.LIMIT == 3\n\n\n"
        "def test_scene(cable_scene):\n    assert cable_scene('level').mass\n\n\n"
        "def test_hidden(cable_check):\n    pass\n"
    )
    env = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    ran = subprocess.run(
        [python, "-m", "pytest", "-p", "no:cacheprovider"], cwd=project, env=env, capture_output=True, text=True
    )
    assert "plugins: cablefem" in ran.stdout or "cablefem-" in ran.stdout
    assert "2 passed, 1 error" in ran.stdout
    assert "hides cablefem's own" in ran.stdout
