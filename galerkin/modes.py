"""Frequencies of the cable without a mass."""

from typing import Any

import numpy as np
from scipy.linalg import eigh

from cablefem.scene import Groups
from galerkin.bases import Basis
from galerkin.bases.kink import Array, KinkedBasis
from galerkin.models import cable_model


def scaled_frequencies(groups: Groups, basis: Basis, *, model: str = "full", n: int | None = 10) -> Array:
    """First n frequencies (None: all) omega l sqrt(rho/H) of the bare cable, ascending, (n,): (19)-(26) linearised."""
    cable = cable_model(groups, model, "elastic")
    moving = KinkedBasis(basis, kink=False)
    tables: Any = cable.tables_at(moving, 0.5)
    K = cable.force_tensions_and_tangent(tables, np.zeros((cable.fields, basis.n)))[2]
    M = np.kron(np.eye(cable.fields), basis.mass_matrix())
    return np.sqrt(eigh(K, M, eigvals_only=True)[:n])
