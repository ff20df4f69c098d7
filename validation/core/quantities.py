"""Design numbers in words, with unit prefixes and the digits the bar leaves."""

import math
from typing import Any

import numpy as np

from cablefem.response import Array
from validation.core import store

SAID = store.shipped(__package__, "quantities.toml")
KNOWN = SAID["main"] | SAID["more"]


def matter(design: list[dict[str, Any]], most: int = 8) -> list[dict[str, Any]]:
    """The key numbers: the smallest clearance, with how many more there are, then forces, speed, the steeper end."""
    known = [d for d in design if d["value"] is not None]
    clearances = sorted((d for d in known if d["quantity"].startswith("clearance_")), key=_value)
    angles = sorted((d for d in known if d["quantity"].startswith("angle_")), key=_value)
    rest = [d for d in known if d not in clearances and d not in angles[:-1]]
    first = [clearances[0] | {"more": len(clearances) - 1}] if clearances else []
    return (first + [d for quantity in SAID["main"] for d in rest if d["quantity"] == quantity])[:most]


def _value(number: dict[str, Any]) -> float:
    return float(number["value"])


def told(number: dict[str, Any]) -> dict[str, str]:
    """A row of `design` as text; "" where unknown."""
    value = number["value"]
    bar = number.get("bar")
    unit = number["unit"]
    if value is None:
        return {"what": named(number["quantity"]), "value": "the car never passes", "t": "", "mass": "", "at": ""}
    factor, name = scale_of(np.array([value, bar or 0.0]), unit)
    text = f"{with_bar(factor * value, bar and factor * bar)} {'' if unit == 's_o/l' else name}".rstrip()
    if unit == "m/s":
        text += f" = {with_bar(3.6 * value, bar and 3.6 * bar)} km/h"

    def place(key: str) -> str:
        return "" if number.get(key) is None else f"{number[key]:.1f} m"

    more = f" ({number['more']} more are larger)" if number.get("more") else ""
    return {
        "what": named(number["quantity"]) + more, "value": text,
        "t": "" if number.get("t") is None else f"{number['t']:.4g} s", "mass": place("s_o"), "at": place("s"),
    }  # fmt: skip


def named(quantity: str) -> str:
    kind, _, of = quantity.partition(":")
    return KNOWN[kind][0].format(of)


def unit_of(quantity: str) -> str:
    """The SI unit; "" of a ratio."""
    return KNOWN[quantity.partition(":")[0]][1]


def scale_of(values: Array, unit: str) -> tuple[float, str]:
    """Factor and prefixed unit that give the largest value one to four digits."""
    largest = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0
    if unit == "m":
        return (1.0, "m") if largest >= 0.1 or largest == 0.0 else (1e3, "mm")
    for factor, prefix in ((1e9, "G"), (1e6, "M"), (1e3, "k")) if unit in ("N", "J") else ():
        if largest >= 2.0 * factor:
            return 1.0 / factor, prefix + unit
    return 1.0, unit


def with_bar(value: float, bar: float | None) -> str:
    """A value rounded to two digits of its bar, else to five.

    A bar at rounding level is none.
    """
    if abs(value) < 1e-9:
        return "0"
    if not bar or not math.isfinite(bar) or bar < 1e-9 * abs(value):
        return f"{value:.5g}"
    digits = 1 - math.floor(math.log10(bar))
    value = round(value, digits)
    bar = round(bar, digits)
    shown = max(0, digits)
    return f"{value:.{shown}f} ± {bar:.{shown}f}"
