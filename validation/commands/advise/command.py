from typing import Annotated

from validation.core import store
from validation.page.options import Out, SceneName, line_named, number, scene_named, study, tol_faults

EXAMPLE = "cablefem advise inclined --tol 1e-2"


def command(
    scene: SceneName,
    tol: Annotated[float, number("--tol", "Error of the mass path that is good enough; of forces ten times it.")],
    out: Out = None,
) -> int:
    """Find the simplest model and cheapest method for a scene; of a line in motion, whether cars may be points.

    Writes DIR/: advice.json, with the evidence, and report.html.
    """
    line = line_named(scene)
    if line is not None and any(car.hanger or (car.wheels and car.wheels.inertia) for car in line.car):
        from validation.commands.advise import bodies

        if faults := tol_faults(tol):
            raise store.Refused(faults)
        study("advise", line, ["advice.json"], out, bodies.advise, line, tol)
        return 0
    loaded = scene_named(scene, tol_faults(tol), travelling=True)

    from validation.commands.advise.study import advise

    study("advise", loaded, ["advice.json"], out, advise, loaded, tol)
    return 0
