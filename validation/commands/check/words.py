"""What a check says in the terminal."""

from __future__ import annotations

import math

import numpy as np

from validation import telling, terminal
from validation.commands.check.study import Check
from validation.core import measures

MEANINGFUL = 1e-2  # of the largest deflection: paths further apart are two answers


def tell(result: Check) -> None:
    """Print the verdict row by row and in one line, the answer, and where it stops being meaningful."""
    telling.rows(result.rows)
    third = sorted({row.party for row in result.rows} - {""})
    *others, last = [result.a.run.method, result.b.run.method, *third]
    word = {
        "agree": "agree", "disagree": "DISAGREE", "not comparable": "are NOT COMPARABLE",
        "too coarse": "are TOO COARSE to tell",
    }[result.verdict.value]  # fmt: skip
    low, high = result.window
    over = f" over s_o/l = {low:g} to {high:.3g}" if low < high else ""
    terminal.say()
    terminal.say(f"{', '.join(others)} and {last} {word}{over}", style=terminal.STYLES[result.verdict.value])
    for method, flag in result.doubts:
        if flag not in result.a.run.flags:  # those are told with the answer
            terminal.say(f"  {method}: {flag}", style="yellow")
    telling.answer(result.a.run)
    terminal.say(f"  {_meaning(result)}")


def _meaning(result: Check) -> str:
    """Say how far past the compared range both answers are still one answer."""
    a, b, stop = result.a.response, result.b.response, result.window[1]
    end = min(a.reached, b.reached)
    allowed = next((row.allowed for row in result.rows if row.quantity == "path_max"), math.nan)
    bound = max(MEANINGFUL, 2.0 * allowed if math.isfinite(allowed) else 0.0)
    for place in np.arange(stop + 0.005, end, 0.005).tolist():
        try:
            if measures.path_gap(a, b, (stop, place))[0] > bound:
                parted = f"the paths part by {bound:.2g} of the deflection"
                return f"past s_o/l = {place:.3f} this stops being meaningful: {parted}"
        except measures.NotComparable:  # too few steps yet
            continue
    return f"past that range the paths stay within {bound:.2g} of the deflection, up to s_o/l = {end:.3f}"
