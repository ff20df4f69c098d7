"""Who may import whom: two wings that never touch, on common ground, and one judge above both.

Read from the sources, so that imports inside functions count; and from fresh interpreters, for what gets loaded.
"""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

import validation

ROOT = Path(__file__).parents[2]
GROUND = {"cablefem.scene", "cablefem.newmark", "cablefem.response"}
# The longest prefix of a module's name tells what of ours it may import; None: everything.
MAY_IMPORT = {
    "cablefem": {"cablefem.scene"},
    "cablefem.scene": {"cablefem.scene"},
    "cablefem.newmark": set(),
    "cablefem.response": set(),
    "cablefem.elements": GROUND | {"cablefem.elements"},
    "galerkin": GROUND | {"galerkin"},
    "validation": None,
    "validation.oracles": {"cablefem.scene", "validation.oracles"},  # an exact answer owes nothing to a solver
}
# A report reads stored files: nothing that runs a solver.
NOT_IN_REPORTS = {"cablefem.elements", "galerkin", "validation.running", "validation.resolution", "validation.estimate"}


def within(name, package):
    return name == package or name.startswith(package + ".")


def module_name(file):
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported(source, module, is_package):
    """Names of all that a module's source imports: packages, modules, and names in them, absolute."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parts = module.split(".")
                parts = parts[: len(parts) - node.level + is_package]
                base = ".".join([*parts, node.module] if node.module else parts)
            found |= {f"{base}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
            called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if called in ("import_module", "__import__"):
                found.add(str(node.args[0].value))
    return found


def faults(source, module, is_package=False):
    """Imports of ours that the module may not make."""
    ours = {name for name in imported(source, module, is_package) if name.split(".")[0] in MAY_IMPORT}
    rule = max((prefix for prefix in MAY_IMPORT if within(module, prefix)), key=len)
    allowed = MAY_IMPORT[rule]
    bad = set()
    for name in ours:
        # `from cablefem import Scene` is the scene: the package itself offers nothing else
        target = "cablefem.scene" if name in ("cablefem", "cablefem.Scene", "cablefem.SceneError") else name
        if (allowed is not None and not any(within(target, package) for package in allowed)) or (
            within(module, "validation.report") and any(within(target, package) for package in NOT_IN_REPORTS)
        ):
            bad.add(f"{module} imports {name}")
    return bad


FILES = sorted(file for package in ("cablefem", "galerkin", "validation") for file in (ROOT / package).rglob("*.py"))


def test_every_module_imports_only_what_it_may():
    assert len(FILES) > 40
    bad = set()
    for file in FILES:
        bad |= faults(file.read_text(encoding="utf-8"), module_name(file), file.name == "__init__.py")
    assert not bad, "\n".join(sorted(bad))


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("galerkin.equations", "from cablefem.elements.cable import CableElements"),
        ("galerkin.equations", "import cablefem.elements"),
        ("galerkin.equations", "from cablefem import elements"),
        ("galerkin.bases.kink", "def f():\n    from validation.running import run"),
        ("galerkin", "import importlib\nimportlib.import_module('cablefem.elements.kernels')"),
        ("cablefem.elements.following", "from galerkin.bases import fourier"),
        ("cablefem.elements.following", "from ...validation import run"),
        ("cablefem.scene.scene", "from cablefem import newmark"),
        ("cablefem.scene.scene", "from ..response import Response"),
        ("cablefem.newmark", "from cablefem.scene import Scene"),
        ("cablefem.newmark", "from cablefem import Scene"),
        ("cablefem.response", "if True:\n    import galerkin"),
        ("validation.oracles.irvine", "from galerkin.modes import bare_frequencies"),
        ("validation.oracles.irvine", "from validation import measures"),
        ("validation.report.check", "from validation.running import run"),
        ("validation.report.check", "from validation import resolution"),
    ],
)
def test_a_planted_import_is_found(module, source):
    assert faults(source, module)


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("galerkin.equations", "from cablefem.scene import Groups\nimport numpy\nfrom galerkin import bases"),
        ("galerkin.bases.kink", "from . import fourier\nfrom .fourier import Fourier\nfrom ..equations import x"),
        ("cablefem.elements.following", "from cablefem import Scene, newmark\nfrom .kernels import add"),
        ("cablefem.scene.scene", "from cablefem.scene.errors import SceneError"),
        ("validation.agreement", "import galerkin, cablefem.elements.fixed"),
        ("validation.report.check", "from cablefem.response import Response\nfrom validation import measures"),
    ],
)
def test_what_is_allowed_is_not_a_fault(module, source):
    assert not faults(source, module)


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
    assert not loaded("from validation.methods import METHODS") & {"skfem", "numba", "matplotlib", "galerkin.equations"}


def test_public_names_are_there():
    check = "import validation; assert callable(validation.check) and callable(validation.assert_agree)"
    assert "validation.studies.check" in loaded(check)
    with pytest.raises(AttributeError, match="no attribute 'chek'"):
        _ = validation.chek
