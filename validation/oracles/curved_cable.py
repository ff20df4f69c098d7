"""On a slightly curved cable an accelerating mass presses with its weight and with the centrifugal force of the sag.

    v_tt - v_xx = P(t) delta(x - xi(t)),  xi = V0 t + a t^2/2,   P = mu sigma + mu sigma xi'^2,  infinite cable at
        rest at t = 0.

Forrestal, Bickel & Sagartz 1975: the static curvature is rho g/T (= sigma in units of the length), so that the mass
following it presses with M xi'^2 rho g/T = M g (xi'/c)^2, the second force part; the inertia of the mass against
the moving cable is left out. Kink at the mass: [v_x] = -mu sigma (1 + xi'^2)/(1 - xi'^2).

Validity: small sag, any V0, a of one sign of motion; meant for |xi'| < 1.  Accuracy: rounding (polynomial impulses
between the roots of quadratics, see accelerating_force).
"""

from numpy.typing import ArrayLike

from validation.oracles import accelerating_force
from validation.oracles.case import Array, Oracle


def displacement(x: ArrayLike, t: ArrayLike, *, mu: float, sigma: float, V0: float = 0.0, a: float) -> Array:
    """v(x, t); int xi'^2 = V0^2 s + V0 a s^2 + a^2 s^3/3."""

    def impulse(s: Array) -> Array:
        return mu * sigma * s * (1.0 + V0 * V0 + s * (V0 * a + s * a * a / 3.0))

    return accelerating_force.displacement_of(x, t, impulse, V0=V0, a=a)


ORACLE = Oracle(
    title="weight and centrifugal force of an accelerating mass on a slightly curved cable",
    source="Forrestal, Bickel & Sagartz 1975",
    validity="infinite cable of small sag, no inertia of the mass",
    group="Loads and cables that the solvers do not have",
    unreached="a centrifugal force without inertia: the solvers' force is the weight alone",
)
