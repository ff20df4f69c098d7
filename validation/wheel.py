"""Build hook: a wheel whose compiled functions are there already.

    HATCH_BUILD_HOOKS_ENABLE=true python -m build --wheel

It runs checks on a copy of the source, compiling for `cablefem.compiled.PROCESSOR`.  The wheel is of one platform, and
its functions are for the numba they were compiled with; another numba, or a processor without the features, compiles.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PROCESSOR = "x86-64-v3"  # as cablefem.compiled has it; a hook imports no package that it builds
PACKAGES = "cablefem", "galerkin", "validation"
# what users run first; other functions are compiled when they are called
RUNS = """
import cablefem as cf
for scene in ("level", "tramway", "zipline", "two-cars"):
    cf.check(scene, tol=3e-2)
for scene in ("level", "tramway"):
    cf.run(scene)
"""


def compile_functions_in_copy(root: Path, copy: Path) -> list[Path]:
    """Copy the packages of a root, run them, and return the files of compiled functions, all below the copy."""
    for package in PACKAGES:
        shutil.copytree(root / package, copy / package, ignore=shutil.ignore_patterns("__pycache__", "shipped"))
    environment = os.environ | {"PYTHONPATH": str(copy), "NUMBA_CPU_NAME": PROCESSOR, "NUMBA_CPU_FEATURES": ""}
    environment.pop("NUMBA_CACHE_DIR", None)
    subprocess.run([sys.executable, "-c", RUNS], check=True, cwd=copy, env=environment)
    return sorted(path for ending in ("nbi", "nbc") for path in copy.rglob(f"*.{ending}"))


class KernelsHook(BuildHookInterface):
    """See the module."""

    def dependencies(self) -> list[str]:
        return list(self.metadata.core.dependencies)

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version != "standard":  # an editable install compiles what it runs
            return
        self.copy = tempfile.mkdtemp()
        copy = Path(self.copy)
        for path in compile_functions_in_copy(Path(self.root), copy):
            source = path.parent.parent.relative_to(copy)  # of its __pycache__
            build_data["force_include"][str(path)] = str(source / "shipped" / path.name)
        build_data["pure_python"] = False
        build_data["infer_tag"] = True

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        if version == "standard":
            shutil.rmtree(self.copy)
