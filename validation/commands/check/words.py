"""What a check says in the terminal."""

from dataclasses import replace
from typing import Any

from validation.commands.check.page import WORDS, sure, third
from validation.commands.check.study import Check
from validation.page import telling, terminal


def tell(result: Check, verbose: bool = False) -> None:
    """Print the verdict, important numbers, and their certainty."""
    terminal.say(WORDS["verdicts"][result.verdict.value], style=terminal.STYLES[result.verdict.value])
    telling.answer(result.scene, replace(result.a.run, design=result.design))
    rows = [row.row() for row in result.rows]
    terminal.say(f"  {sure([row for row in rows if not row.get('with')])}")
    for party in dict.fromkeys(row["with"] for row in rows if row.get("with")):
        worst, said = third(rows, party)
        terminal.say(f"  {party}: {said}", style=terminal.STYLES[worst])
    for row in rows:
        if row.get("asked", True) and row["verdict"] in ("disagree", "not comparable"):
            terminal.say(f"  {_line(row)}", style="yellow")
    for method, flag in result.doubts:
        terminal.say(f"  {method}: {flag}", style="yellow")
    if verbose:
        terminal.say()
        telling.rows(result.rows)


def _line(row: dict[str, Any]) -> str:
    name = ", ".join(row[key] for key in ("quantity", "law", "with") if row.get(key))
    if row.get("gap") is None or row.get("allowed") is None:
        return f"{name}: cannot be compared"
    return f"{name}: gap {row['gap']:.2g}, sum of both bars {row['allowed']:.2g}"
