from functools import partial
from typing import Annotated

import typer

from validation.page.options import (
    Out,
    SceneName,
    load_line_printing_notes_or_none,
    load_scene_printing_notes_or_refuse,
    run_and_report_study,
)

EXAMPLE = "cablefem chart level"


def command(
    scene: SceneName,
    budget: Annotated[
        float, typer.Option(metavar="S", min=1.0, help="Seconds for all runs; then the page is drawn.")
    ] = 240.0,
    out: Out = None,
) -> int:
    """Chart speed against accuracy of every method on a scene, or of both solvers on a line in motion.

    Writes DIR/: chart.json and report.html.
    """
    line = load_line_printing_notes_or_none(scene)
    if line is not None and line.moves:
        from validation.commands.chart.lines import chart_line_and_write

        run_and_report_study("chart", line, ["chart.json"], out, partial(chart_line_and_write, budget=budget), line)
        return 0
    loaded = load_scene_printing_notes_or_refuse(scene, needs_mass=True)

    from validation.commands.chart.study import chart

    run_and_report_study("chart", loaded, ["chart.json"], out, partial(chart, budget=budget), loaded)
    return 0
