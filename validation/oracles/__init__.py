"""Exact answers, one per file; see README.md.  No oracle uses a solver."""

import importlib
import pkgutil
import re
from types import ModuleType

from validation.oracles.case import Oracle


def find_oracles() -> dict[str, Oracle]:
    """All files with a group, by their names with hyphens."""
    oracles = {}
    for file in pkgutil.iter_modules(__path__):
        oracle = _oracle_of_module(importlib.import_module(f"{__name__}.{file.name}"))
        if oracle.group:
            oracles[file.name.replace("_", "-")] = oracle
    return oracles


def _oracle_of_module(file: ModuleType) -> Oracle:
    text = file.__doc__ or ""
    headers = dict(re.findall(r"^(Source|Validity|Group): (.+)$", text, re.MULTILINE))
    parts = {name.lower(): content for name, content in headers.items()}
    title = text.partition("\n")[0].rstrip(".")
    return Oracle(title=title, cases=getattr(file, "cases", tuple), **parts)
