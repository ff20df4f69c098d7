"""Importing is light: people read a scene without paying for the solvers."""

import json
import subprocess
import sys

import pytest

HEAVY = {"skfem", "matplotlib", "numba"}
PROBE = """
import json, sys
{code}
print(json.dumps(sorted({{name.partition(".")[0] for name in sys.modules}})))
"""


def probe(code):
    """Top-level modules loaded after the code ran in a fresh interpreter."""
    run = subprocess.run([sys.executable, "-c", PROBE.format(code=code)], capture_output=True, text=True, check=True)
    return set(json.loads(run.stdout))


def test_the_package_a_scene_and_its_groups_need_no_solver():
    modules = probe("from cablefem import Scene; scene = Scene.load('zipline'); str(scene), scene.groups.motion")
    assert "cablefem" in modules
    assert not modules & HEAVY


def test_the_probe_sees_a_heavy_import():
    assert "matplotlib" in probe("import matplotlib")


def test_unknown_names_of_the_package_are_attribute_errors():
    import cablefem

    with pytest.raises(AttributeError, match="no attribute 'scena'"):
        _ = cablefem.scena
