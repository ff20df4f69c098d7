"""Models of the cable: the full one in (u, v), and one field normal to the chord.

From coefficients Q (fields, n), measured from the hanging cable, and `tables` = `tables_at(basis, s_o)`:

    internal_force_and_tensions(tables, Q)  the internal force R (fields, n), and `tensions`;
    force_tensions_and_tangent(tables, Q)   the same two, and dR/dQ;
    min_tension_and_position(basis, tables, tensions)  the smallest mean tension over a shortest wave, and its s;
    force_and_tangent_at_point(s, w_s)      the force of one point for w', and its derivative
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cablefem.scene import Groups
from galerkin import kernels
from galerkin.bases.kink import Array
from galerkin.law import LAWS

MODELS = ("string", "sagged", "stretching", "full")


class FullCable:
    """The cable of (25)-(26) and (28)-(32): exact strain, both displacements."""

    fields = 2
    direction = np.eye(2)  # (u, v) of unit fields

    def __init__(self, groups: Groups, law: str) -> None:
        self.groups = groups
        self.alpha = groups.alpha
        self.law = LAWS.index(law)
        self.weight = np.array([0.0, groups.sigma])

    def tables_at(self, basis: Any, s_o: float) -> kernels.Points:
        """Quadrature points, Phi' and the static cable there."""
        s, weights, phi = basis.quadrature_with_slopes(s_o)
        T, xp, yp = self.groups.tension_and_slope(s)
        return kernels.Points(s, phi, weights, T, np.array([xp, yp]))

    def _weighted_force_energy_and_tangent(self, points: kernels.Points, Q: Array) -> Array:
        """Rows of `kernels.force_energy_and_tangent`, weighted but for the last, (8, n_q)."""
        out = kernels.force_energy_and_tangent(points.T, points.static_slope, Q @ points.phi, self.alpha, self.law)
        out[:7] *= points.weights
        return out

    def internal_force_and_tensions(self, points: kernels.Points, Q: Array) -> tuple[Array, Array]:
        """R (2, n), and the elastic tensions at the points."""
        rows = self._weighted_force_energy_and_tangent(points, Q)
        return rows[2:4] @ points.phi.T, rows[7]

    def force_tensions_and_tangent(self, points: kernels.Points, Q: Array) -> tuple[Array, Array, Array]:
        """R, the tensions, and dR/dQ (2 n, 2 n)."""
        rows = self._weighted_force_energy_and_tangent(points, Q)
        phi = points.phi
        n = len(phi)
        xx, xy, yy = rows[4:7]
        K = np.empty((Q.size, Q.size))
        K[:n, :n] = (xx * phi) @ phi.T
        K[:n, n:] = (xy * phi) @ phi.T
        K[n:, n:] = (yy * phi) @ phi.T
        K[n:, :n] = K[:n, n:]
        return rows[2:4] @ phi.T, rows[7], K

    def min_tension_and_position(self, basis: Any, points: kernels.Points, tensions: Any) -> tuple[float, float]:
        s_o = 1.0 / float(points.phi[-1, 0]) if basis.kink else 1.0  # 1: one side for all
        return kernels.smoothed_min_tension_and_position(points, s_o, tensions, int(basis.kink))

    def static_slope_and_curvature(self, s: Any) -> tuple[Array, Array]:
        """r' and r'' at rest."""
        _, xp, yp, xpp, ypp = self.groups.tension_and_shape_derivatives(s)
        return np.array([xp, yp]).T, np.array([xpp, ypp]).T

    def static_depth(self, s: Array) -> Array:
        """y of the cable at rest, below the left support."""
        return np.asarray(self.groups.coordinates(s)[1])

    def pointwise_force_energy_and_tangent(self, s: Array, w_s: Array) -> Array:
        """Rows of `kernels.force_energy_and_tangent` at s (m,) for displacements of slope w' (2, m)."""
        T, xp, yp = self.groups.tension_and_slope(s)
        return kernels.force_energy_and_tangent(T, np.array([xp, yp]), np.ascontiguousarray(w_s), self.alpha, self.law)

    def force_and_tangent_at_point(self, s: Array, w_s: Array) -> tuple[Array, Array]:
        """N t - T t_static (2,) at one s for w', and its derivative (2, 2) by w'."""
        rows = self.pointwise_force_energy_and_tangent(np.atleast_1d(s), w_s[:, None])[:, 0]
        xx, xy, yy = rows[4:7]
        return rows[2:4], np.array([[xx, xy], [xy, yy]])


class ChordCable:
    """One displacement w normal to the chord: string, sagged (linear), stretching (Kirchhoff-Carrier).

    Force T_chord w' + h (y_n' + kap w'), h = alpha lam int( y_n' w' + kap w'^2/2 ) ds, T_chord = 1/chord_cos,
    y_n'' = -sigma chord_cos/T_chord (straight: 0), by S = int Phi' Phi' and b = -y_n'' int Phi.
    """

    fields = 1

    def __init__(self, groups: Groups, model: str) -> None:
        self.lam = 1.0 if model in ("sagged", "stretching") else 0.0
        self.kap = 1.0 if model == "stretching" else 0.0
        self.groups = groups
        self.alpha = groups.alpha
        self.T_chord = 1.0 / groups.chord_cos
        self.weight = np.array([groups.sigma * groups.chord_cos])
        self.direction = np.array([[-groups.chord_sin, groups.chord_cos]])
        self.curvature = 0.0 if model == "straight" else -self.weight[0] / self.T_chord  # y_n''
        # h is the same along the cable
        self.min_tension_at = min(1.0, max(0.0, groups.c / groups.sigma))
        self.static_min_tension = float(groups.static_tension(self.min_tension_at))

    def tables_at(self, basis: Any, s_o: float) -> tuple[Array, Array]:
        """S (n, n) and b (n,)."""
        return basis.stiffness_matrix(s_o), -self.curvature * basis.integrals()

    def _chord_force_rise_and_gradient(self, tables: tuple[Array, Array], Q: Array) -> tuple[Array, float, Array]:
        """S w, h, and (dh/dQ)/(alpha lam)."""
        S, b = tables
        q = Q[0]
        Sq = q @ S
        strain = b @ q + 0.5 * self.kap * (q @ Sq)  # the mean along the cable
        h = self.alpha * self.lam * strain
        return Sq, h, b + self.kap * Sq

    def internal_force_and_tensions(self, tables: tuple[Array, Array], Q: Array) -> tuple[Array, float]:
        Sq, h, g = self._chord_force_rise_and_gradient(tables, Q)
        return (self.T_chord * Sq + h * g)[None], h

    def force_tensions_and_tangent(self, tables: tuple[Array, Array], Q: Array) -> tuple[Array, float, Array]:
        """R (1, n), h and dR/dQ (n, n)."""
        _, h, g = self._chord_force_rise_and_gradient(tables, Q)
        at_fixed_h = (self.T_chord + self.kap * h) * tables[0]
        K = at_fixed_h + np.multiply.outer(self.alpha * self.lam * g, g)
        return *self.internal_force_and_tensions(tables, Q), K

    def strain_energy_and_tension_rise(self, tables: tuple[Array, Array], Q: Array) -> tuple[float, float]:
        """Strain energy and h."""
        Sq, h, _ = self._chord_force_rise_and_gradient(tables, Q)
        energy = 0.5 * self.T_chord * (Q[0] @ Sq) + 0.5 * h**2 / self.alpha
        return energy, h

    def min_tension_and_position(self, basis: Any, tables: Any, h: Any) -> tuple[float, float]:
        return self.static_min_tension + h, self.min_tension_at

    def static_slope_and_curvature(self, s: Any) -> tuple[Array, Array]:
        """Those of the parabola at rest, across the chord."""
        slope = -self.curvature * (0.5 - np.asarray(s))[..., None]
        return slope, np.full_like(slope, self.curvature)

    def static_depth(self, s: Array) -> Array:
        """Distance at rest from the chord."""
        return np.asarray((-0.5 * self.curvature) * s * (1.0 - s))

    def force_and_tangent_at_point(self, s: Array, w_s: Array) -> tuple[Array, Array]:
        """T_chord w' and its derivative: one point adds nothing to the mean h."""
        return self.T_chord * w_s, np.full((*w_s.shape, 1), self.T_chord)


def cable_model(groups: Groups, model: str, law: str) -> FullCable | ChordCable:
    """The model of this name; ValueError for an unknown one, or an unknown law."""
    if law not in LAWS:
        raise ValueError(f"unknown law {law!r}; one of {', '.join(LAWS)}")
    if model not in (*MODELS, "straight"):
        raise ValueError(f"unknown model {model!r}; one of {', '.join(MODELS)}")
    if model == "full":
        return FullCable(groups, law)
    return ChordCable(groups, model)
