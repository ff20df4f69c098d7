from functools import partial
from pathlib import Path
from typing import Annotated

from validation.core.store import study_folder_name
from validation.page.options import Quick, out_option, run_and_report_study

EXAMPLE = "cablefem paper"


def command(quick: Quick = False, out: Annotated[Path | None, out_option("paper")] = None) -> int:
    """Redo the paper's figures; a verdict on each claim; --quick: by a quarter of the steps.

    Writes DIR/: claims.json and report.html.
    """
    from validation.commands.paper.study import paper

    writes = ["claims.json", "numbers.jsonl", "runs"]
    run_and_report_study("paper", study_folder_name("paper", quick), writes, out, partial(paper, quick=quick))
    return 0
