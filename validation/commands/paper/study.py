"""The paper redone: the runs behind figures 2 to 10, and a verdict on each claim."""

from collections import Counter
from pathlib import Path
from typing import Any

from cablefem.response import write_json
from validation.commands.paper import judged, known
from validation.commands.paper.runs import all_runs
from validation.core.sidebyside import Progress, silent


def paper(out: Path, report: Progress = silent) -> dict[str, Any]:
    """Make or reuse every run in out/runs, judge every claim, and write claims.json."""
    runs = all_runs(out, report)
    beyond = known.numbers(runs, out / "numbers.jsonl", report)
    report("claims", 0.0)
    claims = judged.claims(known.names(runs, beyond))
    counts = Counter(claim["verdict"] for claim in claims)
    content = {
        "claims": claims,
        "count": {verdict: counts[verdict] for verdict in judged.VERDICTS},
        "references": {
            scene: {
                "method": x.ladder.run.method, "settings": x.ladder.run.settings, "crossed_by": x.cross.method,
                "path_bar": x.path_bar, "slack_onset": x.ladder.run.slack_onset,
            }
            for scene, x in runs.reference.items()
        },
        "frequencies": beyond["frequencies"],
        "overshoot": beyond["overshoot"],
    }  # fmt: skip
    write_json(out / "claims.json", content)
    report("claims", 1.0)
    return content
