from pathlib import Path
from typing import Annotated

import typer

from validation.page import terminal
from validation.page.options import to

EXAMPLE = "cablefem report"
# in the order of pages
PARTS = (
    ("check", "level"), ("check", "inclined"), ("check", "tramway"), ("check", "zipline"), ("paper",), ("oracles",),
    ("chart", "level", "--budget", "80"), ("advise", "level", "--tol", "1e-2"), ("modes", "bare"), ("atlas",),
)  # fmt: skip


def command(context: typer.Context, out: Annotated[Path | None, to("")] = None) -> int:
    """Run what is missing and gather all results in one HTML file.

    Each part is a command of its own, with its results in DIR/SCENE; finished parts are taken as they are, so an
    interrupted report goes on where it stopped. Writes DIR/report.html. DIR may also be the folder of one result: then
    only this is gathered.
    """
    from validation.page import report

    with report.missing(out, PARTS) as (root, missing):
        for i, part in enumerate(missing):
            terminal.say(f"part {i + 1} of {len(missing)}: cablefem {' '.join(part)}", style="bold")
            if context.obj(list(part)) == 130:  # the command line itself: each part runs as a user would run it
                raise KeyboardInterrupt
            terminal.say()
    report.gather(root, PARTS)
    return 0
