"""The paper redone: the runs behind figures 2 to 10, and a verdict on each claim."""

from collections import Counter
from pathlib import Path
from typing import Any

from cablefem.response import Response, write_json
from validation.commands.paper import judged, known
from validation.commands.paper.runs import load_or_make_and_store_runs
from validation.core.sidebyside import Progress, no_progress


def _relative_deflection(r: Response) -> float:
    return r.max_deflection / r.length


def paper(out: Path, report: Progress = no_progress, *, quick: bool = False) -> dict[str, Any]:
    """Make or reuse every run in out/runs, judge every claim, and write claims.json.

    quick : all runs by a quarter of the steps, overshoots without the longest ladders.
    """
    runs = load_or_make_and_store_runs(out, report, quick)
    numbers = known.compute_or_load_numbers(runs, out / "numbers.jsonl", report, quick)
    report("claims", 0.0)
    claims = judged.judged_claims(known.expression_variables(runs, numbers))
    counts = Counter(claim["verdict"] for claim in claims)
    references = {}
    for scene, reference in runs.reference.items():
        r = reference.ladder.finest
        references[scene] = {
            "method": r.method, "settings": r.settings, "crossed_by": reference.cross.method,
            "path_bar": reference.cross_checked_relative_path_error_bar, "slack_onset": r.slack_onset,
            "largest_v": _relative_deflection(r),
            "largest_v_bar": reference.cross_checked_error_bar(_relative_deflection),
        }  # fmt: skip
    content = {
        "quick": quick, "claims": claims, "count": {verdict: counts[verdict] for verdict in judged.VERDICTS},
        "references": references, **{name: numbers[name] for name in ("frequencies", "overshoot", "outlook")},
    }  # fmt: skip
    write_json(out / "claims.json", content)
    report("claims", 1.0)
    return content
