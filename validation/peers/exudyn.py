"""Exudyn: cable elements with cubic shape functions, the mass on a joint.

Gripped: `ALEANCFCable2D` with movingMassFactor = 0; the mass on `ObjectJointALEMoving2D` with prescribed s_o(t).
Free: `ObjectJointSliding2D` on `ANCFCable2D`, from Exudyn's statics; sudden start, no thrust.
Friction and brake are the joint's `axialForce`, from the contact force of the previous step.

Element parameter: static arc length; reference strain -T/EA.  Lengths over l, forces over H, y up.
A slack cable carries compression.

The sliding joint acts where the mass was one step before; moved ahead by the way of that step, it has second order.
"""

import math
import time
from typing import Any

import numpy as np

from cablefem.scene import Groups, Motion
from validation.peers.path import Array, PeerPath, path_until_nan

# of generalised-alpha; with Exudyn's own defaults the path is wrong without an error
SPECTRAL_RADIUS = 0.5


def run_exudyn(groups: Groups, *, elements: int, steps: int) -> PeerPath:
    """The dimensionless path of the mass by Exudyn, gripped or rolling."""
    if groups.drive.mode == "free":
        return _run_free_ride(groups, elements, steps)
    motion = groups.motion
    assert motion is not None
    import exudyn
    from exudyn import itemInterface as items

    system = exudyn.SystemContainer().AddSystem()
    s = np.linspace(0.0, 1.0, elements + 1)
    _, xp, yp = groups.tension_and_slope(0.0)
    _, speed, _ = motion.position_with_rates(0.0, 0)
    zero = {"referenceCoordinates": [0.0], "initialCoordinates": [0.0]}
    s_o = system.AddNode(items.NodeGenericODE2(numberOfODE2Coordinates=1, initialCoordinates_t=[speed], **zero))
    fixed, _, on_cable = _add_cable_with_markers(system, groups, s, items.ALECable2D, (s_o,), movingMassFactor=0.0)
    velocity = [speed * float(xp), -speed * float(yp)]
    particle, at_mass = _add_particle_with_weight(system, groups, initialVelocities=velocity)
    which_element = system.AddNode(items.NodeGenericData(initialCoordinates=[0], numberOfDataCoordinates=1))
    cable: dict[str, Any] = {"slidingMarkerNumbers": on_cable, "slidingMarkerOffsets": s[:-1].tolist()}
    markers = [at_mass, on_cable[0]]
    system.AddObject(items.ALEMovingJoint2D(markerNumbers=markers, nodeNumbers=[which_element, s_o], **cable))
    driven = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=s_o, coordinate=0))
    travel = _travel_constraint_arguments(motion)
    system.AddObject(items.CoordinateConstraint(markerNumbers=[fixed, driven], **travel))
    position = exudyn.OutputVariableType.Position
    sensor = system.AddSensor(items.SensorNode(nodeNumber=particle, storeInternal=True, outputVariableType=position))

    t_end = motion.end_time
    write_period = 1e-3 * t_end / steps
    if motion.end_position >= 1.0:  # omit the last instant, on the support
        t_end *= 1.0 - 1.0 / steps
        steps -= 1
    settings = _solver_settings(t_end, steps)
    settings.solution.sensors.writePeriod = write_period
    note, seconds = _solve_with_wall_time(system.SolveDynamic, system, settings)
    t, x, y, _ = np.array(system.GetSensorStoredData(sensor)).T
    return path_until_nan(motion.position(t), np.stack([x, -y], axis=1), t, groups, seconds, note)


def _run_free_ride(groups: Groups, elements: int, steps: int) -> PeerPath:
    """Roll until the end, at most twice the quasi-static time."""
    d = groups.drive
    if d.release > 0.0 or d.thrust_table:
        raise ValueError("a free ride in Exudyn starts suddenly and has no thrust")
    import exudyn
    from exudyn import itemInterface as items

    output = exudyn.OutputVariableType
    s = 0.5 - 0.5 * np.cos(np.pi * np.linspace(0.0, 1.0, elements + 1))
    first = int(np.searchsorted(s, d.start, side="right")) - 1
    weight = groups.mu * groups.sigma
    dt = d.nominal / steps
    rest, begin = _rest_under_held_car(groups, s, first)

    system = exudyn.SystemContainer().AddSystem()
    _, _, on_cable = _add_cable_with_markers(system, groups, s, items.Cable2D, rest=rest)

    def drag_and_weight(system: Any, t: float, load: Any) -> list[float]:
        wind = np.array(system.GetNodeOutput(particle, output.Velocity)[:2]) - (d.wind, 0.0)
        x, y = -d.k * math.hypot(*wind) * wind
        return [x, y - weight, 0.0]

    particle, at_mass = _add_particle_with_weight(system, groups, drag_and_weight, initialCoordinates=list(begin[:2]))
    where = system.AddNode(items.NodeGenericData(initialCoordinates=[first, d.start], numberOfDataCoordinates=2))
    cable: dict[str, Any] = {"slidingMarkerNumbers": on_cable, "slidingMarkerOffsets": s[:-1].tolist()}
    markers = [at_mass, on_cable[first]]
    joint = system.AddObject(items.SlidingJoint2D(markerNumbers=markers, nodeNumber=where, **cable))
    rows: list[tuple[float, ...]] = []
    along = 0.0  # friction and brake

    def move_joint(system: Any, t: float) -> bool:
        """Move the joint to where the car is at the end of this step; False ends the run."""
        nonlocal along
        which, s_o = system.GetNodeOutput(where, output.Coordinates)
        x, y, _ = system.GetNodeOutput(particle, output.Position)
        distance = s_o - rows[-1][1] if rows else 0.0
        rows.append((t, s_o, x, -y))
        force = system.GetObjectOutput(joint, output.Force)
        normal = math.sqrt(max(0.0, force[0] ** 2 + force[1] ** 2 - along**2)) or weight
        step = abs(distance)
        braked = 0.0
        for at, brake_force in d.brakes:  # a brake met within the step counts in part
            share = (s_o + step - at) / max(step, 1e-12)
            braked += brake_force * min(1.0, max(0.0, share))
        along = -math.copysign(d.mu_r * normal + braked, distance)
        system.SetObjectParameter(joint, "axialForce", along)
        system.systemData.SetDataCoordinates([which, s_o + distance])
        return bool(s_o < d.end_position)

    system.SetPreStepUserFunction(move_joint)
    t_end = min(d.end_time, 2.0 * d.nominal)
    settings = _solver_settings(t_end, math.ceil(t_end / dt))
    note, seconds = _solve_with_wall_time(system.SolveDynamic, system, settings)
    t, s_o, x, y = np.array(rows).T
    return path_until_nan(s_o, np.stack([x, y], axis=1), t, groups, seconds, note)


def _rest_under_held_car(groups: Groups, s: Array, first: int) -> tuple[Array, Any]:
    """Displacements (n, 4) of the cable that holds the car at its start, on element `first`; and the car's point."""
    import exudyn
    from exudyn import itemInterface as items

    start = groups.drive.start
    system = exudyn.SystemContainer().AddSystem()
    _, bodies, _ = _add_cable_with_markers(system, groups, s, items.Cable2D)
    body = bodies[first]
    local = [start - s[first], 0.0, 0.0]
    held = system.AddMarker(items.MarkerBodyPosition(bodyNumber=body, localPosition=local))
    system.AddLoad(items.Force(markerNumber=held, loadVector=[0.0, -groups.mu * groups.sigma, 0.0]))
    settings = _solver_settings(1.0, 1)
    settings.staticSolver.numberOfLoadSteps = 20
    note, _ = _solve_with_wall_time(system.SolveStatic, system, settings)
    if note:
        raise ValueError(f"no start: {note}")
    rest = np.array(system.systemData.GetODE2Coordinates()).reshape(-1, 4)
    return rest, system.GetObjectOutputBody(body, exudyn.OutputVariableType.Position, localPosition=local)


def _add_cable_with_markers(
    system: Any, groups: Groups, s: Array, element: Any, nodes: tuple[Any, ...] = (), rest: Array | None = None,
    **more: Any,
) -> tuple[Any, list[Any], list[Any]]:  # fmt: skip
    """The fixed coordinate, the elements, the joint's markers.

    nodes : further nodes of each element; rest : (n, 4) displacements at t = 0.
    """
    from exudyn import itemInterface as items

    middle = groups.static_tension(0.5 * (s[1:] + s[:-1]))
    x, y = groups.coordinates(s)
    _, xp, yp = groups.tension_and_slope(s)
    ground = system.AddNode(items.NodePointGround())
    fixed = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=ground, coordinate=0))
    rest = np.zeros((s.size, 4)) if rest is None else rest
    ends = []
    for k in range(s.size):
        shape = [x[k], -y[k], xp[k], -yp[k]]
        node = items.NodePoint2DSlope1(referenceCoordinates=shape, initialCoordinates=list(rest[k]))
        ends.append(system.AddNode(node))
    more |= {"massPerLength": 1.0, "bendingStiffness": 0.0, "axialStiffness": groups.alpha}
    bodies = []
    on_cable = []
    for k in range(s.size - 1):
        length = float(s[k + 1] - s[k])
        strain = -middle[k] / groups.alpha
        numbers = [ends[k], ends[k + 1], *nodes]
        body = system.AddObject(element(length=length, referenceAxialStrain=strain, nodeNumbers=numbers, **more))
        bodies.append(body)
        on_cable.append(system.AddMarker(items.MarkerBodyCable2DCoordinates(bodyNumber=body)))
        inertia = system.AddMarker(items.MarkerBodyMass(bodyNumber=body))
        system.AddLoad(items.Gravity(markerNumber=inertia, loadVector=[0.0, -groups.sigma, 0.0]))
    for node in (ends[0], ends[-1]):
        for coordinate in (0, 1):
            held = system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate))
            system.AddObject(items.CoordinateConstraint(markerNumbers=[fixed, held]))
    return fixed, bodies, on_cable


def _add_particle_with_weight(
    system: Any, groups: Groups, force_function: Any = 0, **start: list[float]
) -> tuple[Any, Any]:
    """Node and marker of the mass; force_function : of the system, t and the load, in place of the weight."""
    from exudyn import itemInterface as items

    particle = system.AddNode(items.NodePoint2D(referenceCoordinates=[0.0, 0.0], **start))
    mass = system.AddObject(items.MassPoint2D(mass=groups.mu, nodeNumber=particle))
    at_mass = system.AddMarker(items.MarkerBodyPosition(bodyNumber=mass))
    weight = [0.0, -groups.mu * groups.sigma, 0.0]
    system.AddLoad(items.Force(markerNumber=at_mass, loadVector=weight, loadVectorUserFunction=force_function))
    return particle, at_mass


def _solver_settings(t_end: float, steps: int) -> Any:
    import exudyn

    settings = exudyn.SimulationSettings()
    settings.solution.file.write = False
    settings.linearSolver.solverType = exudyn.LinearSolverType.EigenSparse
    settings.timeIntegration.verboseMode = settings.staticSolver.verboseMode = 0
    settings.timeIntegration.endTime = t_end
    settings.timeIntegration.numberOfSteps = steps
    settings.timeIntegration.adaptiveStep = False
    settings.timeIntegration.generalizedAlpha.spectralRadius = SPECTRAL_RADIUS
    return settings


def _solve_with_wall_time(solve: Any, system: Any, settings: Any) -> tuple[str, float]:
    """The failure or "", and the seconds."""
    import exudyn

    exudyn.config.printToConsole = False
    note = ""
    system.Assemble()
    begin = time.perf_counter()
    try:
        solve(settings)
    except exudyn.SolverError:
        note = "Exudyn's Newton method failed"
    return note, time.perf_counter() - begin


def _travel_constraint_arguments(motion: Motion) -> dict[str, Any]:
    """s_o(t) for a constraint; a constant speed needs no calls from Exudyn's loop."""
    speeds = {speed for _, speed in motion.speeds_where_extreme}
    if len(speeds) == 1:
        return {"velocityLevel": True, "offset": speeds.pop()}
    return {"offsetUserFunction": lambda system, t, item, offset: float(motion.position(t))}
