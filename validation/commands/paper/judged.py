"""Verdicts from a range, a value and its bar.

claims.toml holds the paper's statements: its values are expressions of `known.expression_variables`, its sentences
templates of them.
"""

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import jinja2

from validation.core import store
from validation.page import page

HOLDS = "holds"
PAPER_ONLY = "holds at the paper's resolution only"
FAILS = "does not hold"
OPEN = "cannot be decided"
VERDICTS = (HOLDS, PAPER_ONLY, FAILS, OPEN)
Row = dict[str, Any]


def judged_claims(variables: Row) -> list[Row]:
    """All claims of claims.toml, judged, as they are stored; variables : of `known.expression_variables`."""
    content = store.read_packaged_toml(__package__, "claims.toml")
    out = []
    for claim in content["claim"]:
        readings = claim.get("readings", False)
        quantities: list[Row] = []
        for entry in claim.get("quantity", ()):
            quantities += converged_and_paper_value_rows(entry, content["meaning"], variables)
        verdict = claim_verdict(quantities, readings)
        why = render_sentence(claim["why"], variables | {"q": quantities})
        out.append({
            "id": claim["id"], "where": claim["where"], "claim": claim["says"], "readings": readings,
            "kind": claim.get("kind", "physics"), "quantities": quantities, "verdict": verdict, "why": why,
        })  # fmt: skip
    return out


def claim_verdict(quantities: Sequence[Row], one_is_enough: bool = False) -> str:
    """The verdict on a claim from its quantities; one_is_enough : quantities are readings of one sentence."""
    joined = max if one_is_enough else min  # or, and
    true = joined((_inside_outside_or_unclear(q, q["converged"], q["uncertainty"]) for q in quantities), default=0)
    if true >= 0:
        return HOLDS if true else OPEN
    return PAPER_ONLY if joined(_inside_outside_or_unclear(q, q["paper"]) for q in quantities) > 0 else FAILS


def _inside_outside_or_unclear(quantity: Row, value: float | None, bar: float | None = 0.0) -> int:
    """1 inside the range, -1 outside, 0 where the bar reaches across an end or is unknown."""
    if value is None or bar is None:
        return 0
    low = -math.inf if quantity["low"] is None else quantity["low"]
    high = math.inf if quantity["high"] is None else quantity["high"]
    if low <= value - bar and value + bar <= high:
        return 1
    return -1 if value + bar < low or value - bar > high else 0


def converged_and_paper_value_rows(entry: Row, meaning: Row, variables: Row) -> Iterator[Row]:
    """Yield the number of an entry, one for each of its `keys`: value, bar, and the range in which it is true."""
    for key in entry.get("keys", (None,)):
        here = variables | {"key": key}
        numbers = _claimed_range(entry, meaning, here) | _converged_and_paper_value(entry, here)
        yield {"name": render_sentence(entry["name"], here), **store.nulls_for_nonfinite(numbers)}


def _converged_and_paper_value(entry: Row, variables: Row) -> Row:
    """The value of an entry, its bar, and the value at the paper's resolution, if it names one.

    of : converged runs by scene; each gives the bar of its ladder.  paper : the paper's runs instead of them.
    r, others : a run (or number), and what else the paper may have taken: the bar is the largest change.
    """

    def value(**replaced: Any) -> float:
        return evaluate_expression(entry["value"], variables | replaced)

    of = entry.get("of", ())
    runs = variables["runs"]
    reference = variables["reference"]
    bar = evaluate_expression(entry.get("bar", 0.0), variables)
    bar += sum(reference[scene].cross_checked_error_bar(lambda run, scene=scene: value(**{scene: run})) for scene in of)
    if "r" in entry:
        first, *others = (runs.get(x, x) for x in (entry["r"], *entry.get("others", ())))
        variables = variables | {"r": first}
        bar += max((abs(value(r=x) - value()) for x in others), default=0.0)
    paper = entry.get("paper")
    if isinstance(paper, list):
        paper_runs = [runs[name] for name in paper]
        paper = value(**dict(zip(of, paper_runs, strict=True)))
    elif paper is not None:
        paper = evaluate_expression(paper, variables)
    return {"paper": paper, "converged": value(), "uncertainty": bar}


def _claimed_range(entry: Row, meaning: Row, variables: Row) -> Row:
    """The range in which the claim is true, in words and by its ends.

    meaning : numbers and reasons of words like "many".
    """
    ends = {}
    reasons = [entry.get("reason", "")]
    for name in ("around", "within", "at_least", "at_most"):
        if name in entry:
            size, reason = meaning.get(entry[name], (entry[name], ""))
            ends[name] = evaluate_expression(size, variables)
            reasons.append(reason)
    text = {name: plain_decimal_text(end) for name, end in ends.items()}
    low = ends.get("at_least")  # None: no such end
    high = ends.get("at_most")
    if "around" in ends:
        low = ends["around"] - ends["within"]
        high = ends["around"] + ends["within"]
        words = f"{text['around']} ± {text['within']}"
    elif low is None:
        words = f"at most {text['at_most']}"
    elif high is None:
        words = f"at least {text['at_least']}"
    else:
        words = f"{text['at_least']} to {text['at_most']}"
    return {"claimed": f"{words} ({next(filter(None, reasons), '')})", "low": low, "high": high}


def evaluate_expression(expression: str | float, variables: Row) -> float:
    """The value of an expression; an unknown name is an error."""
    if not isinstance(expression, str):
        return expression
    return float(page.compile_template_expression(expression)(**variables))


def render_sentence(template: str, variables: Row) -> str:
    """A template of TOML with these variables; an unknown name is an error."""
    return _TEMPLATES.from_string(template).render(variables)


def plain_decimal_text(x: float) -> str:
    """A number without an exponent: 0.000005."""
    return f"{x:.9f}".rstrip("0").rstrip(".")


def fixed_decimals(x: float | None, decimals: int = 0, factor: float = 1.0) -> str:
    """The number, or "none": a run past slack may lack the turn that is asked for."""
    return "none" if x is None or math.isnan(x) else f"{float(factor * x):.{decimals}f}"


def power_of_ten_text(x: float) -> str:
    """A number to one digit as 2·10⁻⁵."""
    mantissa, exponent = f"{x:.0e}".split("e")
    return f"{mantissa}·10{page.superscript_text(int(exponent))}"


_TEMPLATES = jinja2.Environment(undefined=jinja2.StrictUndefined, autoescape=False)
_TEMPLATES.filters |= {"d": fixed_decimals, "pct": partial(fixed_decimals, factor=100.0), "power": power_of_ten_text}
