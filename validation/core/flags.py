"""Flags of suspect runs; flags.toml has the text of each kind."""

from dataclasses import replace

from cablefem.response import Flag, Response
from validation.core import store

WORDS = store.shipped(__package__, "flags.toml")


def flag(kind: str, **numbers: float | str) -> Flag:
    """A flag of a kind in flags.toml with its numbers."""
    made = Flag(kind, WORDS[kind], numbers)
    str(made)  # fails if a number is missing
    return made


def flagged(r: Response, kind: str, **numbers: float | str) -> Response:
    return replace(r, flags=[*r.flags, flag(kind, **numbers)])
