"""What a check says in the terminal."""

from dataclasses import replace

from validation.commands.check.study import Check
from validation.core.trust import reach
from validation.page import telling, terminal


def tell(result: Check) -> None:
    """Print the answer, where it stops being meaningful, and the verdict row by row and in one line."""
    telling.answer(replace(result.a.run, design=result.design))
    if result.a.run.drive != "free":  # one is compared to its end
        terminal.say(f"  {_meaning(result)}")
    if result.entry is not None:
        path, *tensions = result.entry.values()
        terminal.say(
            f"  a smooth entry over the first 2 % (entry_ramp in [travel]) would move the path by {path:.2g} of the "
            f"deflection, tension at the mass by {max(tensions):.2g} H (rms)"
        )
    terminal.say()
    telling.rows(result.rows)
    third = sorted({row.party for row in result.rows} - {""})
    *others, last = [result.a.run.method, result.b.run.method, *third]
    word = {
        "agree": "agree", "disagree": "DISAGREE", "not comparable": "are NOT COMPARABLE",
        "too coarse": "are TOO COARSE to tell",
    }[result.verdict.value]  # fmt: skip
    low, high = result.window
    over = f" over s_o/l = {low:g} to {high:.3g}" if low < high else ""
    over = f" over {result.a.run.t[-1]:.4g} s" if result.a.run.drive == "free" else over
    terminal.say()
    terminal.say(f"{', '.join(others)} and {last} {word}{over}", style=terminal.STYLES[result.verdict.value])
    for method, flag in result.doubts:
        if flag not in result.a.run.flags:  # those are told with the answer
            terminal.say(f"  {method}: {flag}", style="yellow")


def _meaning(result: Check) -> str:
    """Say how far past the compared range both answers are still one answer."""
    allowed = next((row.allowed for row in result.rows if row.quantity == "path_max" and not row.party), None)
    found = reach(result.a.response, result.b.response, result.window[1], allowed)
    if found is None:
        return "past that range there is no answer"
    if found.place is None:
        return f"past that range the paths stay within {found.gap:.2g} of the deflection, up to s_o/l = {found.end:.3f}"
    parted = f"the paths part by {found.gap:.2g} of the deflection"
    return f"past s_o/l = {found.place:.3f} this stops being meaningful: {parted}"
