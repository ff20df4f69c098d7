"""What the tests of the element wing share: cables off the beaten numbers, runs, and the error of a path."""

from dataclasses import replace

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from cablefem import Scene
from cablefem.newmark import integrate, scheme, stack_states, step_times_by_phase
from cablefem.scene import ConstantSpeed, Groups

LEVEL = Scene.load("level").groups
INCLINED = Scene.load("inclined").groups
CRUISE = Scene.load("cruise").groups


def crossed_cable(*, mu: float, sigma: float, c: float, alpha: float, speed: float) -> Groups:
    """Return a cable whose chord follows from (sigma, c): level with c = sigma/2."""
    g = replace(LEVEL, mu=mu, sigma=sigma, alpha=alpha, c=c, motion=ConstantSpeed(speed=speed).motion(1.0))
    x, y = g.coordinates(1.0)
    chord = np.hypot(x, y)
    return replace(g, chord_cos=float(x / chord), chord_sin=float(y / chord))


MODELS = ("full", "string", "sagged", "stretching")
STEEP = crossed_cable(mu=0.7, sigma=0.31, c=0.52, alpha=290.0, speed=0.45)
DAMPED = replace(STEEP, damping=0.83)


def march_with_positions(system, steps, method="trapezoidal", *, until=1.0, **kw):
    """Return the stacked states of a run up to s_o = until, and s_o."""
    states = []
    for x in integrate(system, scheme(method, **kw), step_times_by_phase(system, steps)):
        states.append(x)
        if system.motion.position_with_rates(x.t, x.phase)[0] > until:
            break
    s_o = np.array([system.motion.position_with_rates(x.t, x.phase)[0] for x in states])
    return stack_states(states), s_o


def basis_values_and_derivatives(ref, x):
    """Return (dofs, values, d/dx), each (n_loc, ...), of a reference at x in [-1, 1]; at a knot those behind it."""
    e = np.clip(np.searchsorted(ref.knots, x) - 1, 0, ref.knots.size - 2)
    length = np.diff(ref.knots)[e]
    at = (x - ref.knots[e]) / length
    return np.moveaxis(ref.dofs[e], -1, 0), polyval(at, ref.shapes.T), polyval(at, polyder(ref.shapes.T)) / length


def observe(system, states, s=(), frames=()):
    return system.observe(states, np.asarray(s, float), np.asarray(frames, int))


def largest_and_rms_path_error(system, steps, exact, method="trapezoidal", *, until=0.8, **kw):
    """Return the largest and the rms error of v(s_o) on 0.02 <= s_o <= until over the largest exact v; exact(t)."""
    states, s_o = march_with_positions(system, steps, method, until=until, **kw)
    inside = (s_o >= 0.02) & (s_o <= until)
    assert inside.sum() > 20
    v, reference = observe(system, states).path[inside, 1], exact(states.t[inside])
    error = (v - reference) / np.abs(reference).max()
    return float(np.abs(error).max()), float(np.sqrt(np.mean(error**2)))


def observed_orders(errors):
    """Return log2 of the ratios of successive errors; a ladder halves its step sizes."""
    errors = np.asarray(errors)
    return np.log2(errors[:-1] / errors[1:])


def tangent_defect(system, t, rng, *, phase=0, size=0.04):
    """Return max |S^-1 (difference quotient along x) - x| at a random state, for random x and c0, c1, c2.

    size : of the random unknowns; slopes then are of order size times degree times elements.
    """
    n = system.n_dof
    q, v, a = size * rng.standard_normal((3, n))
    c = rng.uniform(0.2, 1.8, 3)
    x = rng.standard_normal(n)
    r, solve = system.linearise(t, q, v, a, phase, c)
    np.testing.assert_allclose(r, system.residual(t, q, v, a, phase), rtol=0.0, atol=1e-13 * np.abs(r).max())
    e = 1e-6

    def shifted(h):
        return system.residual(t, q + h * c[0] * x, v + h * c[1] * x, a + h * c[2] * x, phase)

    quotient = (shifted(e) - shifted(-e)) / (2.0 * e)
    return float(np.abs(solve(quotient) - x).max())
