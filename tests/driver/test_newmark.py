"""The driver against exact recurrences, exact solutions, stability limits, and a system that fails."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cablefem.newmark import (
    NO_STEPS,
    SCHEMES,
    Newton,
    NewtonStalled,
    Scheme,
    Work,
    integrate,
    scheme,
    step_times_by_phase,
)
from tests.driver.systems import Kicked, Spring

TIGHT = Newton(tol=1e-13)
FORCED = {"d": 0.37, "k3": 11.0, "f": 1.9}


def last_state(system, method, times, **kw):
    return list(integrate(system, method, times, **kw))[-1]


def equal_steps(end, n):
    return [np.linspace(0.0, end, n + 1)]


# --- the discrete recurrence -----------------------------------------------------------------------------------
@pytest.mark.parametrize("gamma", [0.5, 0.6, 0.83])
def test_newmark_steps_follow_the_closed_amplification_matrix(gamma):
    """For m a + k q = 0 a step is (q, dt v, dt^2 a)_1 = A (q, dt v, dt^2 a)_0, A known (Hughes 1987, section 9.1)."""
    spring = Spring(m=1.7, k=5.3)
    beta, dt, n = 0.25 * (gamma + 0.5) ** 2, 0.17, 23
    omega2 = 5.3 / 1.7 * dt * dt
    denominator = 1.0 + beta * omega2
    a_row = -omega2 / denominator * np.array([1.0, 1.0, 0.5 - beta])
    A = np.array([[1.0, 1.0, 0.5 - beta] + beta * a_row, [0.0, 1.0, 1.0 - gamma] + gamma * a_row, a_row])
    x0 = spring.start(0, None)
    expected = np.linalg.matrix_power(A, n) @ np.array([x0.q[0], dt * x0.v[0], dt * dt * x0.a[0]])
    x = last_state(spring, Scheme("any", beta, gamma), equal_steps(n * dt, n), newton=TIGHT)
    np.testing.assert_allclose([x.q[0], dt * x.v[0], dt * dt * x.a[0]], expected, rtol=0.0, atol=1e-13)
    # twin: another gamma does not follow that matrix
    other = last_state(spring, Scheme("any", beta, gamma + 0.02), equal_steps(n * dt, n), newton=TIGHT)
    assert abs(other.q[0] - expected[0]) > 1e-4


@pytest.mark.parametrize(
    ("name", "order", "finest", "forced"),
    [
        ("central-difference", 2.0, 3e-6, {}), ("newmark", 1.0, 5e-3, {}), ("trapezoidal", 2.0, 5e-6, {}),
        *((name, 2.0, 2e-5, FORCED) for name in ("trapezoidal", "generalized-alpha")),
    ],
)  # fmt: skip
def test_order_on_a_spring_free_or_forced_damped_and_nonlinear(name, order, finest, forced):
    """Second order to 0.05, the damped rule first order; with an absolute bound at 1600 steps."""
    spring, steps = Spring(**forced), [200, 400, 800, 1600]
    d, k3, f = (forced.get(x, 0.0) for x in ("d", "k3", "f"))
    exact = solve_ivp(
        lambda t, y: [y[1], (f * math.sin(2.1 * t) - d * y[1] - 5.3 * y[0] - k3 * y[0] ** 3) / 1.7],
        (0.0, 3.0), [spring.q0, spring.v0], method="DOP853", rtol=1e-13, atol=1e-14,
    ).y[0, -1]  # fmt: skip
    error = [abs(last_state(spring, scheme(name), equal_steps(3.0, n), newton=TIGHT).q[0] - exact) for n in steps]
    slope = -np.polyfit(np.log(steps), np.log(error), 1)[0]
    assert abs(slope - order) < 0.05, (slope, error)
    assert error[-1] < finest


# --- stability -------------------------------------------------------------------------------------------------
def test_central_differences_lose_stability_at_two_over_omega():
    w = math.sqrt(5.3 / 1.7)
    for factor, bounded in ((0.99, True), (1.01, False)):
        dt = factor * 2.0 / w
        x = last_state(Spring(end=400 * dt), scheme("central-difference"), equal_steps(400 * dt, 400))
        assert bool(abs(x.q[0]) < 10.0) is bounded


def test_generalized_alpha_annihilates_what_it_cannot_resolve_and_the_trapezoidal_rule_does_not():
    stiff = Spring(k=5.3e8, q0=0.31, v0=0.0)
    dying = last_state(stiff, scheme("generalized-alpha", rho_inf=0.5), equal_steps(3.0, 60))
    start, ringing = stiff.start(0, None), last_state(stiff, scheme("trapezoidal"), equal_steps(3.0, 60))
    assert abs(dying.q[0]) < 1e-9 * 0.31  # 60 steps at spectral radius about 1/2
    # the trapezoidal rule keeps the energy of a linear system to rounding
    assert stiff.energy(ringing) == pytest.approx(stiff.energy(start), rel=1e-9)


# --- phases, start --------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("name", "order", "steps"),
    [
        *((name, 2.0, (200, 400, 800)) for name in ("trapezoidal", "generalized-alpha")),
        ("radau", 5.0, (12, 24, 48)),
        ("gauss", 4.0, (12, 24, 48)),
    ],
)
def test_a_jump_of_the_force_on_a_phase_boundary_costs_no_order(name, order, steps):
    spring = Kicked(phases=((0.0, 1.3), (1.3, 3.0)))
    w, q = math.sqrt(5.3 / 1.7), 4.1 / 5.3
    at = spring.q0 * math.cos(w * 1.3) + spring.v0 / w * math.sin(w * 1.3)
    speed = -spring.q0 * w * math.sin(w * 1.3) + spring.v0 * math.cos(w * 1.3)
    truth = q + (at - q) * math.cos(w * 1.7) + speed / w * math.sin(w * 1.7)
    error = []
    for n in steps:
        times = [np.linspace(0.0, 1.3, n // 2 + 1), np.linspace(1.3, 3.0, n // 2 + 1)]
        states = list(integrate(spring, scheme(name), times, newton=TIGHT))
        assert any(x.t == 1.3 for x in states)
        error.append(abs(states[-1].q[0] - truth))
    slope = -np.polyfit(np.log(steps), np.log(error), 1)[0]
    assert abs(slope - order) < (0.1 if order == 2.0 else 0.25), error
    # twin: stepping over the jump is first order and much worse
    over = last_state(Kicked(end=3.0), scheme(name), equal_steps(3.0, steps[-1]))
    assert abs(over.q[0] - truth) > 10 * error[-1]


@pytest.mark.parametrize("steps", [2, 7, 100])
@pytest.mark.parametrize(("entry", "exit_"), [(1.0, 1.0), (1e-3, 1.0), (0.01, 0.2)])
def test_step_times_fill_the_phases_without_the_very_last_instant(steps, entry, exit_):
    spring = Spring(phases=((0.0, 1.3), (1.3, 3.0), (3.0, 3.7)))
    times = step_times_by_phase(spring, steps, entry_ratio=entry, exit_ratio=exit_)
    assert len(times) == 3
    assert times[0][0] == 0.0
    assert times[0][-1] == times[1][0] == 1.3
    assert times[1][-1] == times[2][0] == 3.0
    assert times[2][-1] < 3.7
    lengths = np.diff(np.concatenate([times[0], times[1][1:], times[2][1:]]))
    assert (lengths > 0.0).all()
    assert lengths.max() < 2.0 * 3.7 / steps + 1e-12 or steps < 7  # whole steps per phase
    if entry < 1.0 and steps == 100:
        assert lengths[0] / np.median(lengths) == pytest.approx(entry, rel=0.1)


# --- failure ------------------------------------------------------------------------------------------------------
class Broken(Spring):
    """Loses its solution at t = 1: the force becomes NaN, or grows without a root."""

    def __init__(self, kind, **kw):
        super().__init__(**kw)
        self.kind = kind

    def residual(self, t, q, v, a, phase):
        r = super().residual(t, q, v, a, phase)
        if t >= 1.0:
            return np.full_like(r, np.nan) if self.kind == "nan" else 1.0 + r * r
        return r


@pytest.mark.parametrize("kind", ["nan", "rootless"])
@pytest.mark.parametrize("name", [s for s in SCHEMES if s != "central-difference"])
def test_an_unconverged_state_never_leaves_and_the_failure_says_when_and_why(kind, name):
    states = []
    with pytest.raises(NewtonStalled) as caught:
        states.extend(integrate(Broken(kind), scheme(name), equal_steps(3.0, 100)))
    assert 0.95 <= states[-1].t <= 1.01  # balances of the last step lie before its end
    assert all(np.isfinite(x.q).all() for x in states)
    assert 0.95 <= caught.value.t <= 1.03
    assert "|r|" in caught.value.cause
    assert "steps" in caught.value.advice


@pytest.mark.parametrize("part", [None, 1.0])
def test_a_step_too_long_for_newton_is_taken_in_pieces(part):
    """Also where the system may take a part of each step: pieces are of the step, not of what is left of it."""

    class Touchy(Spring):
        """Defined only within 0.04 of the last instant that had a residual."""

        reached = candidate = 0.0

        def residual(self, t, q, v, a, phase):
            if t != self.candidate and t > self.candidate:
                self.reached = self.candidate
            if t - self.reached > 0.04:
                return np.full(1, np.nan)
            self.candidate = t
            return super().residual(t, q, v, a, phase)

    work, system = Work(), Touchy(end=1.0)
    if part is not None:
        system.adaptive, system.step_fraction = True, lambda x, since: part
    states = list(integrate(system, scheme("trapezoidal"), equal_steps(1.0, 10), work=work))
    np.testing.assert_allclose([x.t for x in states], np.linspace(0.0, 1.0, 41))
    assert work.rejected == 2 * 10  # a tenth, its half, its quarter
    assert work.steps == 4 * 10


def test_many_steps_at_once_are_longer_than_rounding():
    """Two steps that end at one instant have no spline."""
    requested = []

    class Strides(Spring):
        many_steps = adaptive = True

        def step_fraction(self, x, since, ahead=0.0):
            return 0.5 if ahead == 0.0 else 3e-14

        def solve_steps(self, t, *state):
            requested.append(t)
            return NO_STEPS

    for _ in integrate(Strides(end=1.0), scheme("trapezoidal"), equal_steps(1.0, 100)):
        pass
    assert len(requested) > 3
    assert min((np.diff(t) / t[1:]).min(initial=1.0) for t in requested) > 3e-15


def test_a_scheme_that_nobody_knows_is_named():
    with pytest.raises(ValueError, match="unknown scheme"):
        scheme("leapfrog")
