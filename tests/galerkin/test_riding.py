"""Sines that ride with the mass: inertia by its definition, compiled steps by the equations, answers by elements."""

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from scipy.integrate import cumulative_trapezoid

from cablefem import Scene
from cablefem.newmark import Newton, newmark_step
from galerkin.bases.riding import RidingSines, shape_functions
from galerkin.riding import RidingSystem
from tests.galerkin.test_equations import DAMPED
from tests.runs import tangent_defect
from validation import run

PLACE, SPEED, RATE = 0.37, 0.31, -0.17
X, W = (0.5 * (1.0 + y) if i == 0 else 0.5 * y for i, y in enumerate(leggauss(120)))


def basis_at(basis, t):
    """Phi and dPhi/dt at fixed s at Gauss points of both sides, and weights."""
    s_o, ds_o = PLACE + SPEED * t + 0.5 * RATE * t * t, SPEED + RATE * t
    values, rates, weights = [], [], []
    for side, h, dh in ((0, s_o, ds_o), (1, 1.0 - s_o, -ds_o)):
        phi, slope, _ = shape_functions(basis.terms, X)
        own = [*range(side * basis.terms, (side + 1) * basis.terms), basis.n - 1]
        for out, y in ((values, phi), (rates, -dh / h * X * slope)):
            whole = np.zeros((basis.n, X.size))
            whole[own] = y
            out.append(whole)
        weights.append(h * W)
    return np.hstack(values), np.hstack(rates), np.concatenate(weights)


def inertia(basis):
    """M, 2 A, A. - B with A = int Phi dPhi/dt, B = int dPhi/dt dPhi/dt; A. is a difference."""

    def A(t):
        phi, rate, w = basis_at(basis, t)
        return (phi * w) @ rate.T

    phi, rate, w = basis_at(basis, 0.0)
    change = (8.0 * (A(1e-3) - A(-1e-3)) - (A(2e-3) - A(-2e-3))) / 12e-3
    return (phi * w) @ phi.T, 2.0 * A(0.0), change - (rate * w) @ rate.T


def defect(basis):
    x = basis.inertia_terms(PLACE, SPEED, RATE)
    pairs = zip((x.mass, x.gyroscopic.T, x.centrifugal.T), inertia(basis), strict=True)
    return max(np.abs(a - b).max() / np.abs(b).max() for a, b in pairs)


def test_inertia_is_that_of_a_moving_basis_and_needs_the_kink_s_own_term():
    basis = RidingSines(5)
    assert defect(basis) < 1e-8
    phi, slope, _ = shape_functions(5, np.ones(1))
    basis.tables = basis.tables._replace(swirl=basis.tables.swirl + phi @ slope.T)
    assert defect(basis) > 0.1


@pytest.fixture(scope="module")
def system():
    return RidingSystem(DAMPED, 6)


def test_tangent(system):
    assert tangent_defect(system, 0.4, np.random.default_rng(3), size=0.01) < 1e-6


def test_compiled_steps_are_those_of_the_equations(system):
    start = 0.001 * np.random.default_rng(7).standard_normal((3, system.n_dof))
    dt = 0.02
    rule = np.array([[1, dt, dt**2 / 4, dt**2 / 4, 1], [0, 1, dt / 2, dt / 2, 1], [0, 0, 0, 1, 1.0]])
    ends = np.empty((2, *start.shape))
    done = system.solve_step(0.5, 0, start, ends[0], rule, Newton(bound=1e-11))
    defined = newmark_step(system, 0.5, 0, start, ends[1], rule, Newton(bound=1e-11))
    assert done[1:3] == defined[1:3]
    assert done.norm <= 1e-11
    np.testing.assert_allclose(ends[0], ends[1], rtol=0.0, atol=1e-9 * np.abs(ends[1]).max())


def gap(a, b):
    """Largest gap of the path over its scale, and rms gap of the tensions at the mass over H."""
    s = np.linspace(0.05, 0.75, 200) * a.length

    def seen(*of):
        return (np.array([np.interp(s, r.s_o, getattr(r, y)) for y in of]) for r in (a, b))

    path, other = seen("x", "y")
    T, other_T = seen("T_behind", "T_ahead")
    return (
        np.hypot(*(path - other)).max() / a.path_scale,
        np.sqrt(np.mean((T - other_T) ** 2)) / a.horizontal_tension,
    )


def test_path_and_tension_are_those_of_elements():
    scene = Scene.load("kevlar")
    elements = run(scene, "following-p4", elements=8, steps=1000, until=0.8)
    path, T = gap(run(scene, "fourier-riding", terms=12, steps=1000, until=0.8), elements)
    assert path < 2.5e-4
    assert T < 5e-5


def test_it_starts_from_rest_and_on_the_cable():
    for scene in (Scene.load("cruise"), Scene.load("kevlar").replace({"travel.from": 20.0})):
        elements = run(scene, "following-p2", elements=20, steps=1000, until=0.6)
        path, _ = gap(run(scene, "fourier-riding", terms=16, steps=1000, until=0.6), elements)
        assert path < 1e-3


def test_a_damped_cable_is_that_of_elements():
    scene = Scene.load("kevlar").replace({"cable.damping": 0.2})
    elements = run(scene, "following-p4", elements=8, steps=1000, until=0.8)
    riding = run(scene, "fourier-riding", terms=12, steps=1000, until=0.8)
    path, T = gap(riding, elements)
    assert path < 2.5e-4
    assert T < 5e-5
    undamped = run("kevlar", "fourier-riding", terms=12, steps=1000, until=0.8)
    assert min(gap(undamped, elements)) > 1e-3
    lost = np.ptp(elements.powers["lost_viscous"])
    np.testing.assert_allclose(
        riding.powers["lost_viscous"][20:], elements.powers["lost_viscous"][20:], atol=2e-2 * lost
    )


def test_a_force_enters_with_speed():
    methods = "fourier-riding", "fourier-kink"
    riding, kink = (run("kevlar", x, load="force", terms=24, steps=500, until=0.6) for x in methods)
    assert gap(riding, kink)[0] < 1e-3


def test_a_car_that_rolls_is_refused():
    with pytest.raises(ValueError, match="a car that grips"):
        run("zipline", "fourier-riding", terms=4, steps=20)


def test_one_field():
    scene = Scene.load("kevlar")
    for model in ("string", "stretching"):
        riding, kink = (
            run(scene, method, terms=24, steps=500, until=0.6, model=model)
            for method in ("fourier-riding", "fourier-kink")
        )
        assert gap(riding, kink)[0] < 1e-3
        np.testing.assert_allclose(riding.energy[25:], kink.energy[25:], rtol=0.0, atol=2e-3 * np.ptp(kink.energy))


def test_energy_is_what_the_drive_supplies():
    r = run("level", "fourier-riding", terms=16, steps=2000, until=0.6)
    supplied = cumulative_trapezoid(r.power, r.t, initial=0.0)
    balance = r.energy - r.energy[0] - supplied
    assert np.abs(balance).max() < 2e-3 * np.ptp(r.energy)
    assert np.abs(r.energy - r.energy[0] - 0.9 * supplied).max() > 2e-2 * np.ptp(r.energy)
