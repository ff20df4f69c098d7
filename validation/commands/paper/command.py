from pathlib import Path
from typing import Annotated

from validation.page.options import study, to

EXAMPLE = "cablefem paper"


def command(out: Annotated[Path | None, to("paper")] = None) -> int:
    """Redo the paper's figures; a verdict on each claim.

    Writes DIR/: claims.json and report.html.
    """
    from validation.commands.paper.study import paper

    study("paper", "paper", ["claims.json", "numbers.jsonl", "runs"], out, paper)
    return 0
