"""Compiled functions of a wheel: loaded on another processor, compiled where they cannot run."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from cablefem import compiled
from validation import wheel

LOOPS = """
from cablefem.compiled import compiling_decorator

@compiling_decorator(__file__)
def total(n):
    out = 0.0
    for i in range(n):
        out += 1.0 / (1.0 + i) ** 2
    return out
"""
RUN = """
from numba.core import event
from loops import total

class Listener(event.Listener):
    def on_start(self, e):
        print("compiles")
    def on_end(self, e):
        pass

event.register("numba:compile", Listener())
print(total(10_000))
"""


def printed_by_new_process(folder: Path, **environment: str) -> list[str]:
    """Lines that `RUN` prints in a new process, which compiles into a cache in the folder."""
    paths = os.pathsep.join([str(folder), *sys.path])
    settings = os.environ | {"PYTHONPATH": paths, "NUMBA_CACHE_DIR": str(folder / "cache")} | environment
    done = subprocess.run([sys.executable, "-c", RUN], check=True, env=settings, capture_output=True, text=True)
    return done.stdout.split()


def test_functions_of_a_wheel_are_not_compiled_again_on_another_processor(tmp_path):
    (tmp_path / "loops.py").write_text(LOOPS)
    compiles, total = printed_by_new_process(tmp_path, NUMBA_CPU_NAME=wheel.PROCESSOR, NUMBA_CPU_FEATURES="")
    assert compiles == "compiles"
    (tmp_path / compiled.SHIPPED).mkdir()
    for ending in ("nbi", "nbc"):
        for path in (tmp_path / "cache").rglob(f"*.{ending}"):
            path.rename(tmp_path / compiled.SHIPPED / path.name)
    shutil.rmtree(tmp_path / "cache")
    assert printed_by_new_process(tmp_path) == [total]
    # functions of other source are compiled
    (tmp_path / "loops.py").write_text(LOOPS.replace("1.0 + i", "2.0 + i"))
    assert printed_by_new_process(tmp_path)[0] == "compiles"


def test_a_processor_without_their_features_compiles():
    assert wheel.PROCESSOR == compiled.PROCESSOR
    assert compiled.can_run_shipped_code(dict.fromkeys(compiled.FEATURES, True))
    assert not compiled.can_run_shipped_code(dict.fromkeys(compiled.FEATURES, True) | {"avx2": False})
