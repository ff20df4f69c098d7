from typing import Annotated

from validation.core import store
from validation.page.options import (
    Out,
    SceneName,
    load_line_printing_notes_or_none,
    load_scene_printing_notes_or_refuse,
    number_option,
    run_and_report_study,
    tolerance_faults,
)

EXAMPLE = "cablefem advise inclined --tol 1e-2"


def command(
    scene: SceneName,
    tol: Annotated[
        float, number_option("--tol", "Error of the mass path that is good enough; of forces ten times it.")
    ],
    out: Out = None,
) -> int:
    """Find the simplest model and cheapest method for a scene; of a line in motion, whether rest or points do.

    Writes DIR/: advice.json, with the evidence, and report.html.
    """
    line = load_line_printing_notes_or_none(scene)
    if line is not None and line.moves:
        from validation.commands.advise.lines import advise_on_line_and_write

        if faults := tolerance_faults(tol):
            raise store.Refused(faults)
        run_and_report_study("advise", line, ["advice.json"], out, advise_on_line_and_write, line, tol)
        return 0
    loaded = load_scene_printing_notes_or_refuse(scene, tolerance_faults(tol), needs_mass=True)

    from validation.commands.advise.study import advise

    run_and_report_study("advise", loaded, ["advice.json"], out, advise, loaded, tol)
    return 0
