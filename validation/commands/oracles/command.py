from pathlib import Path
from typing import Annotated

from validation.page.options import study, to

EXAMPLE = "cablefem oracles"


def command(out: Annotated[Path | None, to("oracles")] = None) -> int:
    """Hold the solvers against exact answers.

    Writes DIR/: oracles.json and report.html.
    """
    from validation.commands.oracles.study import oracle_table

    found = study("oracles", "oracles", ["oracles.json", "oracles.jsonl"], out, oracle_table)
    return 0 if found["verdict"] == "agree" else 1
