"""Flags of suspect runs; the text of each kind is here."""

from dataclasses import replace

from cablefem.response import Flag, Response

WORDS = {
    "fast": "the mass outruns the waves in front of it (V/c = {speed_ratio:.2f}): refinement converges slowly or not "
    "at all, and the error bar is no bound",
    "slow waves": "the tension falls to {least:.2g} H: from s_o/l = {since:.3f} (s/l = {at:.3f}) on waves there are "
    "slower than the mass and steepen; refinement converges slowly, and the error bar is no bound",
    "energy": "the run gains energy that nothing gave it ({gain:.2g} of all it has, {allowed:g} allowed): distrust it, "
    "its slack too; take more steps, a damped or the energy scheme, or another method",
    "slack energy": "after the slack onset the run gains energy that nothing gave it ({gain:.2g} of all it had): from "
    "s_o/l = {since:.3f} on it is no answer",
    "hidden slack": "points of the cable are under compression, down to {least:.2g} H, from s_o/l = {since:.3f} "
    "(s/l = {at:.3f}) on, but no whole element is slack: from there on the error bar may be too small",
    "no bar": "no error bar could be made: {why}",
}


def flag(kind: str, **numbers: float | str) -> Flag:
    """A flag of a kind in `WORDS` with its numbers."""
    made = Flag(kind, WORDS[kind], numbers)
    str(made)  # fails if a number is missing
    return made


def flagged(r: Response, kind: str, **numbers: float | str) -> Response:
    return replace(r, flags=[*r.flags, flag(kind, **numbers)])
