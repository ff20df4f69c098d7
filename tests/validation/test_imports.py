"""What gets loaded: whoever reads a scene or asks for help pays for no solver.

Who may import whom is import-linter's to say (pyproject.toml); this reads fresh interpreters.
"""

import json
import subprocess
import sys

import pytest

SOLVERS = {"skfem", "numba", "matplotlib", "meshio", "galerkin", "cablefem.elements"}
HEAVY = SOLVERS | {"numpy", "scipy", "pydantic", "rich", "jinja2"}
INTERRUPTED = """
import tempfile
import validation.commands.check.study as study
from validation.cli import main
def stop(*given, **named):
    raise KeyboardInterrupt
study.check = stop
assert main(["check", "level", "--out", tempfile.mkdtemp() + "/out"]) == 130
"""
# what runs -> what it must not load
LIGHT = {
    "package and judge": ("import cablefem, validation; dir(cablefem), dir(validation)", HEAVY),
    "plugin": ("import cablefem.pytest_plugin", HEAVY),
    "command": ("import validation.cli", HEAVY),
    "help": ("from validation.cli import main; main(['check', '--help'])", SOLVERS | {"numpy", "scipy"}),
    "list of scenes": ("from validation.cli import main; main(['scenes'])", SOLVERS | {"scipy"}),
    "scene": ("from cablefem import Scene; scene = Scene.load('zipline'); str(scene), scene.groups.motion", SOLVERS),
    "common ground": ("import cablefem.scene, cablefem.newmark, cablefem.response", SOLVERS),
    "method table": ("from validation.core.methods import METHODS", SOLVERS - {"galerkin"} | {"galerkin.equations"}),
    "what judges, before the runs": (
        INTERRUPTED, {"scipy", "numba", "skfem", "matplotlib", "validation.core.laws", "validation.core.trust"},
    ),
}  # fmt: skip


def loaded_modules(code):
    """Names of all modules loaded after the code ran in a fresh interpreter."""
    probe = f"{code}\nimport json, sys\nprint(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True)
    return set(json.loads(done.stdout.splitlines()[-1]))


@pytest.mark.parametrize(("code", "not_yet"), LIGHT.values(), ids=LIGHT)
def test_nothing_is_loaded_before_it_is_used(code, not_yet):
    assert not loaded_modules(code) & not_yet


def test_the_probe_sees_what_use_costs():
    assert {"numpy", "validation.commands.check.study"} <= loaded_modules(
        "import validation; validation.check, validation.run"
    )
