"""OpenSees (openseespy): corotational trusses, the mass handed on from node to node.

Nodes lie at s_k = s_o(k dt).  At the end of step k the mass is a nodal mass of node k.
Its position p follows Newmark's formula; with q* = q + dt q. + (1/2 - beta) dt^2 q.. for p and u, node k at X_k + u:

    M p.. = M (X_k + u - p*) / (beta dt^2) = M u.. + M (X_k - p* + u*) / (beta dt^2),

a nodal mass and a load.  Lengths over l, forces over H, y up.  A slack cable carries compression.
"""

import math
import os
import time
from typing import Any

import numpy as np

from cablefem.scene import Groups
from validation.peers.path import Array, PeerPath, path_until_nan

HHT = 0.9  # Hilber, Hughes & Taylor; 1, the trapezoidal rule, is unstable here
NEWMARK_GAMMA = 1.5 - HHT
NEWMARK_BETA = 0.25 * (2.0 - HHT) ** 2


def run_opensees_step_per_element(groups: Groups, *, elements: int) -> PeerPath:
    """`elements` are those passed by the mass, one step each."""
    motion = groups.motion
    assert motion is not None
    import openseespy.opensees as ops

    t = np.linspace(0.0, motion.end_time, elements + 1)
    s = motion.position(t)
    end = motion.end_position
    last = elements - 1  # omit the support itself
    beyond = 0
    if end < 1.0:
        last = elements
        beyond = max(1, math.ceil((1.0 - end) * elements / end))
    ahead = np.linspace(end, 1.0, beyond + 1)[1:]
    passed = np.stack(groups.coordinates(s[: last + 1]), axis=1)
    _build_cable_model(ops, groups, np.append(s, ahead))
    try:
        positions, seconds = _run_travel_with_wall_time(ops, groups, t[: last + 1], passed)
    finally:
        ops.wipe()
    n = positions.shape[0]
    note = "" if n > last else "OpenSees' Newton method failed"
    return path_until_nan(s[:n], positions, t[:n], groups, seconds, note)


def _build_cable_model(ops: Any, groups: Groups, s: Array) -> None:
    """Make nodes, trusses, weights and the time scheme anew."""
    x, y = groups.coordinates(s)
    dx = np.diff(x)
    dy = np.diff(y)
    ds = np.diff(s)
    chord = np.hypot(dx, dy)
    ops.wipe()
    ops.logFile(os.devnull, "-noEcho")
    ops.model("basic", "-ndm", 2, "-ndf", 2)
    for k in range(s.size):
        ops.node(k, float(x[k]), float(-y[k]))
    for k in (0, s.size - 1):
        ops.fix(k, 1, 1)
    ops.uniaxialMaterial("Elastic", 0, groups.alpha)
    for k in range(s.size - 1):
        # horizontal tension 1; mass of the arc
        ops.uniaxialMaterial("InitStressMaterial", k + 1, 0, float(chord[k] / dx[k]))
        ops.element("corotTruss", k, k, k + 1, 1.0, k + 1, "-rho", float(ds[k] / chord[k]))
    ops.timeSeries("Constant", 0)
    ops.pattern("Plain", 0, 0)
    for k, weight in enumerate(-np.diff(dy / dx), start=1):
        ops.load(k, 0.0, float(-weight))
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("BandGeneral")
    ops.test("NormDispIncr", 1e-9, 25, 0)
    ops.algorithm("Newton")
    ops.integrator("HHT", HHT)
    ops.analysis("Transient")


def _run_travel_with_wall_time(ops: Any, groups: Groups, t: Array, nodes: Array) -> tuple[Array, float]:
    """Run the travel over the nodes (n, 2) at times t: positions of the mass (n, 2), y down, and the seconds."""
    assert groups.motion is not None
    mass = groups.mu
    weight = np.array([0.0, -groups.mu * groups.sigma])
    up = np.array([1.0, -1.0])
    X = nodes * up
    dt = float(t[1] - t[0])
    _, ds, dds = groups.motion.position_with_rates(0.0, 0)
    _, xp, yp = groups.tension_and_slope(0.0)
    along = np.array([float(xp), -float(yp)])
    # free fall at first; from rest along the cable
    p = X[0]
    dp = ds * along
    ddp = weight / mass if ds > 0.0 else dds * along
    inertia = mass / (NEWMARK_BETA * dt * dt)
    positions = [p]
    begin = time.perf_counter()
    for k in range(1, t.size):
        if k > 1:
            ops.mass(k - 1, 0.0, 0.0)
            ops.remove("loadPattern", 1)
        ops.mass(k, mass, mass)
        u = np.array(ops.nodeDisp(k))
        du = np.array(ops.nodeVel(k))
        ddu = np.array(ops.nodeAccel(k))
        u_star = u + dt * du + (0.5 - NEWMARK_BETA) * dt * dt * ddu
        p_star = p + dt * dp + (0.5 - NEWMARK_BETA) * dt * dt * ddp
        load = weight - inertia * (X[k] - p_star + u_star)
        ops.pattern("Plain", 1, 0)
        ops.load(k, float(load[0]), float(load[1]))
        if ops.analyze(1, dt) != 0:
            break
        p = X[k] + np.array(ops.nodeDisp(k))
        before = ddp
        ddp = (p - p_star) / (NEWMARK_BETA * dt * dt)
        dp = dp + dt * ((1.0 - NEWMARK_GAMMA) * before + NEWMARK_GAMMA * ddp)
        positions.append(p)
    return np.array(positions) * up, time.perf_counter() - begin
