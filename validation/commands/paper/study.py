"""The paper redone: the runs behind figures 2 to 10, and a verdict on each claim."""

from collections import Counter
from pathlib import Path
from typing import Any

from cablefem.response import Response, write_json
from validation.commands.paper import judged, known
from validation.commands.paper.runs import all_runs
from validation.core.sidebyside import Progress, silent


def _largest_v(r: Response) -> float:
    return r.max_deflection / r.length


def paper(out: Path, report: Progress = silent, *, quick: bool = False) -> dict[str, Any]:
    """Make or reuse every run in out/runs, judge every claim, and write claims.json.

    quick : all runs by a quarter of the steps, overshoots without the longest ladders.
    """
    runs = all_runs(out, report, quick)
    beyond = known.numbers(runs, out / "numbers.jsonl", report, quick)
    report("claims", 0.0)
    claims = judged.claims(known.names(runs, beyond))
    counts = Counter(claim["verdict"] for claim in claims)
    content = {
        "quick": quick,
        "claims": claims,
        "count": {verdict: counts[verdict] for verdict in judged.VERDICTS},
        "references": {
            scene: {
                "method": x.ladder.run.method, "settings": x.ladder.run.settings, "crossed_by": x.cross.method,
                "path_bar": x.path_bar, "slack_onset": x.ladder.run.slack_onset,
                "largest_v": _largest_v(x.ladder.run), "largest_v_bar": x.bar(_largest_v),
            }
            for scene, x in runs.reference.items()
        },
        "frequencies": beyond["frequencies"],
        "overshoot": beyond["overshoot"],
    }  # fmt: skip
    write_json(out / "claims.json", content)
    report("claims", 1.0)
    return content
