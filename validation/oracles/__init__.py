"""Exact answers, one per file: each states its equation, its source, where it holds and how exact it is.

Units of every oracle: length l, tension T (horizontal tension H of a sagging cable), time l sqrt(rho/T); mu =
M/(rho l), sigma = rho g l/T, alpha = EA/T; v and y down; speeds over the wave speed.  No oracle uses a solver.

A file of this folder that holds an `ORACLE` is one; its cases say how solvers are held against it.
"""

import importlib
import pkgutil

from validation.oracles.case import Oracle


def find() -> dict[str, Oracle]:
    """Return all oracles by the names of their files."""
    files = {file.name: importlib.import_module(f"{__name__}.{file.name}") for file in pkgutil.iter_modules(__path__)}
    return {name.replace("_", "-"): file.ORACLE for name, file in files.items() if hasattr(file, "ORACLE")}
