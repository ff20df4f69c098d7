from functools import partial
from pathlib import Path
from typing import Annotated

from validation.core.store import study_folder_name
from validation.page.options import Quick, out_option, run_and_report_study

EXAMPLE = "cablefem atlas"


def command(quick: Quick = False, out: Annotated[Path | None, out_option("atlas")] = None) -> int:
    """Map where methods fail, and what helps; --quick: every fifth value and failure.

    Writes DIR/: atlas.json and report.html. The exit code is 1 where a failure does not show as described, or its
    remedy does not help.
    """
    from validation.commands.atlas.study import atlas

    result = run_and_report_study(
        "atlas", study_folder_name("atlas", quick), ["atlas.json", "cells.jsonl"], out, partial(atlas, quick=quick)
    )
    return 0 if result["verdict"] == "agree" else 1
