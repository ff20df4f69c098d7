"""The equations of motion against Lagrange's, the printed integrals, and their own tangent."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss

from cablefem import Scene
from cablefem.newmark import Newton, State, take_newmark_step
from cablefem.scene.motion import Motion, Piece
from galerkin.bases import Daubechies, Fourier
from galerkin.equations import GalerkinSystem
from tests.runs import crossed_cable, tangent_defect

# Enters at 0.31, speeds up, at t = 1.3 starts to brake: every term of (22), (23), (27) and a jump of acceleration.
FIRST = Piece(0.0, 0.0, 0.0, 0.31, 0.07, 0.011)
PLACE, SPEED, _ = FIRST(1.3)
MOTION = Motion(((0.0, 1.3), (1.3, 2.1)), ((FIRST,), (Piece(1.3, 1.3, PLACE, SPEED, -0.13, 0.0),)), 1.0)
STEEP = replace(crossed_cable(mu=0.73, sigma=0.31, c=0.52, alpha=290.0, speed=0.4), motion=MOTION)
DAMPED = replace(STEEP, damping=0.83)
MODELS = ("full", "string", "sagged", "stretching")
ROUGH = Daubechies(2, 1)
X, W = leggauss(150)


def gauss_points_of_sides(s_o):
    """150 Gauss points on each side of the mass: more than any function of these tests needs."""
    s = np.concatenate([0.5 * s_o * (1.0 + X), s_o + 0.5 * (1.0 - s_o) * (1.0 + X)])
    return s, np.concatenate([0.5 * s_o * W, 0.5 * (1.0 - s_o) * W])


def hat_function(s, s_o):
    return np.where(s <= s_o, s / s_o, (1.0 - s) / (1.0 - s_o))


def basis_functions_and_rates(system, s, s_o):
    """Phi (n_s, n), Phi' and dPhi/ds_o, from the definition."""
    basis = system.basis.basis
    phi, slope, rate = basis.phi(s), basis.phi(s, 1), np.zeros((s.size, basis.n))
    if system.kink:
        left = s <= s_o
        phi = np.column_stack([phi, hat_function(s, s_o)])
        slope = np.column_stack([slope, np.where(left, 1.0 / s_o, -1.0 / (1.0 - s_o))])
        rate = np.column_stack([rate, np.where(left, -s / s_o**2, (1.0 - s) / (1.0 - s_o) ** 2)])
    return phi, slope, rate


def random_state(system, seed, size=0.02):
    return size * np.random.default_rng(seed).standard_normal((3, system.n_dof))


# --- inertia: Lagrange's equations from the kinetic energy alone ---------------------------------------------------
def static_shape_and_slope(system, s):
    """X, X' as the model's load sees them, (fields, ...)."""
    g = system.groups
    if system.fields == 2:
        return np.array(g.coordinates(s)), np.array(g.tension_and_slope(s)[1:])
    k = g.sigma * g.chord_cos**2  # the parabola's curvature, tau = 1/chord_cos
    return np.array([0.5 * k * s * (1.0 - s)]), np.array([k * (0.5 - s)])


def kinetic_energy(system, t, phase, q, v):
    """1/2 int |w.|^2 ds + 1/2 mu |dp/dt|^2 by quadrature, from (1)."""
    s_o, ds_o, _ = system.motion.position_with_rates(t, phase)
    s, w = gauss_points_of_sides(s_o)
    Q, V = q.reshape(system.fields, -1), v.reshape(system.fields, -1)
    phi, _, rate = basis_functions_and_rates(system, s, s_o)
    velocity = V @ phi.T + ds_o * (Q @ rate.T)
    values, slopes = (x[0] for x in basis_functions_and_rates(system, np.array([s_o]), s_o)[:2])
    if system.kink:  # followed along the path the hat stays 1
        values[-1], slopes[-1] = 1.0, 0.0
    p = V @ values + ds_o * (Q @ slopes + static_shape_and_slope(system, s_o)[1])
    return 0.5 * np.sum(velocity**2 @ w) + 0.5 * system.inertia * p @ p


def inertia_by_lagrange(system, t, phase, q, v, a):
    """d/dt dT/dv - dT/dq of that energy along q + v t + a t^2/2: T is quadratic, so differences in q, v are exact."""
    unit = np.eye(q.size)

    def momentum(tau):
        at, x, y = t + tau, q + tau * v + 0.5 * tau**2 * a, v + tau * a
        return np.array(
            [
                0.5 * (kinetic_energy(system, at, phase, x, y + e) - kinetic_energy(system, at, phase, x, y - e))
                for e in unit
            ]
        )

    h = 5e-4  # fourth order differences: 1e-13 of fifth derivatives of 1e4, rounding 1e-11
    rate = (momentum(-2 * h) - 8 * momentum(-h) + 8 * momentum(h) - momentum(2 * h)) / (12 * h)
    force = [
        0.5 * (kinetic_energy(system, t, phase, q + e, v) - kinetic_energy(system, t, phase, q - e, v)) for e in unit
    ]
    return rate - np.array(force)


def inertia_of_residual(system, t, phase, q, v, a):
    """The residual without internal force and weight."""
    s_o = system.motion.position_with_rates(t, phase)[0]
    weight = np.multiply.outer(system.mu * system.cable.weight, system.basis.inertia_terms(s_o, 0.0, 0.0).f)
    tables = system.instant(t, phase).tables
    internal = system.cable.internal_force_and_tensions(tables, amplitudes_of_fields(system, q))[0]
    return system.residual(t, q, v, a, phase) - (internal - weight).ravel()


def amplitudes_of_fields(system, q):
    return q[: system.n_modal].reshape(system.fields, system.n)


@pytest.mark.parametrize("kink", [False, True])
@pytest.mark.parametrize("model", ["full", "stretching"])
@pytest.mark.parametrize("load", ["mass", "force"])
def test_inertia_terms_are_lagranges(model, load, kink):
    """(21)-(23), (27) and the kink's 2A, A. - B at once, in both phases of the travel."""
    system = GalerkinSystem(STEEP, Fourier(4), kink=kink, model=model, load=load)
    for t, phase in ((0.7, 0), (1.7, 1)):
        x = random_state(system, 5, 0.3)
        np.testing.assert_allclose(
            inertia_of_residual(system, t, phase, *x), inertia_by_lagrange(system, t, phase, *x), rtol=0.0, atol=3e-9
        )
        if kink or load == "mass":
            late = inertia_by_lagrange(system, t + 1e-3, phase, *x)
            assert np.abs(inertia_of_residual(system, t, phase, *x) - late).max() > 1e-6


@pytest.mark.parametrize("kink", [False, True])
def test_path_form_is_the_chain_rule(kink):
    """Where phi'' exists the path form must say the same: substitute w_p = Phi q and its derivatives along the path."""
    smooth = GalerkinSystem(STEEP, Daubechies(4, 0), kink=kink)
    path = GalerkinSystem(STEEP, Rough(Daubechies(4, 0)), kink=kink)
    q, v, a = random_state(smooth, 8)
    t, phase = 0.9, 0
    x = smooth.instant(t, phase).inertia_terms
    Q, V, A = (amplitudes_of_fields(smooth, y) for y in (q, v, a))
    w_p = Q @ x.f, V @ x.f + 0.5 * Q @ x.f_v, A @ x.f + V @ x.f_v + Q @ x.f_q
    r = path.residual(t, *(np.concatenate([y, z]) for y, z in zip((q, v, a), w_p, strict=True)), phase)
    np.testing.assert_allclose(r[:-2], smooth.residual(t, q, v, a, phase), rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(r[-2:], 0.0, rtol=0.0, atol=1e-15)
    off = path.residual(t, np.append(q, w_p[0] + [0.0, 0.013]), np.append(v, w_p[1]), np.append(a, w_p[2]), phase)
    assert abs(off[-1] - 0.013) < 1e-12  # the constraint is read


class Rough:
    """A basis that denies having a second derivative."""

    has_second_derivative = False

    def __init__(self, basis):
        self._basis = basis

    def __getattr__(self, name):
        return getattr(self._basis, name)


# --- internal force ----------------------------------------------------------------------------------------------
def paper_internal_force(system, s_o, q):
    """(25)-(26) term by term, gravity included, (2, n)."""
    g = system.groups
    s, w = gauss_points_of_sides(s_o)
    T, xp, yp = g.tension_and_slope(s)
    phi, slope, _ = basis_functions_and_rates(system, s, s_o)
    rx, ry = amplitudes_of_fields(system, q) @ slope.T + np.array([xp, yp])
    eps = np.hypot(rx, ry) - 1.0
    k = (T + g.alpha * eps) / (eps + 1.0)
    if system.law == "tension-only":
        k = np.maximum(k, 0.0)
    return np.stack([(w * k * rx) @ slope, (w * k * ry) @ slope - g.sigma * (w @ phi)])


@pytest.mark.parametrize("kink", [False, True])
@pytest.mark.parametrize("law", ["elastic", "tension-only"])
def test_internal_force_is_the_printed_one(law, kink):
    """Gravity, -sigma phi in (26), is what the static part integrates to: subtracting that part changes nothing."""
    system = GalerkinSystem(STEEP, Fourier(6), kink=kink, law=law)
    q, (s_o, _, _) = random_state(system, 3, 2e-3 if law == "elastic" else 1e-2)[0], MOTION.position_with_rates(0.9, 0)
    place = system.instant(0.9, 0).tables
    force, pull = system.cable.internal_force_and_tensions(place, amplitudes_of_fields(system, q))
    # slack in part of the cable: N has kinks that no rule resolves, hence per mille of the largest force
    least, _ = system.cable.min_tension_and_position(system.basis, place, pull)
    assert least < 0.0  # the elastic tension, whatever the law
    atol = 1e-11 if law == "elastic" else 1e-2 * np.abs(force).max()
    np.testing.assert_allclose(force, paper_internal_force(system, s_o, q), rtol=0.0, atol=atol)
    assert np.abs(force - paper_internal_force(system, s_o, -q)).max() > 0.1 * np.abs(force).max()


@pytest.mark.parametrize("basis", [Fourier(30), Daubechies(4, 1)], ids=["sines", "wavelets"])
@pytest.mark.parametrize("kink", [False, True])
@pytest.mark.parametrize("model", MODELS)
def test_hanging_cable_is_an_exact_equilibrium(model, kink, basis):
    system = GalerkinSystem(STEEP, basis, kink=kink, model=model)
    place = system.instant(0.4, 0).tables
    force, pull = system.cable.internal_force_and_tensions(place, np.zeros((system.fields, system.n)))
    least, where = system.cable.min_tension_and_position(system.basis, place, pull)
    assert np.abs(force).max() == 0.0
    assert abs(least - STEEP.static_tension(where)) < 1e-15


def test_a_straight_cable_bends_at_the_hat_alone():
    """Patch: without gravity a hat is two straight pieces of uniform strain, and only the mass feels a force."""
    flat = replace(Scene.load("level").groups, sigma=1e-300, c=0.0, alpha=57.0, motion=MOTION)
    system = GalerkinSystem(flat, Fourier(5), kink=True)
    s_o, _, _ = MOTION.position_with_rates(0.8, 0)
    Q = np.zeros((2, system.n))
    Q[:, -1] = 0.07, 0.11
    force = system.cable.internal_force_and_tensions(system.instant(0.8, 0).tables, Q)[0]
    pull = []
    for length, sign in ((s_o, 1.0), (1.0 - s_o, -1.0)):
        r = np.array([1.0, 0.0]) + sign * Q[:, -1] / length
        stretch = np.hypot(*r)
        pull.append((1.0 + 57.0 * (stretch - 1.0)) * r / stretch)
    # concentrated at the mass: (N t behind - N t ahead) Phi(s_o)
    want = np.multiply.outer(pull[0] - pull[1], system.basis.inertia_terms(s_o, 0.0, 0.0).f)
    np.testing.assert_allclose(force, want, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("kink", [False, True])
@pytest.mark.parametrize("model", ["sagged", "stretching"])
def test_one_field_force_by_quadrature(model, kink):
    """tau w' + h (y_n' + kap w') against phi' with h from its integral, instead of the closed forms."""
    system = GalerkinSystem(STEEP, Fourier(6), kink=kink, model=model)
    q, (s_o, _, _) = random_state(system, 4)[0], MOTION.position_with_rates(0.9, 0)
    s, w = gauss_points_of_sides(s_o)
    slope, kap, tau = basis_functions_and_rates(system, s, s_o)[1], float(model == "stretching"), 1.0 / STEEP.chord_cos
    w_s, y_s = slope @ q, static_shape_and_slope(system, s)[1][0]
    h = STEEP.alpha * (w @ (y_s * w_s + 0.5 * kap * w_s**2))
    place = system.instant(0.9, 0).tables
    force, pull = system.cable.internal_force_and_tensions(place, q[None])
    least, _ = system.cable.min_tension_and_position(system.basis, place, pull)
    np.testing.assert_allclose(force[0], (w * (tau * w_s + h * (y_s + kap * w_s))) @ slope, rtol=0.0, atol=1e-11)
    assert abs(least - (STEEP.static_tension(np.linspace(0.0, 1.0, 20001)).min() + h)) < 1e-8


def test_ripples_are_not_slack():
    """A negative N counts when its mean over a shortest wave is negative, not when the highest sine dips below."""
    system = GalerkinSystem(STEEP, Fourier(40))
    place = system.instant(0.9, 0).tables
    ripple, slack = np.zeros((2, 2, 40))
    ripple[:, -1] = 1.3 / (40 * np.pi * STEEP.alpha) * np.array([STEEP.chord_cos, STEEP.chord_sin])
    slack[:, 0] = 40.0 * ripple[:, -1]
    pulls = [system.cable.internal_force_and_tensions(place, Q)[1] for Q in (ripple, slack)]
    assert max(pull.min() for pull in pulls) < -0.1
    least = [system.cable.min_tension_and_position(system.basis, place, pull)[0] for pull in pulls]
    assert least[0] > 0.0
    assert least[1] < -0.1


# --- tangent -----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("kink", [False, True])
@pytest.mark.parametrize("load", ["mass", "force"])
@pytest.mark.parametrize(("model", "law"), [*((m, "elastic") for m in MODELS), ("full", "tension-only")])
@pytest.mark.parametrize("basis", [Fourier(5), ROUGH], ids=["sines", "db2"])
def test_the_tangent_is_the_derivative_of_the_residual(basis, model, law, load, kink):
    system = GalerkinSystem(DAMPED, basis, kink=kink, model=model, law=law, load=load)
    rng = np.random.default_rng(22)  # 21: a slack cable of condition 1e7
    for t, phase in ((0.13, 0), (1.07, 0), (1.9, 1)):
        # central differences at 1e-6: 1e-12 times third derivatives of order alpha, through a solve of condition 1e4
        assert tangent_defect(system, t, rng, phase=phase, size=0.02) < 1e-5


def test_the_tangent_check_sees_a_sign():
    class Wrong(GalerkinSystem):
        def linearise(self, t, q, v, a, phase, c):
            return super().linearise(t, q, v, a, phase, (c[0], -c[1], c[2]))

    assert tangent_defect(Wrong(STEEP, Fourier(5)), 1.07, np.random.default_rng(21)) > 1e-3


# --- start -------------------------------------------------------------------------------------------------------
def residual_growth(system, state):
    """max|r| at t = 1e-5 of the state carried on by its Taylor series, over 1e-5."""
    t = 1e-5
    moved = state.q + t * state.v + 0.5 * t * t * state.a, state.v + t * state.a, state.a
    return float(np.abs(system.residual(t, *moved, 0)).max() / t)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("load", ["mass", "force"])
@pytest.mark.parametrize("scene", ["level", "inclined"])  # enters at speed; starts from rest
def test_entry_is_the_limit_of_the_motion(scene, load, model):
    """The residual of the Taylor series vanishes like t (entry at speed) or t^2 (from rest), not like 1."""
    system = GalerkinSystem(Scene.load(scene).groups, Fourier(20), kink=True, model=model, load=load)
    # a wave of wavenumber 20 pi sqrt(alpha) builds up at that rate; a moving force bends the cable at once
    assert residual_growth(system, system.start(0, None)) < {"level": 1e3, "inclined": 1e-3}[scene]


def test_the_check_of_the_entry_sees_the_naive_one():
    """'The hat accelerates, the sines rest' and 'it falls freely from rest' leave a residual that does not fade."""
    for scene in ("level", "inclined"):
        system = GalerkinSystem(Scene.load(scene).groups, Fourier(20), kink=True)
        right = system.start(0, None)
        naive = right.a.reshape(2, -1).copy()
        naive[:, :-1] = 0.0
        if scene == "inclined":
            naive[:, -1] = 0.0, system.groups.sigma
        assert residual_growth(system, State(0.0, right.q, right.v, naive.ravel())) > 1e3


@pytest.mark.parametrize("kink", [False, True])
@pytest.mark.parametrize("basis", [Fourier(6), ROUGH], ids=["sines", "db2"])
def test_acceleration_jumps_with_the_drive(basis, kink):
    """At a jump of dds_o q and dq/dt go on, and if the old acceleration was in balance the new one is."""
    system = GalerkinSystem(STEEP, basis, kink=kink)
    q, v, a = random_state(system, 11)
    before, after = (system.instant(1.3, k).inertia_terms for k in (0, 1))
    if system.path_form:
        # any a of the cable, with a load at the mass that makes it balance, is as good as another: compare defects
        new = system.start(1, State(1.3, q, v, a, 0))
        modal = slice(0, system.n_modal)
        jump = system.residual(1.3, new.q, new.v, new.a, 1)[modal] - system.residual(1.3, q, v, a, 0)[modal]
        kick = (
            amplitudes_of_fields(system, q) @ (after.f_q - before.f_q)
            + amplitudes_of_fields(system, new.a - a) @ after.f
        )
        np.testing.assert_allclose(new.a[-2:] - a[-2:], kick, rtol=1e-12)
    else:
        new = system.start(1, State(1.3, q, v, a, 0))
        jump = system.residual(1.3, new.q, new.v, new.a, 1)
    np.testing.assert_allclose(jump, 0.0, rtol=0.0, atol=1e-11)  # forces here are of order 100
    assert np.array_equal(new.q, q)
    assert np.array_equal(new.v, v)
    assert np.abs(system.residual(1.3, q, v, a, 1)).max() > 1e-3


def test_faults_are_named():
    with pytest.raises(ValueError, match="unknown load 'weight'"):
        GalerkinSystem(STEEP, Fourier(3), load="weight")
    with pytest.raises(ValueError, match="unknown model 'beam'"):
        GalerkinSystem(STEEP, Fourier(3), model="beam")
    with pytest.raises(ValueError, match="unknown law 'rubber'"):
        GalerkinSystem(STEEP, Fourier(3), law="rubber")


# --- the compiled step -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize("law", ["elastic", "tension-only"])
@pytest.mark.parametrize("basis", [Fourier(6), Daubechies(4, 0)], ids=["sines", "db4"])
@pytest.mark.parametrize("size", [1e-3, 3e-2])
def test_a_compiled_step_is_the_drivers_own(size, basis, law):
    """Against `take_newmark_step` from a random state, near and far (halved corrections, a new tangent): alike."""
    system = GalerkinSystem(DAMPED, basis, kink=True, law=law)
    start, dt = random_state(system, 9, size), 0.02
    rule = np.array([[1, dt, 0.5 * dt**2, 0.25 * dt**2, 0.8], [0, 1, dt, 0.5 * dt, 0.8], [0, 0, 1, 1, 0.9]])
    ends, ways = np.empty((2, *start.shape)), []
    for solve_step, now in ((system.solve_step, ends[0]), (lambda *x: take_newmark_step(system, *x), ends[1])):
        ways.append(solve_step(0.93, 0, start, now, rule, Newton(max_iter=12, bound=1e-9)))
    compiled, own = ways
    for work in ("iterations", "factorisations", "residuals"):
        assert getattr(compiled, work) == getattr(own, work)
    assert ways[0].norm <= 1e-9 or size > 1e-2
    if ways[0].norm <= 1e-9:
        np.testing.assert_allclose(ends[0], ends[1], rtol=0.0, atol=1e-10 * np.abs(ends[1]).max())


def test_a_stride_is_the_drivers_own_steps():
    """Many steps in one call end where single ones by `take_newmark_step` do, on the bound that both are told."""
    system, dt = GalerkinSystem(STEEP, Fourier(23), kink=True), 0.004
    rule = np.array([[1, dt, 0.3 * dt**2, 0.2 * dt**2, 0.8], [0, 1, 0.4 * dt, 0.6 * dt, 0.8], [0, 0, 1, 1, 0.9]])
    start = random_state(system, 3, 3e-4) / np.tile(np.arange(1.0, system.n + 1), 2) ** 2
    t, bound = 0.93 + 0.004 * np.arange(1.0, 6.0), 1e-7
    ends, told = system.solve_steps(t, 0, start, np.repeat(rule[None], t.size, axis=0), Newton(bound=bound))
    assert len(ends) == t.size
    for when, end, norm in zip(t, ends, told[:, 0], strict=True):
        now = np.empty_like(start)
        exact = take_newmark_step(system, when, 0, start, now, rule, Newton(bound=1e-12))
        assert norm <= bound
        assert exact.norm <= 1e-12
        np.testing.assert_allclose(end[0], now[0], rtol=0.0, atol=1e-7 * np.abs(now[0]).max())
        start = end
