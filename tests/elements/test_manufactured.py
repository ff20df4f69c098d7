"""A chosen motion of cable and mass, kinked at the mass, put into the differential equation; the rest is applied.

w = t^2 g(xi), xi the coordinate of the side of the mass: Newmark's rule is exact for it, so the error is that of space.
The strong form below knows neither moving meshes nor weak forms.
"""

import numpy as np
import pytest
from scipy.linalg import solve

from cablefem.elements.following import FollowingElements
from cablefem.newmark import NO_STEPS, State, integrate, scheme, stack_states, take_newmark_step
from tests.runs import basis_values_and_derivatives, crossed_cable, observed_orders

G = crossed_cable(mu=0.7, sigma=0.31, c=0.52, alpha=57.0, speed=0.37)
U, V = 0.0033, 0.0053  # no part of the cable is compressed: it would not be stable
X_GAUSS, W_GAUSS = np.polynomial.legendre.leggauss(8)


def chosen_motion(side, xi):
    """Return g, g', g'' (3, 2, n) on one side; g is 0 at the supports, the same on both sides of the mass, kinked."""
    if side == 0:
        g = [np.sin(1.1 * xi), 1.1 * np.cos(1.1 * xi), -1.21 * np.sin(1.1 * xi)]
        f = [1.4 * xi - 0.4 * xi**3, 1.4 - 1.2 * xi**2, -2.4 * xi]
    else:
        z, growth = 1.0 - xi, np.sin(1.1) * np.exp(0.8 * xi)
        g = [z * growth, (0.8 * z - 1.0) * growth, 0.8 * (0.8 * z - 2.0) * growth]
        f = [z * (1.0 - 0.6 * xi), 1.2 * xi - 1.6, 1.2 + 0.0 * xi]
    return np.stack([-U * np.array(g), V * np.array(f)], axis=1)


def strong_form_residual(t, side, xi):
    """Return w.. - (N t - T X')' and N t, r' (2, n) of the chosen motion at fixed s."""
    s_o, ds, dds = G.motion.position_with_rates(t, 0)
    h, e = (s_o, 1.0) if side == 0 else (1.0 - s_o, -1.0)
    chi = xi if side == 0 else 1.0 - xi
    g, g1, g2 = chosen_motion(side, xi)
    k = ds * chi / h  # mesh velocity over h: d xi/dt at fixed s is -k
    w_tt = 2.0 * g - 4.0 * t * k * g1 + t * t * ((2.0 * e * ds**2 / h - dds) * chi / h * g1 + k**2 * g2)
    s = s_o * xi if side == 0 else s_o + h * xi
    T, xp, yp, xpp, ypp = G.tension_and_shape_derivatives(s)
    r1, r2 = np.array([xp, yp]) + t * t / h * g1, np.array([xpp, ypp]) + t * t / h**2 * g2
    stretch = np.hypot(*r1)
    tangent = r1 / stretch
    N = T + G.alpha * (stretch - 1.0)
    N_s = -G.sigma * (G.c - G.sigma * s) / T + G.alpha * np.sum(tangent * r2, axis=0)
    t_s = (r2 - tangent * np.sum(tangent * r2, axis=0)) / stretch
    weight = np.array([0.0, G.sigma])[:, None]
    return w_tt - (N_s * tangent + N * t_s) - weight, N * tangent, r1


class Forced(FollowingElements):
    """The cable under the loads that the chosen motion asks for."""

    wrong = 0.0  # share of the momentum flux at the mass that is forgotten

    def loads(self, t):
        if t not in self.known:
            self.known[t] = self._loads(t)
        return self.known[t]

    def _loads(self, t):
        s_o, ds, dds = self.motion.position_with_rates(t, 0)
        F = np.zeros((self.n_scalar + 1, 2))  # last row: supports
        ends, ref = [], self.reference
        for side, knots in enumerate(np.split(ref.knots, [self._mesh.n_left + 1])):
            h = s_o if side == 0 else 1.0 - s_o
            knots = knots if side == 0 else np.append(0.0, knots)
            half = 0.5 * np.diff(knots)[:, None]
            x = (knots[:-1, None] + half * (X_GAUSS + 1.0)).ravel()
            xi = x + 1.0 if side == 0 else x
            body = strong_form_residual(t, side, xi)[0] * (h * half * W_GAUSS).ravel()
            dofs, value, _ = basis_values_and_derivatives(ref, x)
            np.add.at(F, dofs, value[:, :, None] * body.T)
            ends.append(
                [x[:, 0] for x in strong_form_residual(t, side, np.array([1.0 - 1e-15 if side == 0 else 0.0]))[1:]]
            )
        (pull_behind, behind), (pull_ahead, ahead) = ends
        _, xp, yp, xpp, ypp = G.tension_and_shape_derivatives(s_o)
        p_tt = 2.0 * chosen_motion(0, np.ones(1))[0, :, 0] + dds * np.array([xp, yp]) + ds**2 * np.array([xpp, ypp])
        jump = pull_ahead - pull_behind - (1.0 - self.wrong) * ds**2 * (ahead - behind)
        F[self.node] += G.mu * (p_tt - np.array([0.0, G.sigma])) - jump
        return F[:-1].ravel()

    def _set_residual_and_tangent(self, t, phase, x, r, factors):
        super()._set_residual_and_tangent(t, phase, x, r, factors)
        r -= self.loads(t)

    def solve_step(self, *step):
        return take_newmark_step(self, *step)

    def solve_steps(self, *steps):
        return NO_STEPS

    def held(self):
        """Return the values of all functions (m, n) at m points, and the chosen g there (m, 2)."""
        xi = np.linspace(1e-12, 1.0 - 1e-12, 201)
        x = np.concatenate([xi - 1.0, xi])
        dofs, value, _ = basis_values_and_derivatives(self.reference, x)
        N = np.zeros((x.size, self.n_scalar + 1))
        N[np.arange(x.size)[:, None], dofs.T] = value.T
        return N[:, :-1], np.concatenate([chosen_motion(side, xi)[0].T for side in (0, 1)])

    def best(self):
        """Return the unknowns closest to g."""
        N, g = self.held()
        return solve(N.T @ N, N.T @ g).ravel()


def rms_error_at_end(elements, degree, wrong=0.0):
    """Return the rms error of w over the largest |w| at t = 1.3, from the exact state at t = 0.6."""
    system = Forced(G, elements=elements, degree=degree)
    system.wrong, system.known = wrong, {}
    t, best = np.linspace(0.6, 1.3, 22), system.best()
    start = State(t[0], t[0] ** 2 * best, 2.0 * t[0] * best, 2.0 * best, 0)
    states = stack_states(list(integrate(system, scheme("trapezoidal"), [t], start=start)))
    assert states.t[-1] == 1.3
    N, g = system.held()
    return float(np.sqrt(np.mean(np.square(N @ states.q[-1].reshape(-1, 2) / 1.69 - g))) / V)


@pytest.mark.parametrize(
    ("degree", "ladder", "bound"), [(1, (4, 8, 16), 7e-4), (2, (6, 12, 24), 1e-6), (3, (5, 10, 20), 3e-9)]
)
def test_a_chosen_motion_is_found_with_the_order_of_the_elements(degree, ladder, bound):
    errors = [rms_error_at_end(n, degree) for n in ladder]
    assert errors[-1] < bound
    assert np.all(np.abs(observed_orders(errors) - (degree + 1)) < 0.15)


def test_a_momentum_flux_forgotten_at_the_mass_is_noticed():
    assert rms_error_at_end(12, 2, wrong=0.01) > 1e-4
