"""Design numbers in words, with unit prefixes and the digits the bar leaves."""

import math
from typing import Any

import numpy as np

from cablefem.response import Array
from validation.core import store

TEXTS = store.read_packaged_toml(__package__, "quantities.toml")
KNOWN = TEXTS["main"] | TEXTS["more"]


def key_numbers(design: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The smallest clearance, with how many more there are, then forces, speed and the steeper end: at most eight."""
    numbers = sorted((x for x in design if x["value"] is not None), key=lambda x: float(x["value"]))
    clearances = [x for x in numbers if x["quantity"].startswith("clearance_")]
    angles = [x for x in numbers if x["quantity"].startswith("angle_")]
    by_name = {x["quantity"]: x for x in numbers if x not in angles[:-1]}
    key = [clearances[0] | {"more": len(clearances) - 1}] if clearances else []
    key += [by_name[quantity] for quantity in TEXTS["main"] if quantity in by_name]
    return key[:8]


def design_row_texts(number: dict[str, Any]) -> dict[str, str]:
    """The columns of a row of `design` as texts; "" where unknown."""
    what = quantity_words(number["quantity"])
    if number.get("more"):
        what += f" ({number['more']} more, larger)"
    value = number["value"]
    return {
        "what": what,
        "value": "the car never passes" if value is None else quantity_text(value, number.get("bar"), number["unit"]),
        "t": _entry_with_unit(number, "t", ".4g", "s"),
        "mass": _entry_with_unit(number, "s_o", ".1f", "m"),
        "at": _entry_with_unit(number, "s", ".1f", "m"),
    }


def quantity_text(value: float, bar: float | None, unit: str) -> str:
    """A value with its bar and unit; a speed also in km/h."""
    factor, name = factor_and_prefixed_unit(np.array([value, bar or 0.0]), unit)
    text = text_with_error_bar(factor * value, bar and factor * bar)
    if name and unit != "s_o/l":
        text += f" {name}"
    if unit == "m/s":
        text += f" = {text_with_error_bar(3.6 * value, bar and 3.6 * bar)} km/h"
    return text


def limit_row_texts(row: dict[str, Any]) -> dict[str, str]:
    """The columns of a row of verdicts on limits as texts."""
    value = "-" if row["value"] is None else quantity_text(row["value"], row["bar"], row["unit"])
    limit = f"{row['side']} {quantity_text(row['limit'], None, row['unit'])}"
    return {"limit": row["demand"], "value": value, "demanded": limit, "by": row["source"], "verdict": row["verdict"]}


def verification_row_texts(row: dict[str, Any]) -> dict[str, str]:
    """The columns of a row of the verification as texts."""
    factor, name = factor_and_prefixed_unit(np.array([row["uncertainty"]]), row["unit"])
    texts = {
        "quantity": quantity_words(row["quantity"]),
        "S": quantity_text(row["value"], row["bar"], row["unit"]),
        "D": quantity_text(row["other"], row["bar_other"], row["unit"]),
    }
    for direction in ("space", "time"):
        order = row[f"order_{direction}"]
        texts[f"order in {direction}"] = "not reached" if order is None else f"{order:.1f}"
    texts["|E|"] = f"{factor * row['gap']:.2g} {name}".rstrip()
    texts["validation uncertainty"] = f"{factor * row['uncertainty']:.2g} {name}".rstrip()
    return texts


def _entry_with_unit(number: dict[str, Any], key: str, digits: str, unit: str) -> str:
    """The text of one entry of a design number; "" where it is not known."""
    value = number.get(key)
    return "" if value is None else f"{value:{digits}} {unit}"


def quantity_words(quantity: str) -> str:
    """What a quantity is, in words; "KIND:NAME" names the obstacle or part that it is of."""
    kind, _, of = quantity.partition(":")
    return KNOWN[kind][0].format(of)


def unit_of(quantity: str) -> str:
    """The SI unit; "" of a ratio."""
    return KNOWN[quantity.partition(":")[0]][1]


def factor_and_prefixed_unit(values: Array, unit: str) -> tuple[float, str]:
    """Factor and prefixed unit that give the largest value one to four digits."""
    largest = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0
    if unit == "m" and 0.0 < largest < 0.1:
        return 1e3, "mm"
    if unit in ("N", "J", "Pa"):
        for factor, prefix in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
            if largest >= 2.0 * factor:
                return 1.0 / factor, prefix + unit
    return 1.0, unit


def text_with_error_bar(value: float, bar: float | None) -> str:
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
