from typing import Annotated

from validation.page.options import Out, SceneName, number, scene_named, study, tol_faults

EXAMPLE = "cablefem advise inclined --tol 1e-2"


def command(
    scene: SceneName,
    tol: Annotated[float, number("--tol", "Error of the mass path that is good enough; of forces ten times it.")],
    out: Out = None,
) -> int:
    """Find the simplest model and cheapest method for a scene.

    Writes DIR/: advice.json, with the evidence, and report.html.
    """
    loaded = scene_named(scene, tol_faults(tol), travelling=True)

    from validation.commands.advise.study import advise

    study("advise", loaded, ["advice.json"], out, advise, loaded, tol)
    return 0
