"""Weight and centrifugal force of an accelerating mass on a slightly curved cable.

    v_tt - v_xx = P(t) delta(x - xi(t)),  P = mu sigma (1 + xi'^2),  xi = V0 t + a t^2/2,  at rest at t = 0.

sigma is the static curvature; kink at the mass: [v_x] = -P/(1 - xi'^2).

Source: Forrestal, Bickel & Sagartz 1975
Validity: infinite cable of small sag, |xi'| < 1, no inertia of the mass
Accuracy: rounding
Group: Loads and cables that the solvers do not have
Unreached: a centrifugal force without inertia: the solvers' force is the weight alone
"""

from numpy.typing import ArrayLike

from validation.oracles import accelerating_force
from validation.oracles.case import Array


def displacement(x: ArrayLike, t: ArrayLike, *, mu: float, sigma: float, V0: float = 0.0, a: float) -> Array:
    """v(x, t)."""

    def impulse(s: Array) -> Array:
        return mu * sigma * s * (1.0 + V0 * V0 + s * (V0 * a + s * a * a / 3.0))

    return accelerating_force.displacement_of(x, t, impulse, V0=V0, a=a)
