from pathlib import Path
from typing import Annotated

from validation.page.options import study, to

EXAMPLE = "cablefem atlas"


def command(out: Annotated[Path | None, to("atlas")] = None) -> int:
    """Map where methods fail, and what helps.

    Writes DIR/: atlas.json and report.html.
    """
    from validation.commands.atlas.study import atlas

    study("atlas", "atlas", ["atlas.json", "cells.jsonl"], out, atlas)
    return 0
