"""The paper redone: the runs behind figures 2 to 10, and a verdict on each claim."""

from collections import Counter
from pathlib import Path
from typing import Any

from cablefem.response import write_json
from validation.commands.paper import computed, verdicts
from validation.commands.paper.runs import all_runs
from validation.commands.paper.verdicts import VERDICTS
from validation.core.sidebyside import Progress, silent


def paper(out: Path, report: Progress = silent) -> dict[str, Any]:
    """Make or reuse every run, judge every claim, and write claims.json; runs are kept in out/runs/NAME.

    Returns the content of claims.json: `claims` and `count` of verdicts; `wu_and_chen`, turning points of the path
    for both mass ratios; `references`, what the converged values rest on; and what `computed.stored` returns.
    """
    runs = all_runs(out, report)
    report("claims", 0.0)
    beyond = computed.stored(runs, out / "numbers.json")
    report("claims", 0.7)
    rows = [claim.row() for claim in verdicts.claims(computed.numbers(runs, beyond))]
    counts = Counter(row["verdict"] for row in rows)
    content = {
        "claims": rows,
        "count": {verdict: counts[verdict] for verdict in VERDICTS},
        "wu_and_chen": computed.wu_and_chen(runs),
        "references": {
            scene: {
                "method": x.run.method, "settings": x.run.settings, "crossed_by": x.cross.method,
                "path_bar": x.path_bar, "slack_onset": x.run.slack_onset,
            }
            for scene, x in runs.reference.items()
        },
        **beyond,
    }  # fmt: skip
    write_json(out / "claims.json", content)
    report("claims", 1.0)
    return content
