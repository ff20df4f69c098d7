from pathlib import Path
from typing import Annotated

import typer

from validation.core import store
from validation.page import terminal
from validation.page.options import Quick, out_option

EXAMPLE = "cablefem report"
# in the order of pages
PARTS = (
    ("check", "level"), ("check", "inclined"), ("check", "tramway"), ("check", "zipline"), ("paper",), ("oracles",),
    ("chart", "level", "--budget", "80"), ("advise", "level", "--tol", "1e-2"), ("modes", "bare"), ("atlas",),
)  # fmt: skip
QUICK_PARTS = (
    ("check", "level", "--tol", "1e-2"), ("paper", "--quick"), ("oracles", "--quick"),
    ("chart", "level", "--budget", "1"), ("advise", "level", "--tol", "5e-2"), ("modes", "bare"),
)  # fmt: skip


def command(context: typer.Context, quick: Quick = False, out: Annotated[Path | None, out_option("")] = None) -> int:
    """Run what is missing and gather all results in one HTML file; --quick: less of each, in DIR/report-quick.

    Each part is a command of its own, with its results in DIR/SCENE; finished parts are taken as they are, so an
    interrupted report goes on where it stopped. Writes DIR/report.html. DIR may also be the folder of one result: then
    only this is gathered. Where something is red, a part that broke among it, the exit code is 1.
    """
    from validation.page import report

    parts = QUICK_PARTS if quick else PARTS
    if quick and out is None:
        out = store.ROOT / "report-quick"
    root = out or store.ROOT
    missing = report.claim_and_list_missing_parts(root, parts)
    broken = []
    for i, part in enumerate(missing):
        terminal.print_text(f"part {i + 1} of {len(missing)}: cablefem {' '.join(part)}", style="bold")
        try:  # the command line itself: each part runs as a user would run it
            context.obj([*part, "--out", str(root / report.folder_name_of_part(part))])
        except BrokenPipeError:
            raise
        except Exception as error:  # the other parts are still worth having
            faults = terminal.fault_sentences(error)
            terminal.print_faults(faults)
            broken.append(report.section_of_broken_part(part, faults))
        terminal.print_text()
    sections = report.write_and_print_combined_report(root, parts, broken)
    return int(any(section.verdict == "disagree" for section in sections))
