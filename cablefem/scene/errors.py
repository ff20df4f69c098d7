"""What is wrong with a scene, in sentences."""

import difflib
from collections.abc import Iterable

_LINE = "a line at rest with [[contact]] has it"
_FIXED = "the two ends of the cable are fixed"
# keys that people try
_WHY = {
    "counterweight": f"{_FIXED}, so the tension grows under the car where a counterweight would hold it; {_LINE}",
    "spring": f"{_FIXED}; {_LINE}",
    "tower towers saddle spans": f"the cable has one span; {_LINE}",
    "masses cars": f"one car rides on the cable; {_LINE}",
    "hanger pendulum swing": "it is mass.hanger of one span, or hanger of a [[car]]; run and check alone take it",
    "bending bending_stiffness EI": "the cable bends without resistance",
    "torsion": "the cable has no torsion",
    "creep": "the cable keeps its unstretched length; give the length, sag or tension that it has on the day",
    "crosswind": "it is wind.across, which damps the cable; drive.wind acts along the line on the car",
    "wind": "[wind] across damps the cable; along the line, as drive.wind with drag_area, it acts on the car alone",
    "along": "along the line wind acts on the car alone: drive.wind with drag_area",
    "vertical": "wind blows across the line, wind.across, or along it on the car, drive.wind",
    "haul_rope": "its force is an answer, its weight and stiffness are left out",
    "damping": "the rope has it, as cable.damping; a car is damped by drag_area and rolling_friction",
}
NOT_MODELLED = {key: why for keys, why in _WHY.items() for key in keys.split()}


class SceneError(ValueError):
    """A scene that cannot be simulated; `faults`, one per line: field, value, range."""

    def __init__(self, faults: list[str]) -> None:
        super().__init__(faults)
        self.faults = faults

    def __str__(self) -> str:
        return "\n".join(self.faults)


def short_text(value: object) -> str:
    """The value on one line, shortened; a list as in TOML."""
    text = " ".join(repr(list(value) if isinstance(value, tuple) else value).split())
    return text if len(text) <= 60 else text[:57] + "..."


def did_you_mean(word: str, names: Iterable[str]) -> str:
    """' Did you mean ...?' with the nearest name that has the word as a part, or is misspelt as it; the list of all."""
    spelt = {name.lower(): name for name in names}
    wider = [name for name in spelt if word.lower() in name.split("_")]
    # beyond the cutoff a name means something else
    match = difflib.get_close_matches(word.lower(), wider or spelt, n=1, cutoff=0.0 if wider else 0.7)
    guess = f" Did you mean {spelt[match[0]]}?" if match else ""
    return f"{guess} Known: {', '.join(spelt.values())}."
