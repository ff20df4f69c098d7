"""Exact answers, one per file; see README.md.  No oracle uses a solver."""

import importlib
import pkgutil
import re
from types import ModuleType

from validation.oracles.case import Oracle


def find_oracles() -> dict[str, Oracle]:
    files = {file.name: importlib.import_module(f"{__name__}.{file.name}") for file in pkgutil.iter_modules(__path__)}
    found = {name.replace("_", "-"): _oracle_of_module(file) for name, file in files.items()}
    return {name: oracle for name, oracle in found.items() if oracle.group}


def _oracle_of_module(file: ModuleType) -> Oracle:
    text = file.__doc__ or ""
    headers = dict(re.findall(r"^(Source|Validity|Group): (.+)$", text, re.MULTILINE))
    parts = {name.lower(): content for name, content in headers.items()}
    return Oracle(title=text.partition("\n")[0].rstrip("."), cases=getattr(file, "cases", tuple), **parts)
