"""How much of the cable is modelled: internal forces of the full (u, v) cable and of one field normal to the chord.

A model turns coefficients Q (fields, n) over a basis into the internal force R (fields, n), always measured from the
hanging cable, and into its tangent.  The seam, the same in both classes:

    fields, weight         number of unknown functions; sigma j as each of them sees it, (fields,)
    at(basis, s_o)         what force and tangent need of a place of the mass, made once per instant
    force(place, Q)        R (fields, n); the least total tension and its s (see `cablefem.newmark.System`)
    linearise(place, Q)    the same two, and dR/dQ, (fields n, fields n), field by field
    static_slope(s)        X', X'' of the static shape that the load of the mass follows, (..., fields); s () or (n,)
    stress(s, slope)       the force of one point, (..., fields), for w' = slope, and its derivative by it
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cablefem.scene import Groups
from galerkin.bases.kink import Array, MovingBasis

MODELS = ("string", "sagged", "stretching", "full")
LAWS = ("elastic", "tension-only")


class Points(NamedTuple):
    """Where the full cable takes its integrals, with the static cable there."""

    s: Array  # (n_q,)
    table: Array  # Phi', (n_q, n)
    weights: Array
    T: Array
    r_static: Array  # x', y', (2, n_q)
    basis: MovingBasis
    sides: tuple[float, ...]  # see `MovingBasis.sides`


class FullCable:
    """The cable of (25)-(26) and (28)-(32): exact strain, both displacements.

    N t - T t_static, t = r'/|r'|, r' = X' + w', replaces N t in (25)-(26).  The static part integrates against phi' to
    the weight of the cable, which is what -sigma phi_m in (26) takes away, so the equations are the same; but taken at
    the same points as N t it vanishes with the displacement, and the hanging cable is in equilibrium to rounding.
    """

    fields = 2

    def __init__(self, groups: Groups, law: str) -> None:
        self.groups, self.alpha, self.tension_only = groups, groups.alpha, law == "tension-only"
        self.weight = np.array([0.0, groups.sigma])
        self._last: Points | None = None

    def at(self, basis: MovingBasis, s_o: float) -> Points:
        s, weights, table = basis.slopes(s_o)
        if self._last is None or table is not self._last.table:  # a standing basis has one table for all places
            T, xp, yp, _, _ = self.groups.static(s)
            self._last = Points(s, table, weights, T, np.array([xp, yp]), basis, basis.sides(s_o))
        return self._last

    def response(self, T: Array, xp: Array, yp: Array, ux: Array, vy: Array) -> tuple[Array, ...]:
        """eps, k = N/|r'|, k - T, d = (N' |r'| - N)/|r'|^3 of (28)-(32), and N, for slopes w' = (ux, vy)."""
        e = (2.0 * xp + ux) * ux + (2.0 * yp + vy) * vy
        square = 1.0 + e
        stretch = np.sqrt(square)
        eps = e / (1.0 + stretch)  # sqrt(1 + e) - 1 without cancellation
        less = self.alpha - T
        N = T + self.alpha * eps
        k, excess, d = N / stretch, less * eps / stretch, less / (square * stretch)
        if self.tension_only:
            slack = N < 0.0
            if slack.any():
                N, k, d = (np.where(slack, 0.0, x) for x in (N, k, d))
                excess = np.where(slack, -T, excess)
        return eps, k, excess, d, N

    def force(self, place: Points, Q: Array) -> tuple[Array, tuple[float, float]]:
        """R of (25)-(26) less its static value, (2, n); least N, and its s."""
        R, least, _, _, _ = self._force(place, Q)
        return R, least

    def _force(self, place: Points, Q: Array) -> tuple[Array, tuple[float, float], Array, Array, Array]:
        """R, the least N and its s, and what the tangent shares with them: w', k, d at the points."""
        T, r_static = place.T, place.r_static
        slope = Q @ place.table.T
        eps, k, excess, d, _ = self.response(T, *r_static, *slope)
        R = (place.weights * (excess * r_static + k * slope)) @ place.table
        # under either law slack is where the elastic tension is negative: the tension-only one would show zero
        return R, self._least(place, T + self.alpha * eps), slope, k, d

    def _least(self, place: Points, N: Array) -> tuple[float, float]:
        """The least N and its s; a negative N must be so in the mean over a shortest wave, 2/n, or it is a ripple."""
        s, least = place.s, N.argmin()
        if N[least] < 0.0:
            waves = _waves(s, place.sides, place.basis.basis.n)
            weights = np.add.reduceat(place.weights, waves)
            N, s = (np.add.reduceat(place.weights * x, waves) / weights for x in (N, s))
            least = N.argmin()
        return float(N[least]), float(s[least])

    def linearise(self, place: Points, Q: Array) -> tuple[Array, tuple[float, float], Array]:
        """R, the least N and its s, and J1, J2, J3 of (28)-(32), the gram matrix of k I + d r' r'^T, (2 n, 2 n)."""
        R, least, slope, k, d = self._force(place, Q)
        r = place.r_static + slope
        f = (place.weights * d * r)[:, None] * r
        k = place.weights * k
        f[0, 0] += k
        f[1, 1] += k
        return R, least, place.basis.gram(place.table, f)

    def static_slope(self, s: Array) -> tuple[Array, Array]:
        """Of the catenary."""
        _, xp, yp, xpp, ypp = self.groups.static(s)
        return np.array([xp, yp]).T, np.array([xpp, ypp]).T

    def stress(self, s: Array, slope: Array) -> tuple[Array, Array]:
        """N t - T t_static, and k I + d r' r'^T."""
        T, xp, yp, _, _ = self.groups.static(s)
        ux, vy = slope[..., 0], slope[..., 1]
        _, k, excess, d, _ = self.response(T, xp, yp, ux, vy)
        r = np.stack([xp + ux, yp + vy], axis=-1)
        force = np.stack([excess * xp + k * ux, excess * yp + k * vy], axis=-1)
        return force, k[..., None, None] * np.eye(2) + d[..., None, None] * r[..., :, None] * r[..., None, :]


def _waves(s: Array, sides: tuple[float, ...], n: int) -> Array:
    """Index of the first point of each piece, when every side is cut into equal pieces of about a wave 2/n."""
    edges = [np.linspace(a, b, max(2, round(0.5 * n * (b - a)) + 1))[:-1] for a, b in pairwise(sides)]
    return np.unique(np.searchsorted(s, np.concatenate(edges)))


class ChordCable:
    """One displacement w normal to the chord over a parabola: string, sagged (linear), stretching (Kirchhoff-Carrier).

    Internal force tau w' + h (y_n' + kap w'), h = alpha lam int( y_n' w' + kap w'^2/2 ) ds, tau = 1/chord_cos being the
    tension along the chord, y_n'' = -sigma chord_cos/tau and y_n' = -y_n'' (1/2 - s); (lam, kap) = string (0, 0),
    sagged (1, 0), stretching (1, 1).  All is quadratic in Q by two closed-form integrals, S = int Phi' Phi' and
    b = int y_n' Phi' = -y_n'' int Phi (by parts, Phi = 0 at the supports): no quadrature.
    """

    fields = 1

    def __init__(self, groups: Groups, model: str) -> None:
        self.lam, self.kap = {"string": (0.0, 0.0), "sagged": (1.0, 0.0), "stretching": (1.0, 1.0)}[model]
        self.alpha, self.tau = groups.alpha, 1.0 / groups.chord_cos
        self.weight = np.array([groups.sigma * groups.chord_cos])
        self.curvature = -self.weight[0] / self.tau  # y_n''
        # total tension is the static one plus h everywhere: least where the static one is, at y' = 0 or a support
        self.least_at = min(1.0, max(0.0, groups.c / groups.sigma))
        self.least = float(groups.static(self.least_at)[0])

    def at(self, basis: MovingBasis, s_o: float) -> tuple[Array, Array]:
        """S and b."""
        return basis.stiffness(s_o), -self.curvature * basis.integral(s_o)

    def _increment(self, place: tuple[Array, ...], Q: Array) -> tuple[Array, float, Array]:
        """S w, h, and (dh/dQ)/(alpha lam)."""
        S, b = place
        Sq = Q[0] @ S
        h = self.alpha * self.lam * (b @ Q[0] + 0.5 * self.kap * (Q[0] @ Sq))
        return Sq, h, b + self.kap * Sq

    def force(self, place: tuple[Array, ...], Q: Array) -> tuple[Array, tuple[float, float]]:
        """R (1, n); least T(s) + h and its s."""
        Sq, h, g = self._increment(place, Q)
        return (self.tau * Sq + h * g)[None], (self.least + h, self.least_at)

    def linearise(self, place: tuple[Array, ...], Q: Array) -> tuple[Array, tuple[float, float], Array]:
        """R and the least tension as above; dR/dQ, (n, n)."""
        _, h, g = self._increment(place, Q)
        J = (self.tau + self.kap * h) * place[0] + np.multiply.outer(self.alpha * self.lam * g, g)
        return *self.force(place, Q), J

    def static_slope(self, s: Array) -> tuple[Array, Array]:
        """Of the parabola."""
        slope = -self.curvature * (0.5 - s)[..., None]
        return slope, np.full_like(slope, self.curvature)

    def stress(self, s: Array, slope: Array) -> tuple[Array, Array]:
        """tau w' alone: what one point strains adds nothing to the mean h."""
        return self.tau * slope, np.full((*slope.shape, 1), self.tau)


def cable_model(groups: Groups, model: str, law: str) -> FullCable | ChordCable:
    """The model by name; the law is the full cable's: one-field models have one h for the whole cable, slack or not."""
    if law not in LAWS:
        raise ValueError(f"unknown law {law!r}; one of {', '.join(LAWS)}")
    if model not in MODELS:
        raise ValueError(f"unknown model {model!r}; one of {', '.join(MODELS)}")
    if model == "full":
        return FullCable(groups, law)
    return ChordCable(groups, model)
