"""Exudyn: ALE cable elements with cubic shape functions, the mass on a moving joint.

`ALEANCFCable2D` elements without moving mass (movingMassFactor = 0) are an ordinary cable with one more coordinate,
which only says where `ObjectJointALEMoving2D` holds the point mass; it is prescribed as s_o(t).  The parameter of
an element is the static arc length, so a reference strain -T/EA gives each the static tension of its middle.
Lengths are over l, forces over H, y is up in Exudyn.  The cable carries compression once it goes slack.

The integrator is told three things its defaults do otherwise, because by default it reports success with a path
that is wrong by several times its size: the joint is a constraint of index 3, the default spectral radius 0.9 lets
it zigzag, and adaptive steps then go on with the zigzag.  Here the radius is 0.5, a step that fails ends the run, and
what zigzags all the same is cut off.
"""

import time

import numpy as np

from cablefem.scene import Groups, Motion
from validation.peers.path import PeerPath, travel, trusted


def run(
    groups: Groups, *, elements: int, steps: int | None = None, rho_inf: float = 0.5, adaptive: bool = False
) -> PeerPath:
    """Run a scene in Exudyn on equal elements, with equal steps, by default 20 per element.

    rho_inf, adaptive : spectral radius of the generalised-alpha method, and whether steps that fail are halved.
    Counted in `seconds` is Exudyn's SolveDynamic; for a speed that varies it calls back for s_o(t).
    """
    motion = travel(groups, elements)
    steps = 20 * elements if steps is None else steps
    if not isinstance(steps, int) or steps < 2:
        raise ValueError(f"steps must be an integer >= 2, got {steps!r}")
    import exudyn
    from exudyn import itemInterface as items

    output = exudyn.OutputVariableType
    system = exudyn.SystemContainer().AddSystem()
    s = np.linspace(0.0, 1.0, elements + 1)
    middle = groups.static(0.5 * (s[1:] + s[:-1]))[0]
    x, y = groups.shape(s)
    _, xp, yp, _, _ = groups.static(s)
    speed = motion.at(0.0, 0)[1]

    ground = system.AddNode(items.NodePointGround())
    fixed = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=ground, coordinate=0))
    place_on_cable = system.AddNode(
        items.NodeGenericODE2(
            numberOfODE2Coordinates=1, referenceCoordinates=[0.0], initialCoordinates=[0.0],
            initialCoordinates_t=[speed],
        )
    )  # fmt: skip
    nodes = [
        system.AddNode(items.NodePoint2DSlope1(referenceCoordinates=[x[k], -y[k], xp[k], -yp[k]]))
        for k in range(elements + 1)
    ]
    on_cable = []
    for k in range(elements):
        element = system.AddObject(
            items.ALECable2D(
                length=1.0 / elements, massPerLength=1.0, movingMassFactor=0.0, bendingStiffness=0.0,
                axialStiffness=groups.alpha, referenceAxialStrain=-middle[k] / groups.alpha,
                nodeNumbers=[nodes[k], nodes[k + 1], place_on_cable],
            )
        )  # fmt: skip
        on_cable.append(system.AddMarker(items.MarkerBodyCable2DCoordinates(bodyNumber=element)))
        body = system.AddMarker(items.MarkerBodyMass(bodyNumber=element))
        system.AddLoad(items.Gravity(markerNumber=body, loadVector=[0.0, -groups.sigma, 0.0]))
    for node in (nodes[0], nodes[-1]):
        for coordinate in (0, 1):
            held = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate))
            system.AddObject(items.CoordinateConstraint(markerNumbers=[fixed, held]))

    particle = system.AddNode(
        items.NodePoint2D(referenceCoordinates=[0.0, 0.0], initialVelocities=[speed * xp[0], -speed * yp[0]])
    )
    mass = system.AddObject(items.MassPoint2D(mass=groups.mu, nodeNumber=particle))
    at_mass = system.AddMarker(items.MarkerBodyPosition(bodyNumber=mass))
    system.AddLoad(items.Force(markerNumber=at_mass, loadVector=[0.0, -groups.mu * groups.sigma, 0.0]))
    which_element = system.AddNode(items.NodeGenericData(initialCoordinates=[0], numberOfDataCoordinates=1))
    system.AddObject(
        items.ALEMovingJoint2D(
            markerNumbers=[at_mass, on_cable[0]], slidingMarkerNumbers=on_cable,
            slidingMarkerOffsets=[float(offset) for offset in s[:-1]], nodeNumbers=[which_element, place_on_cable],
        )
    )  # fmt: skip
    driven = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=place_on_cable, coordinate=0))
    system.AddObject(items.CoordinateConstraint(markerNumbers=[fixed, driven], **_drive(motion)))
    sensor = system.AddSensor(
        items.SensorNode(nodeNumber=particle, storeInternal=True, outputVariableType=output.Position)
    )

    t_end = motion.phases[-1][1]
    on_support = motion.end >= 1.0  # there the boundary condition would answer: leave out the last instant
    settings = exudyn.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = 1e-3 * t_end / steps  # less than a step: every step
    settings.linearSolver.solverType = exudyn.LinearSolverType.EigenSparse
    settings.timeIntegration.verboseMode = 0
    settings.timeIntegration.endTime = t_end * (1.0 - 1.0 / steps) if on_support else t_end
    settings.timeIntegration.numberOfSteps = steps - 1 if on_support else steps
    settings.timeIntegration.adaptiveStep = adaptive
    settings.timeIntegration.generalizedAlpha.spectralRadius = rho_inf

    talkative, note = exudyn.config.printToConsole, ""
    exudyn.config.printToConsole = False
    try:
        system.Assemble()
        begin = time.perf_counter()
        try:
            system.SolveDynamic(settings)
        except exudyn.SolverError:
            note = "Exudyn's Newton method failed"
        seconds = time.perf_counter() - begin
    finally:
        exudyn.config.printToConsole = talkative
    history = np.array(system.GetSensorStoredData(sensor))  # (n, 4): t, x, y, z
    s_o = motion.position(history[:, 0])
    if note:
        note = f"{note} after s_o/l = {s_o[-1]:.4f}"
    return trusted(s_o, history[:, 1:3] * (1.0, -1.0), history[:, 0], groups, seconds, note)


def _drive(motion: Motion) -> dict:
    """Say s_o(t) to a constraint: a constant speed as a number, any other travel as functions that are called back."""
    speed = motion.at(0.0, 0)[1]
    t = np.linspace(0.0, motion.phases[-1][1], 1001)
    if np.abs(motion.position(t) - speed * t).max() <= 1e-12:
        return {"velocityLevel": True, "offset": speed}

    def at(t: float) -> tuple[float, float, float]:
        phase = next((i for i, (_, stop) in enumerate(motion.phases) if t <= stop), len(motion.phases) - 1)
        return motion.at(t, phase)

    return {
        "offsetUserFunction": lambda system, t, item, offset: at(t)[0],
        "offsetUserFunction_t": lambda system, t, item, offset: at(t)[1],
    }
