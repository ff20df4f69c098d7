"""Importing is light: people read a scene without paying for the solvers."""

import json
import subprocess
import sys

import pytest

HEAVY = {"skfem", "matplotlib", "numba"}
PROBE = """
import json, sys, time
begin = time.perf_counter()
{code}
print(json.dumps([time.perf_counter() - begin, sorted({{name.partition(".")[0] for name in sys.modules}})]))
"""


def probe(code):
    """Seconds that the code took in a fresh interpreter, and the top-level modules loaded after it."""
    run = subprocess.run([sys.executable, "-c", PROBE.format(code=code)], capture_output=True, text=True, check=True)
    seconds, modules = json.loads(run.stdout)
    return seconds, set(modules)


def test_import_cablefem_takes_less_than_0_3_s_and_loads_no_solver():
    seconds, modules = min((probe("import cablefem") for _ in range(3)), key=lambda result: result[0])
    assert seconds < 0.3
    assert "cablefem" in modules
    assert not modules & HEAVY


def test_a_scene_and_its_groups_need_no_solver_either():
    _, modules = probe("from cablefem import Scene; scene = Scene.load('zipline'); str(scene), scene.groups.motion")
    assert not modules & HEAVY


@pytest.mark.parametrize("name", sorted(HEAVY))
def test_the_probe_sees_a_heavy_import(name):
    _, modules = probe(f"import {name}")
    assert name in modules


def test_unknown_names_of_the_package_are_attribute_errors():
    import cablefem

    with pytest.raises(AttributeError, match="no attribute 'scena'"):
        _ = cablefem.scena
