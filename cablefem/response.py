"""What a run returns: the mass path and the fields in SI units, with the work done and where it came from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class States:
    """History of a run, stacked: t (n,), q, v, a (n, n_dof), phase (n,); the solver's own dimensionless units."""

    t: Array
    q: Array
    v: Array
    a: Array
    phase: NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Observation:
    """What every system measures on its own states, with the same meaning in both solvers; dimensionless.

    Lengths over l, forces over H, time over l sqrt(rho/H).  n instants, k frames, m stations.
    """

    path: Array  # (n, 2) displacement (u, v) of the mass, w(s_o, t)
    path_velocity: Array  # (n, 2) d/dt of the place of the mass, X(s_o) + w(s_o, t)
    path_acceleration: Array  # (n, 2) d2/dt2 of it
    slope_behind: Array  # (n, 2) one-sided r' = X' + w' at the mass
    slope_ahead: Array  # (n, 2)
    T_behind: Array  # (n,) one-sided total tension at the mass; nan where the mass is on the left support
    T_ahead: Array  # (n,) nan where it is on the right one
    energy: Array  # (n,) of cable and mass
    power: Array  # (n,) dE/dt as the drive and the passing kink give it
    tension_min: Array  # (n,) least total tension over all quadrature points
    tension_min_at: Array  # (n,) its s
    u: Array  # (k, m) fields at frames x stations; at s = s_o the side behind
    v: Array  # (k, m)
    du: Array  # (k, m) time derivatives at fixed s
    dv: Array  # (k, m)
    T: Array  # (k, m)
