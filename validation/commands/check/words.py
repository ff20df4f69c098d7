"""What a check says in the terminal."""

from dataclasses import replace

from validation.commands.check.page import agreement_sentence, third_party_verdict_and_sentence
from validation.commands.check.study import Check
from validation.core.agreement import Verdict, excess_over_tolerance_sentence
from validation.page import printing, terminal


def print_check(result: Check, verbose: bool = False) -> None:
    """Print the verdict, important numbers, and their certainty; verbose : every comparison."""
    terminal.print_verdict(result.own_verdict.value)
    printing.print_run_summary(result.scene, replace(result.a.finest, design=result.design))
    _print_quasi_static_outcome(result)
    _print_agreement(result)
    for method, flag in result.doubts:
        terminal.print_text(f"  {method}: {flag}", style="yellow")
    if shown := [row for row in result.rows if verbose or (row.decides and row.verdict is not Verdict.AGREE)]:
        terminal.print_text()
        printing.print_agreements(shown)


def _print_quasi_static_outcome(result: Check) -> None:
    """Print how the ride ends by the quasi-static model, if it has an end there."""
    ends = [event for event in result.quasi_static if event["event"] in ("arrival", "back", "stop")]
    if ends:
        terminal.print_text("  by the quasi-static model, without the inertia of the rope:")
        printing.print_last_five_events(ends[-1:])


def _print_agreement(result: Check) -> None:
    """Print how many rows of both solvers agree, and the verdict on each third party."""
    rows = [row.to_json() for row in result.rows]
    terminal.print_text(f"  {agreement_sentence([row for row in rows if not row.get('with')])}")
    for name in dict.fromkeys(row["with"] for row in rows if row.get("with")):
        worst, sentence = third_party_verdict_and_sentence(rows, name)
        terminal.print_text(f"  {name}: {sentence}", style=terminal.STYLES[worst])
    own_rows = [row for row in result.rows if not row.third_party]
    if result.own_verdict is Verdict.TOO_COARSE and (excess := excess_over_tolerance_sentence(own_rows)):
        terminal.print_text(f"  {excess}")
