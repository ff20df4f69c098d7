"""The full (u, v) equations against a motion made up beforehand: no oracle reaches them, exact paths are strings."""

from dataclasses import replace

import numpy as np
from numpy.polynomial.legendre import leggauss

from cablefem.newmark import NO_STEPS, consistent_acceleration, integrate, iterate, scheme
from galerkin.bases import Fourier
from galerkin.equations import GalerkinSystem
from tests.galerkin.test_equations import STEEP, shapes
from tests.runs import orders

X, W = leggauss(120)
SOFT = replace(STEEP, alpha=37.0)  # stays under tension
SHAPE, KINK = np.array([0.007, -0.023]), np.array([-0.005, 0.019])  # directions of the smooth part and of the kink
FAST, SLOW = 2.3, 1.7
BEGIN, END = 0.4, 1.2  # inside the first phase


def smooth(s):
    """g = s (1 - s) e^s and g', g'': no sine, and g'' does not vanish at the supports."""
    e = np.exp(s)
    return s * (1 - s) * e, (1 - s - s**2) * e, (-3 * s - s**2) * e


class Made:
    """w = SHAPE g(s) cos(FAST t) + KINK hat(s; s_o(t)) sin(SLOW t), its derivatives, and the load that keeps it up."""

    def __init__(self, system, t):
        self.system = system
        self.s_o, self.ds_o, self.dds_o = system.motion.at(t, 0)
        self.c, self.dc, self.ddc = np.cos(FAST * t), -FAST * np.sin(FAST * t), -(FAST**2) * np.cos(FAST * t)
        self.k, self.dk, self.ddk = np.sin(SLOW * t), SLOW * np.cos(SLOW * t), -(SLOW**2) * np.sin(SLOW * t)

    def coefficients(self, basis):
        """Coefficients (2, n) of w and of dw/dt: the smooth part by its best approximation in H1."""
        s, w = 0.5 * (1 + X), 0.5 * W
        g = np.linalg.solve(basis.stiffness(), basis.phi(s, 1).T @ (w * smooth(s)[1]))
        q = [np.outer(SHAPE * c, np.append(g, 0.0)) for c in (self.c, self.dc)]
        q[0][:, -1], q[1][:, -1] = KINK * self.k, KINK * self.dk
        return [x.ravel() for x in q]

    def path(self):
        """w(s_o, t), (2,)."""
        return SHAPE * smooth(self.s_o)[0] * self.c + KINK * self.k

    def load(self, acceleration=1.0):
        """What (19) leaves over for this motion, (n_dof,): weak, piece by piece, its mass and its printed force."""
        system, g, total = self.system, self.system.groups, 0.0
        s_o, v = self.s_o, self.ds_o
        jump = []
        for a, b in ((0.0, s_o), (s_o, 1.0)):
            s, w = a + 0.5 * (b - a) * (1 + X), 0.5 * (b - a) * W
            left = a == 0.0
            hat = s / s_o if left else (1 - s) / (1 - s_o)
            hat_s = 1 / s_o if left else -1 / (1 - s_o)
            hat_t = -s * v / s_o**2 if left else (1 - s) * v / (1 - s_o) ** 2
            if left:
                hat_tt = s * (2 * v**2 / s_o**3 - self.dds_o / s_o**2)
            else:
                hat_tt = (1 - s) * (2 * v**2 / (1 - s_o) ** 3 + self.dds_o / (1 - s_o) ** 2)
            w_s = np.outer(SHAPE * self.c, smooth(s)[1]) + np.outer(KINK * self.k, np.full_like(s, hat_s))
            w_tt = np.outer(SHAPE * self.ddc, smooth(s)[0])
            w_tt += np.outer(KINK, self.ddk * hat + 2 * self.dk * hat_t + self.k * hat_tt)
            T, xp, yp, _, _ = g.static(s)
            r = np.array([xp, yp]) + w_s
            N = T + g.alpha * (np.hypot(*r) - 1.0)
            phi, slope, _ = shapes(system, s, s_o)
            total = total + (acceleration * w * w_tt) @ phi + (w * (N / np.hypot(*r) * r)) @ slope
            total[1] -= g.sigma * (w @ phi)
            jump.append(KINK * self.k * hat_s)
        f = system.basis.carried(s_o, 0.0, 0.0).f
        static = np.array(g.static(s_o)[1:])
        _, first, second = smooth(s_o)
        p_tt = SHAPE * (smooth(s_o)[0] * self.ddc + 2 * v * first * self.dc)
        p_tt += SHAPE * (self.dds_o * first + v**2 * second) * self.c + KINK * self.ddk
        p_tt += self.dds_o * static[:2] + v**2 * static[2:]
        at_mass = system.mu * (p_tt - [0.0, g.sigma]) + v**2 * (jump[1] - jump[0])
        return (total + np.outer(at_mass, f)).ravel()


class Loaded(GalerkinSystem):
    """The equations with the load of the made-up motion taken off."""

    wrong = 1.0

    def _residual(self, x, *state):
        return super()._residual(x, *state) - Made(self, self._t).load(self.wrong)

    def instant(self, t, phase):
        self._t = t
        return super().instant(t, phase)

    def settle(self, *step):
        return iterate(self, *step)

    def stride(self, *steps):
        return NO_STEPS


def error(terms, steps, wrong=1.0):
    """Largest error of the path over the largest displacement, up to END."""
    system = Loaded(SOFT, Fourier(terms), kink=True)
    system.wrong = wrong
    q, v = Made(system, BEGIN).coefficients(system.basis.basis)
    start = consistent_acceleration(system, BEGIN, q, v, 0)
    worst, size = 0.0, 0.0
    for x in integrate(system, scheme("trapezoidal"), [np.linspace(BEGIN, END, steps + 1)], start=start):
        made = Made(system, x.t).path()
        mine = system._fields(x.q) @ system.basis.carried(system.place(x), 0.0, 0.0).f
        worst, size = max(worst, np.abs(mine - made).max()), max(size, np.abs(made).max())
        if x.t >= END:
            break
    return worst / size


def test_the_made_up_motion_balances():
    """Put into the equations with its derivatives it leaves nothing in the rows of the long waves and of the hat."""
    system, h = Loaded(SOFT, Fourier(40), kink=True), 1e-5
    q, v = Made(system, 0.8).coefficients(system.basis.basis)
    before, after = (Made(system, 0.8 + x).coefficients(system.basis.basis)[1] for x in (-h, h))

    def defect():
        r = system.residual(0.8, q, v, (after - before) / (2.0 * h), 0).reshape(2, -1)
        return np.abs(r[:, [0, 1, 2, 3, -1]]).max() / np.abs(Made(system, 0.8).load()).max()

    assert defect() < 4e-6  # the smooth part's own truncation at 40 terms
    system.wrong = 0.99
    assert defect() > 1e-4


def test_order_in_space_and_time():
    """Coefficients of a smooth function that bends at the supports fall like k^-3: order 2.5; time 2."""
    space = [error(terms, 160) for terms in (3, 6, 12)]
    assert np.all(np.abs(orders(space) - 2.5) < 0.4)
    assert space[-1] < 3e-4
    time = [error(24, steps) for steps in (8, 16, 32)]
    assert np.all(np.abs(orders(time) - 2.0) < 0.3)
    assert time[-1] < 2.2e-4
    assert error(12, 32, wrong=0.9) > 10.0 * space[-1]  # inertia of the cable a tenth too small
