"""How much of the cable is modelled: internal forces of the full (u, v) cable and of one field normal to the chord.

A model turns coefficients Q (fields, n) over a basis into the internal force R (fields, n), always measured from the
hanging cable, and into its tangent.  The seam, the same in both classes:

    fields, weight         number of unknown functions; sigma j as each of them sees it, (fields,)
    at(basis, s_o)         what force and tangent need of a place of the mass, made once per instant
    force(place, Q)        R (fields, n); what `least` needs to know
    linearise(place, Q)    the same two, and dR/dQ, (fields n, fields n), field by field
    least(basis, place, pull)   the least mean tension and its s, see `GalerkinSystem.least_tension`
    static_depth(s)        depth of that shape, (n,)
    static_slope(s)        X', X'' of the static shape that the load of the mass follows, (..., fields); s () or (n,)
    stress(s, slope)       the force of one point, (..., fields), for w' = slope, and its derivative by it
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from cablefem.scene import Groups
from galerkin import kernels
from galerkin.bases.fourier import Fourier
from galerkin.bases.kink import Array, MovingBasis, TravellingKink
from galerkin.law import LAWS

MODELS = ("string", "sagged", "stretching", "full")


class FullCable:
    """The cable of (25)-(26) and (28)-(32): exact strain, both displacements.

    N t - T t_static, t = r'/|r'|, r' = X' + w', replaces N t in (25)-(26).  The static part integrates against phi' to
    the weight of the cable, which is what -sigma phi_m in (26) takes away, so the equations are the same; but taken at
    the same points as N t it vanishes with the displacement, and the hanging cable is in equilibrium to rounding.
    """

    fields = 2

    def __init__(self, groups: Groups, law: str) -> None:
        self.groups, self.alpha, self.law = groups, groups.alpha, LAWS.index(law)
        self.weight = np.array([0.0, groups.sigma])
        self._last: kernels.Points | None = None

    def at(self, basis: MovingBasis, s_o: float) -> kernels.Points:
        s, weights, phi = basis.slopes(s_o)
        if self._last is None or phi is not self._last.phi:  # a standing basis has one table for all places
            T, xp, yp, _, _ = self.groups.static(s)
            self._last = kernels.Points(s, phi, weights, T, np.array([xp, yp]))
        return self._last

    def line(self, kink: TravellingKink, behind: Array, ahead: Array, inertia: float) -> kernels.Line:
        """What compiled steps take of the cable over sines with a hat; behind, ahead : Gauss rules of both sides."""
        g, sines = self.groups, kink.basis
        assert isinstance(sines, Fourier)
        constants = kernels.Cable(inertia, g.mu, self.alpha, self.law, g.sigma, g.c)
        return kernels.Line(constants, behind, ahead, kink.at_rest, kink.left, kink.chord, sines.grading)

    def _stress(self, place: kernels.Points, Q: Array) -> Array:
        """Rows of `kernels.stress`, with the weights of the quadrature but for the elastic tension, (8, n_q)."""
        out = kernels.stress(place.T, place.r_static, Q @ place.phi, self.alpha, self.law)
        out[:7] *= place.weights
        return out

    def force(self, place: kernels.Points, Q: Array) -> tuple[Array, Array]:
        """R of (25)-(26) less its static value, (2, n); the elastic tension at the points, (n_q,)."""
        x = self._stress(place, Q)
        return x[2:4] @ place.phi.T, x[7]

    def linearise(self, place: kernels.Points, Q: Array) -> tuple[Array, Array, Array]:
        """The same two, and J1, J2, J3 of (28)-(32), the gram matrix of k I + d r' r'^T, (2 n, 2 n)."""
        x = self._stress(place, Q)
        xx, xy, yy = ((f * place.phi) @ place.phi.T for f in x[4:7])
        return x[2:4] @ place.phi.T, x[7], np.block([[xx, xy], [xy, yy]])

    def sides(self, place: kernels.Points, Q: Array) -> Array:
        """int (N t - T t_static) ds behind and ahead of the mass, rows (2, 2); of a basis with a hat."""
        behind = place.phi[-1] > 0.0
        return np.stack([behind, ~behind]) @ self._stress(place, Q)[2:4].T

    def least(self, basis: MovingBasis, place: kernels.Points, pull: Any) -> tuple[float, float]:
        """A negative tension must be so in the mean over a shortest wave, 2/n, or it is a ripple."""
        s, at = place.s, int(pull.argmin())
        if pull[at] < 0.0:
            at_mass = [1.0 / float(place.phi[-1, 0])] if isinstance(basis, TravellingKink) else []
            waves = _waves(s, [0.0, *at_mass, 1.0], basis.basis.n)
            weights = np.add.reduceat(place.weights, waves)
            pull, s = (np.add.reduceat(place.weights * x, waves) / weights for x in (pull, s))
            at = int(pull.argmin())
        return float(pull[at]), float(s[at])

    def static_slope(self, s: Any) -> tuple[Array, Array]:
        """Of the catenary."""
        _, xp, yp, xpp, ypp = self.groups.static(s)
        return np.array([xp, yp]).T, np.array([xpp, ypp]).T

    def static_depth(self, s: Array) -> Array:
        """Depth of the hanging cable, (n,)."""
        return np.asarray(self.groups.shape(s)[1])

    def points(self, s: Array, slope: Array) -> Array:
        """Rows of `kernels.stress` at s (m,) for w' = slope (2, m)."""
        T, xp, yp, _, _ = self.groups.static(s)
        return kernels.stress(T, np.array([xp, yp]), np.ascontiguousarray(slope), self.alpha, self.law)

    def stress(self, s: Array, slope: Array) -> tuple[Array, Array]:
        """N t - T t_static, and k I + d r' r'^T, at one point."""
        _, _, fx, fy, xx, xy, yy, _ = self.points(np.atleast_1d(s), slope[:, None])[:, 0]
        return np.array([fx, fy]), np.array([[xx, xy], [xy, yy]])


def _waves(s: Array, sides: list[float], n: int) -> Array:
    """Index of the first point of each piece, when every side is cut into equal pieces of about a wave 2/n."""
    edges = [np.linspace(a, b, max(2, round(0.5 * n * (b - a)) + 1))[:-1] for a, b in pairwise(sides)]
    return np.unique(np.searchsorted(s, np.concatenate(edges)))


class ChordCable:
    """One displacement w normal to the chord over a parabola: string, sagged (linear), stretching (Kirchhoff-Carrier).

    Internal force tau w' + h (y_n' + kap w'), h = alpha lam int( y_n' w' + kap w'^2/2 ) ds, tau = 1/chord_cos being the
    tension along the chord, y_n'' = -sigma chord_cos/tau and y_n' = -y_n'' (1/2 - s); (lam, kap) = string (0, 0),
    sagged (1, 0), stretching (1, 1); straight: a string with y_n'' = 0, for the theory of straight strings.  All is
    quadratic in Q by two closed-form integrals, S = int Phi' Phi' and b = int y_n' Phi' = -y_n'' int Phi (by parts,
    Phi = 0 at the supports): no quadrature.
    """

    fields = 1

    def __init__(self, groups: Groups, model: str) -> None:
        self.lam, self.kap = {"sagged": (1.0, 0.0), "stretching": (1.0, 1.0)}.get(model, (0.0, 0.0))
        self.groups, self.alpha, self.tau = groups, groups.alpha, 1.0 / groups.chord_cos
        self.weight = np.array([groups.sigma * groups.chord_cos])
        self.curvature = 0.0 if model == "straight" else -self.weight[0] / self.tau  # y_n''
        # total tension is the static one plus h everywhere: least where the static one is, at y' = 0 or a support
        self.least_at = min(1.0, max(0.0, groups.c / groups.sigma))
        self.at_rest = float(groups.static(self.least_at)[0])

    def at(self, basis: MovingBasis, s_o: float) -> tuple[Array, Array]:
        """S and b."""
        return basis.stiffness(s_o), -self.curvature * basis.integral(s_o)

    def _increment(self, place: tuple[Array, Array], Q: Array) -> tuple[Array, float, Array]:
        """S w, h, and (dh/dQ)/(alpha lam)."""
        S, b = place
        Sq = Q[0] @ S
        h = self.alpha * self.lam * (b @ Q[0] + 0.5 * self.kap * (Q[0] @ Sq))
        return Sq, h, b + self.kap * Sq

    def force(self, place: tuple[Array, Array], Q: Array) -> tuple[Array, float]:
        """R (1, n); h."""
        Sq, h, g = self._increment(place, Q)
        return (self.tau * Sq + h * g)[None], h

    def linearise(self, place: tuple[Array, Array], Q: Array) -> tuple[Array, float, Array]:
        """R and h; dR/dQ, (n, n)."""
        _, h, g = self._increment(place, Q)
        J = (self.tau + self.kap * h) * place[0] + np.multiply.outer(self.alpha * self.lam * g, g)
        return *self.force(place, Q), J

    def least(self, basis: MovingBasis, place: Any, h: Any) -> tuple[float, float]:
        """Least T(s) + h."""
        return self.at_rest + h, self.least_at

    def static_slope(self, s: Any) -> tuple[Array, Array]:
        """Of the parabola."""
        slope = -self.curvature * (0.5 - np.asarray(s))[..., None]
        return slope, np.full_like(slope, self.curvature)

    def static_depth(self, s: Array) -> Array:
        """Depth of the parabola, (n,)."""
        return np.asarray((-0.5 * self.curvature) * s * (1.0 - s))

    def stress(self, s: Array, slope: Array) -> tuple[Array, Array]:
        """tau w' alone: what one point strains adds nothing to the mean h."""
        return self.tau * slope, np.full((*slope.shape, 1), self.tau)


def cable_model(groups: Groups, model: str, law: str) -> FullCable | ChordCable:
    """The model by name; the law is the full cable's: one-field models have one h for the whole cable, slack or not."""
    if law not in LAWS:
        raise ValueError(f"unknown law {law!r}; one of {', '.join(LAWS)}")
    if model not in (*MODELS, "straight"):
        raise ValueError(f"unknown model {model!r}; one of {', '.join(MODELS)}")
    if model == "full":
        return FullCable(groups, law)
    return ChordCable(groups, model)
