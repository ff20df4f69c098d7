"""Segments between moving contacts against what they stand for."""

import numpy as np
import pytest

from cablefem.elements.segments import Motion, Segments
from cablefem.elements.system import LineElements
from cablefem.scene.contacts import Elastic, MovingLine
from cablefem.scene.drive import Drive
from tests.motion.lines import Car, Smooth, car, saddle, spring, weight

SOFT = Elastic(mass_per_length=9.0, EA=1.4e6, damping=0.4)
MIXED = MovingLine(
    rope=SOFT, t_end=4.0,
    contacts=(
        spring(0.0, 0.0), car("grip", 700.0, Smooth(100.0, 7.0)),
        Car(name="free", mass=900.0, drive=Drive(mode="free", start=180.0, mu_r=0.07, k=0.8, wind=-3.0)),
        saddle("saddle", 290.0, -20.0), car("along", 800.0, Smooth(400.0, 6.0), "haul", mu_r=0.03, k=0.5),
        car("in x", 1200.0, Smooth(500.0, -4.0), "haul", "x", mu_r=0.02, wind=2.0), weight(600.0, -50.0, 7e4),
    ),
)  # fmt: skip


@pytest.mark.parametrize("degree", [1, 2, 4])
def test_tangent_is_the_derivative_of_the_balance(degree):
    system, rng = LineElements(MIXED, elements=2, degree=degree), np.random.default_rng(23)
    x = system.start(0, None)
    at = [z + size * rng.standard_normal(z.size) for z, size in zip(x[1:4], (0.3, 2.0, 1.0), strict=True)]
    for c in ((0.3, 0.5, 1.0), (1.0, 0.1, 1e-3), (1e-3, 0.02, 1.0)):
        y, step = rng.standard_normal(system.n_dof), 1e-4
        moved = [
            system.residual(1.0, *(z + e * c_i * y for z, c_i in zip(at, c, strict=True)), 0) for e in (step, -step)
        ]
        _, solve = system.linearise(1.0, *at, 0, c)
        want = (moved[0] - moved[1]) / (2.0 * step)
        np.testing.assert_allclose(solve(want), y, atol=1e-5)
        assert np.abs(solve(1.01 * want) - y).max() > 1e-3
        complex_c = tuple(1j * z for z in c)
        _, solve = system.linearise(1.0, *at, 0, complex_c)
        np.testing.assert_allclose(solve(1j * want), y, atol=1e-5)


def test_compiled_rows_are_those_of_the_segments():
    """Of nodes between the contacts, and of s of a saddle, which nothing but the rope touches."""
    system, rng = LineElements(MIXED, elements=3), np.random.default_rng(29)
    x = system.start(0, None)
    at = [z + size * rng.standard_normal(z.size) for z, size in zip(x[1:4], (0.3, 2.0, 1.0), strict=True)]
    coordinates = system.all_coordinates_from_unknowns(1.0, *at, 0)
    rows = system.balance_rows_storing_loads(1.0, coordinates, 0)
    nodes, ends = system.segments.rows_of_nodes_and_segment_ends(
        system.segments.fields_of_motion(system.segment_motion(coordinates))
    )
    want = nodes[:, 1:-1]
    scale = np.abs(want).max()
    np.testing.assert_allclose(rows[system.xy_of_nodes[:, 1:-1]], want, rtol=0.0, atol=1e-13 * scale)
    assert np.abs(rows[system.xy_of_nodes[:, 1:-1]] - 1.001 * want).max() > 1e-4 * scale
    saddle = [c.name for c in MIXED.contacts].index("saddle")
    assert rows[system.s[saddle]] == pytest.approx(ends[1, saddle - 1] + ends[0, saddle], abs=1e-13 * scale)


@pytest.mark.parametrize("degree", [1, 2, 4])
def test_a_straight_rope_that_slides_through_its_contacts_feels_nothing(degree):
    """r = u t + b s with contacts that move along it at will: rows of inner nodes and inner s are zero."""
    segments = Segments(Elastic(mass_per_length=7.0, EA=3e4), 0.0, 3, degree)
    rng = np.random.default_rng(5)
    s, ds, dds = (np.array([0.0, 30.0, 55.0, 100.0]), *rng.standard_normal((2, 4)))
    ends = [np.stack([z[:-1], z[1:]], axis=1) for z in (s, ds, dds)]
    xi = np.zeros(segments.nn)
    xi[::degree] = np.linspace(0.0, 1.0, 4)  # degrees of 3 and more have bubbles between
    if degree == 2:
        xi[1::2] = 0.5 * (xi[:-1:2] + xi[2::2])
    one = np.zeros(segments.nn)
    one[:: max(1, degree if degree > 2 else 1)] = 1.0
    u, b = np.array([3.0, -2.0]), np.array([0.9, 0.7])
    along = [e[:, :1] * (one - xi) + e[:, 1:] * xi for e in ends]  # s, c, dc of the nodes (3, nn)
    nodal = [z[..., None] * b for z in along]
    nodal[1] = nodal[1] + one[:, None] * u
    nodes, rows = segments.rows_of_nodes_and_segment_ends(segments.fields_of_motion(Motion(*nodal, *ends)))
    scale = np.abs(nodes).max()
    assert np.abs(nodes[:, 1:-1]).max() < 1e-12 * scale
    assert np.abs(nodes[:-1, -1] + nodes[1:, 0]).max() < 1e-12 * scale
    assert np.abs(rows[1, :-1] + rows[0, 1:]).max() < 1e-12 * np.abs(rows).max()
    # must fail: nodes that do not follow the contact at the right
    ends[1] = ends[1] * [1.0, 1.01]
    nodes, _ = segments.rows_of_nodes_and_segment_ends(segments.fields_of_motion(Motion(*nodal, *ends)))
    assert np.abs(nodes[:, 1:-1]).max() > 1e-6 * scale


def test_rows_are_lagrange_equations_of_the_rope():
    """d/dt dL/dv - dL/dx by differences, L = int rho w^2/2 - W + q y ds, of a fast soft segment."""
    segments = Segments(Elastic(mass_per_length=7.0, EA=2e3), 9.81, 2, 2)
    rng = np.random.default_rng(11)
    count = 2 * segments.nn
    points = np.stack([np.linspace(0.0, 31.0, segments.nn), np.zeros(segments.nn)], axis=1)
    x = np.append(points.ravel(), [2.0, 30.0]) + 0.3 * rng.standard_normal(count + 2)
    v, a = 6.0 * rng.standard_normal((2, count + 2))

    def fields(x, v, a):
        nodes = [z[:count].reshape(1, -1, 2) for z in (x, v, a)]
        return segments.fields_of_motion(Motion(*nodes, *(z[None, count:] for z in (x, v, a))))

    def lagrangian(x, v):
        p = fields(x, v, 0.0 * v)
        density = 0.5 * segments.rho * (p.w_x**2 + p.w_y**2) - p.W + segments.q * p.depth
        return float(np.sum(segments.weights * p.h * density))

    def gradient(of, z, step):
        shifts = step * np.eye(z.size)
        return np.array([of(z + e) - of(z - e) for e in shifts]) / (2.0 * step)

    def momentum(t):
        at = x + t * (v + 0.5 * t * a)
        return gradient(lambda rate: lagrangian(at, rate), v + t * a, 1.0)  # L is quadratic in v

    dt = 1e-4
    want = (momentum(dt) - momentum(-dt)) / (2.0 * dt) - gradient(lambda x: lagrangian(x, v), x, 1e-5)
    nodes, ends = segments.rows_of_nodes_and_segment_ends(fields(x, v, a))
    rows = np.append(nodes.ravel(), ends.ravel())
    np.testing.assert_allclose(rows, want, rtol=0.0, atol=1e-6 * np.abs(want).max())
    assert np.abs(rows - 1.001 * want).max() > 1e-4 * np.abs(want).max()
