"""Numbers and words in printed text."""

import html
import math
import re

import numpy as np

from validation.core.readback.stored import Row, read_package_toml
from validation.core.scene_data import ROUNDING, conversion_factor_or_nan

NUMBER = r"-?\d[\d ]*(?:\.\d+)?(?: × 10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?(?:e[+-]?\d+)?"
_VALUE = re.compile(rf"({NUMBER})(?: ± ({NUMBER}))?(?: ?([a-zA-Z%°][\w/%°]*))?")
_POWERS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def plain_text(html_text: str) -> str:
    """The text of HTML without tags, with plain minus signs and single spaces."""
    return with_plain_signs(html.unescape(re.sub(r"<[^>]*>", "", html_text)))


def with_plain_signs(text: str) -> str:
    """A text that is no HTML with plain minus signs and single spaces: "<=" and ">" in it are no tag."""
    text = text.replace("\u202f", " ").replace("−", "-")
    return re.sub(r"\s+", " ", text).strip()


def parse_number(text: str) -> float:
    """A printed number: thousands apart by spaces, a power as × 10⁻³."""
    mantissa, _, power = text.partition(" × 10")
    return float(mantissa.replace(" ", "")) * 10.0 ** int(power.translate(_POWERS) or 0)


def _decimal_exponent(x: float) -> int:
    """Power of ten of the first digit."""
    return math.floor(math.log10(abs(x))) if x else 0


def shows_value(
    text: str, value: float | None, unit: str = "", *, bar_shown: float | None = None, digits: int = 5
) -> bool:
    """Whether a text shows a value in SI to its last digit, with its bar to two digits and a unit that suits.

    digits : of a value without bar; the digits before the point all count.
    """
    if value is None or not math.isfinite(value):
        return text in ("–", "-")
    printed, factor = _parse_numbers_and_unit_factor(text, unit)
    if math.isnan(factor):
        return False
    if printed == [0.0] and abs(value / factor) < ROUNDING:
        return True
    expected = [value / factor]
    digit = _decimal_exponent(value / factor) - digits + 1
    if bar_shown and ROUNDING * abs(value) <= bar_shown < math.inf:  # known, and no rounding
        expected.append(bar_shown / factor)
        digit = _decimal_exponent(expected[1]) - 1
    return len(printed) == len(expected) and np.allclose(printed, expected, rtol=0.0, atol=0.501 * 10.0**digit)


def _parse_numbers_and_unit_factor(text: str, unit: str) -> tuple[list[float], float]:
    """A printed value and its bar, and their unit in `unit`; nan: not a value in such a unit."""
    match = _VALUE.fullmatch(text)
    if match is None:
        return [], math.nan
    numbers = [parse_number(number) for number in match.group(1, 2) if number]
    return numbers, conversion_factor_or_nan(match[3] or "", unit)


def shows_decimals(text: str, value: float | None, unit: str, decimals: int) -> bool:
    """Whether a text shows a value with so many decimals, and a unit; "" if it is unknown."""
    if value is None:
        return text == ""
    number, _, printed = text.partition(" ")
    good = re.fullmatch(rf"-?\d+\.\d{{{decimals}}}", number) and printed == unit
    return bool(good) and abs(float(number) - value) <= 0.501 * 10.0**-decimals


def quantity_words(row: Row) -> str:
    """The words of a design number on page and terminal."""
    kind, _, of = row["quantity"].partition(":")
    quantities = read_package_toml("core", "quantities.toml")
    words: str = (quantities["main"] | quantities["more"])[kind][0]
    return words.format(of)


def comparison_words(row: Row) -> str:
    """What a row of agreement.json compares, in the words of the page."""
    words = (row["quantity"].replace("_", " "), row.get("law"), row.get("with"))
    return plain_text(": ".join(filter(None, words)))


def shows_design_number(text: str, row: Row) -> bool:
    """Whether a text shows a design number with its bar; a speed in m/s and km/h."""
    if row["value"] is None:
        return text == "the car never passes"
    parts = text.split(" = ")
    endings = ["m/s", "km/h"] if row["unit"] == "m/s" else [""]
    if len(parts) != len(endings):
        return False
    for part, ending in zip(parts, endings, strict=True):
        if not (part.endswith(ending) and shows_value(part, row["value"], row["unit"], bar_shown=row.get("bar"))):
            return False
    return True


def contents_of_tags(tag: str, html_text: str) -> list[str]:
    """Contents of all elements of a tag, a pattern that may name a class."""
    name = tag.partition(" ")[0]
    return re.findall(rf"<{tag}[^>]*>(.*?)</{name}>", html_text, re.S)


def rows_of_table(html_table: str) -> list[list[str]]:
    """Plain texts of the cells of each row of a table, of which the first holds the names of the columns."""
    rows = contents_of_tags("tr", html_table)
    return [[plain_text(cell) for cell in contents_of_tags("t[hd]", row)] for row in rows]


def rows_of_each_table(html_text: str) -> list[list[list[str]]]:
    """See `rows_of_table`, of all tables."""
    return [rows_of_table(table) for table in contents_of_tags("table", html_text)]
