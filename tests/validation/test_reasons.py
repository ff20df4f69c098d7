"""Reasons are objects: kinds and numbers decide, words show."""

import json
import math
import string

import pytest

from validation.core.agreement import Agreement, Bound, BoundPart, no_bound
from validation.core.flags import TEXTS, make_flag


def test_a_bound_is_the_sum_of_its_parts():
    bound = Bound("error bars", (BoundPart("a", 1.2e-3, "how"), BoundPart("b", 2.0e-3)), notes=("over the window",))
    assert bound.sum_or_nan == 1.2e-3 + 2.0e-3
    assert str(bound) == "error bars: a 0.0012 (how) + b 0.002; over the window"
    row = json.loads(json.dumps(Agreement("path_max", math.nan, bound).to_json(), allow_nan=False))
    assert (row["notes"], row["gap"], row["bar_b"]) == (["over the window"], None, 2.0e-3)


def test_a_bound_without_a_value_is_none():
    none = no_bound("no common range")
    assert (none.sum_or_nan != none.sum_or_nan, str(none)) == (True, "no common range")


@pytest.mark.parametrize("kind", TEXTS)
def test_every_flag_says_its_numbers(kind):
    names = {name for _, name, _, _ in string.Formatter().parse(TEXTS[kind]) if name}
    numbers = dict.fromkeys(names, 0.25) if kind != "no bar" else {"why": "0.25"}
    assert ("0.25" in str(make_flag(kind, **numbers))) == bool(names)
    if names:
        with pytest.raises(KeyError):
            make_flag(kind)
