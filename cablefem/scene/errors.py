"""What is wrong with a scene, said in whole lines."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class SceneError(ValueError):
    """A scene that cannot be simulated; `faults` holds one line per fault: field, value and admissible range."""

    def __init__(self, faults: list[str]) -> None:
        super().__init__("\n".join(faults))
        self.faults = faults


def shown(value: object) -> str:
    """The value as a user would recognise it, on one line and not longer than a line."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else text[:57] + "..."


def nearest(word: str, known: Iterable[str]) -> str:
    """' Did you mean ...?' with the nearest known word (or nothing), then the list of known words."""
    known = list(known)
    match = difflib.get_close_matches(word.lower(), known, n=1, cutoff=0.5)
    if not match:  # 'EA' and the like are short and in capitals
        match = [k for k in known if k.lower() == word.lower()]
    return (f" Did you mean {match[0]}?" if match else "") + f" Known: {', '.join(known)}."
