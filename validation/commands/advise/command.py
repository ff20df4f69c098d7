from typing import Annotated

from validation.core import store
from validation.page.options import Out, SceneName, line_named, number_option, run_study, scene_named, tolerance_faults

EXAMPLE = "cablefem advise inclined --tol 1e-2"


def command(
    scene: SceneName,
    tol: Annotated[
        float, number_option("--tol", "Error of the mass path that is good enough; of forces ten times it.")
    ],
    out: Out = None,
) -> int:
    """Find the simplest model and cheapest method for a scene; of a line in motion, whether cars may be points.

    Writes DIR/: advice.json, with the evidence, and report.html.
    """
    line = line_named(scene)
    if line is not None and any(car.hanger or (car.wheels and car.wheels.inertia) for car in line.car):
        from validation.commands.advise import bodies

        if faults := tolerance_faults(tol):
            raise store.Refused(faults)
        run_study("advise", line, ["advice.json"], out, bodies.advise, line, tol)
        return 0
    loaded = scene_named(scene, tolerance_faults(tol), travelling=True)

    from validation.commands.advise.study import advise

    run_study("advise", loaded, ["advice.json"], out, advise, loaded, tol)
    return 0
