"""What Python offers says its name, and refuses what the command refuses."""

import inspect
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import cablefem as cf

QUICK = {"elements": 4, "steps": 100, "bars": False}


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"tol": 1e-2, "elements": 8}, "elements and tol exclude each other"),
        ({"tol": 0.0}, r"tol must lie in \[1e-06, 0.2\], got 0"),
        ({"tol": 0.5}, r"tol must lie in \[1e-06, 0.2\], got 0.5"),
        ({"tol": float("nan")}, "tol must lie in"),
        ({"tol": "small"}, "tol must lie in .*, got 'small'"),
        ({"steps": 40.5}, "steps must be an integer, got 40.5"),
        ({"steps": np.float32(40.5)}, "steps must be an integer"),
        ({"until": "end"}, "until must be a place s_o/l > 0, got 'end'"),
        ({"elemnts": 8}, "has no setting 'elemnts'. Did you mean elements?"),
        ({"budget": 3.0, "tol": 1e-2}, "has no setting 'budget'"),
        ({"model": "ful"}, "model = 'ful': unknown. Did you mean full?"),
    ],
)
def test_run_refuses_what_the_command_refuses(settings, said):
    with pytest.raises(ValueError, match=said):
        cf.run("level", **settings)


@pytest.mark.parametrize(
    "settings",
    [
        {"tol": 0.0},
        {"tol": 0.5},
        {"tol": float("nan")},
        {"tol": "small"},
        {"tol": None},
        {"tol_tension": 0.0},
        {"tol_tension": 2.0},
    ],
)
def test_check_refuses_what_the_command_refuses(settings):
    with pytest.raises(ValueError, match="must lie in"):
        cf.check("level", **settings)


@pytest.mark.parametrize("function", [cf.run, cf.check, cf.quasi_static])
def test_what_is_no_scene_is_refused(function):
    with pytest.raises(TypeError, match="scene must be a Scene, its name or its file, got None"):
        function(None)


def test_changes_that_map_no_keys_are_refused():
    scene = cf.Scene.load("level")
    with pytest.raises(TypeError, match="changes must be a mapping of dotted keys to values, got 'mass'"):
        scene.replace("mass")
    for grid in ("mass.mass", {"mass.mass": 3.0}, {"mass.mass": "40,60"}):
        with pytest.raises(TypeError, match="grid must map each dotted key to a list of values"):
            scene.variants(grid)


def test_names_are_those_of_the_import_and_signatures_have_the_defaults():
    for name in ("run", "check", "quasi_static", "sweep", "assert_agree"):
        assert getattr(cf, name).__name__ == name
    signature = inspect.signature(cf.run)
    assert signature.parameters["method"].default == "following-p2"
    assert "default 100" not in cf.run.__doc__, "the signature says it"
    assert isinstance(cf.run("level", **QUICK), cf.Response)


@pytest.mark.slow  # a type checker reads all packages
def test_type_checkers_know_the_functions(tmp_path):
    (tmp_path / "use.py").write_text(
        "import cablefem as cf\n\nreveal_type(cf.run('level'))\nreveal_type(cf.check('level').verdict)\n"
        "cf.run('level', tol='small')\n"
    )
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--ignore-missing-imports", tmp_path / "use.py"],
        cwd=root, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert 'is "cablefem.response.Response"' in done.stdout
    assert 'is "validation.core.agreement.Verdict"' in done.stdout
    assert 'has incompatible type "str"' in done.stdout
