"""What is wrong with a scene, said in whole lines."""

import difflib
from collections.abc import Iterable


class SceneError(ValueError):
    """A scene that cannot be simulated; `faults` holds one line per fault: field, value and admissible range."""

    def __init__(self, faults: list[str]) -> None:
        super().__init__(faults)
        self.faults = faults

    def __str__(self) -> str:
        return "\n".join(self.faults)


def shown(value: object) -> str:
    """The value as its writer would recognise it, on one line and not much longer than a word."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else text[:57] + "..."


def nearest(word: str, known: Iterable[str]) -> str:
    """Return ' Did you mean ...?' with the nearest known word, if any is near, and the list of all known ones."""
    spelt = {name.lower(): name for name in known}
    match = difflib.get_close_matches(word.lower(), spelt, n=1, cutoff=0.5)
    return (f" Did you mean {spelt[match[0]]}?" if match else "") + f" Known: {', '.join(spelt.values())}."
