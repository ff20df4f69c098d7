"""What gets loaded: two wings that never touch, on common ground, and one judge above both that is light until used.

Who may import whom is import-linter's to say (pyproject.toml); this reads fresh interpreters.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import validation

ROOT = Path(__file__).parents[2]
GROUND = {"cablefem.scene", "cablefem.newmark", "cablefem.response"}


def within(name, package):
    return name == package or name.startswith(package + ".")


def module_name(file):
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


FILES = sorted(file for package in ("cablefem", "galerkin", "validation") for file in (ROOT / package).rglob("*.py"))


# --- what is loaded -------------------------------------------------------------------------------------------------


def loaded(code):
    """Names of all modules loaded after the code ran in a fresh interpreter."""
    probe = f"{code}\nimport json, sys\nprint(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True, cwd=ROOT)
    return set(json.loads(done.stdout.splitlines()[-1]))


def test_the_galerkin_wing_loads_neither_scikit_fem_nor_the_other_wing():
    modules = [module_name(file) for file in FILES if within(module_name(file), "galerkin")]
    names = loaded("import " + ", ".join(modules))
    assert set(modules) <= names
    assert "skfem" not in names
    assert not any(within(name, "cablefem.elements") or within(name, "validation") for name in names)


def test_the_element_wing_loads_nothing_of_the_other():
    modules = [module_name(file) for file in FILES if within(module_name(file), "cablefem")]
    names = loaded("import " + ", ".join(modules))
    assert "skfem" in names
    assert not any(within(name, "galerkin") or within(name, "validation") for name in names)


def test_the_common_ground_loads_no_solver():
    names = loaded("import " + ", ".join(sorted(GROUND)))
    assert not names & {"skfem", "matplotlib", "numba", "meshio", "galerkin", "cablefem.elements"}


def test_the_judge_and_the_door_are_light_until_they_are_used():
    heavy = {"numpy", "scipy", "pydantic", "skfem", "matplotlib", "numba", "meshio", "rich", "jinja2", "galerkin"}
    assert not loaded("import validation; dir(validation)") & heavy
    assert not loaded("import validation.cli") & heavy
    assert "numpy" in loaded("import validation; validation.run")  # the probe sees what use costs


def test_names_and_settings_of_methods_need_no_solver():
    assert not loaded("from validation.core.methods import METHODS") & {
        "skfem",
        "numba",
        "matplotlib",
        "galerkin.equations",
    }


def test_what_judges_and_draws_is_loaded_while_solvers_run(tmp_path):
    start = f"""
import validation.commands.check.study as study
from validation.cli import main
def stop(*given, **named):
    raise KeyboardInterrupt
study.check = stop
assert main(["check", "level", "--out", {str(tmp_path / "out")!r}]) == 130
"""
    assert not loaded(start) & {
        "scipy",
        "numba",
        "skfem",
        "matplotlib",
        "validation.core.laws",
        "validation.core.trust",
    }


def test_public_names_are_there():
    check = "import validation; assert callable(validation.check) and callable(validation.assert_agree)"
    assert "validation.commands.check.study" in loaded(check)
    with pytest.raises(AttributeError, match="no attribute 'chek'"):
        _ = validation.chek
