"""Exact answers, one per file; see README.md.

Units: length l, tension T (horizontal tension H of a sagging cable), time l sqrt(rho/T), speeds over the wave speed.
mu = M/(rho l), sigma = rho g l/T, alpha = EA/T; v and y down.  No oracle uses a solver.
"""

import importlib
import pkgutil
import re
from types import ModuleType

from validation.oracles.case import Oracle


def find() -> dict[str, Oracle]:
    """Return the oracles, files whose docstrings name a Group, by name."""
    files = {file.name: importlib.import_module(f"{__name__}.{file.name}") for file in pkgutil.iter_modules(__path__)}
    found = {name.replace("_", "-"): _oracle(file) for name, file in files.items()}
    return {name: oracle for name, oracle in found.items() if oracle.group}


def _oracle(file: ModuleType) -> Oracle:
    """Read the first line and the lines "Name: ..." of a file's docstring."""
    text = file.__doc__ or ""
    told = dict(re.findall(r"^(Source|Validity|Group|Unreached): (.+)$", text, re.MULTILINE))
    parts = {name.lower(): said for name, said in told.items()}
    return Oracle(title=text.partition("\n")[0].rstrip("."), cases=getattr(file, "cases", tuple), **parts)
