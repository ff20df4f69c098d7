from functools import partial
from pathlib import Path
from typing import Annotated

from validation.core.store import study_folder_name
from validation.page.options import Quick, out_option, run_and_report_study

EXAMPLE = "cablefem oracles"


def command(quick: Quick = False, out: Annotated[Path | None, out_option("oracles")] = None) -> int:
    """Hold the solvers against exact answers; --quick: a few of each kind.

    Writes DIR/: oracles.json and report.html.
    """
    from validation.commands.oracles.study import write_oracle_table

    result = run_and_report_study(
        "oracles",
        study_folder_name("oracles", quick),
        ["oracles.json", "oracles.jsonl"],
        out,
        partial(write_oracle_table, quick=quick),
    )
    return 0 if result["verdict"] == "agree" else 1
