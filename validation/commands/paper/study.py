"""The paper redone: the runs behind figures 2 to 10, and a verdict on each claim."""

from collections import Counter
from pathlib import Path
from typing import Any

from cablefem.response import write_json
from validation.commands.paper import computed, verdicts
from validation.commands.paper.runs import FINE, REFERENCES, Progress, all_runs, path_bar
from validation.commands.paper.verdicts import VERDICTS


def paper(out: Path, progress: Progress | None = None) -> dict[str, Any]:
    """Make or reuse every run, judge every claim, and write claims.json; runs are kept in out/runs/NAME.

    Returns the content of claims.json: `claims` (id, where, claim, quantities, verdict, why), `count` of verdicts,
    `wu_and_chen` (turning points of the path for both mass ratios), `references` (what the converged values rest on),
    `frequencies` (figure 2), `overshoot` beside the mass and energy in free `vibration`.
    """
    report = progress or (lambda label, done: None)
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
                "method": FINE[0], "settings": runs.reference[scene].run.settings,
                "crossed_by": runs.reference[scene].cross.method,
                "path_bar": path_bar(runs.reference[scene]), "slack_onset": runs.reference[scene].run.slack_onset,
            }
            for scene in REFERENCES
        },
        **beyond,
    }  # fmt: skip
    write_json(out / "claims.json", content)
    report("claims", 1.0)
    return content
