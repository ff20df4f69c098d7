"""Exact answers, one per file: equation, source, validity and accuracy stand in its docstring; see README.md.

Units: length l, tension T (horizontal tension H of a sagging cable), time l sqrt(rho/T); mu = M/(rho l), sigma =
rho g l/T, alpha = EA/T; v and y down; speeds over the wave speed.  No oracle uses a solver.
"""

import importlib
import pkgutil
import re
from types import ModuleType

from validation.oracles.case import Oracle


def find() -> dict[str, Oracle]:
    """Return all oracles by the names of their files: those whose docstrings name a Group."""
    files = {file.name: importlib.import_module(f"{__name__}.{file.name}") for file in pkgutil.iter_modules(__path__)}
    found = {name.replace("_", "-"): _oracle(file) for name, file in files.items()}
    return {name: oracle for name, oracle in found.items() if oracle.group}


def _oracle(file: ModuleType) -> Oracle:
    """Return what a file says of itself: the first line and the last lines "Name: ..." of its docstring."""
    text = file.__doc__ or ""
    told = dict(re.findall(r"^(Source|Validity|Group|Unreached): (.+)$", text, re.MULTILINE))
    parts = {name.lower(): said for name, said in told.items()}
    return Oracle(title=text.partition("\n")[0].rstrip("."), cases=getattr(file, "cases", tuple), **parts)
