"""Cars that roll: the row of s_o against the Lagrangian it is made of, compiled steps, energy to rounding."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from cablefem import Scene
from cablefem.elements.fixed import FixedElements
from cablefem.elements.observing import observe_cable
from cablefem.elements.rolling import RollingElements, make_following_elements
from cablefem.newmark import (
    Newton,
    State,
    Work,
    collocate_first_step,
    integrate,
    scheme,
    stack_states,
    step_times_by_phase,
    take_newmark_step,
)
from cablefem.scene.statics import gripped_rest
from tests.runs import LEVEL
from validation import run
from validation.oracles import ellipse


def zip_line_scene(mass=95.0, **drive):
    """Return the zip line of 300 m; drag throughout unless said otherwise."""
    drive = {"mode": "free", "start": 2.0, "drag_area": 0.6, "end": {"time": 60.0}} | drive
    cable = {"mass_per_length": 1.1, "EA": 1.2e7, "sag": 6.0}
    return Scene(cable=cable, supports={"span": 300.0, "drop": 15.0}, mass={"mass": mass}, drive=drive)


ZIP = zip_line_scene()
FAST = Scene(
    cable={"mass_per_length": 13.3, "EA": 2.52e8, "horizontal_tension": 4.5e5}, mass={"mass": 8100.0},
    supports={"span": 700.0, "drop": -341.0}, drive={"mode": "haul"},
    travel={"kind": "accelerate_cruise_brake", "top_speed": 100.0},
)  # fmt: skip
G = ZIP.groups
DAMPED = {"method": "generalized-alpha", "rho_inf": 0.9}


# --- the equations ------------------------------------------------------------------------------------------------
def lagrangian(system, q, v):
    """L of cable and car at unknowns (q, s_o) and their rates, from the energies."""
    g, s_o, ds = system.groups, q[-1], v[-1]
    cable = observe_cable(system, np.array([[s_o], [ds], [0.0]]), stack_states([State(0.0, q, v, 0.0 * q)]))
    _, xp, yp = g.tension_and_slope(s_o)
    m = 2 * system.node
    velocity = v[m : m + 2] + ds * np.array([xp, yp])
    depth = g.coordinates(s_o)[1] + q[m + 1]
    energy = float((cable.kinetic - cable.strain - cable.potential)[0])
    return energy + 0.5 * g.mu * velocity @ velocity + g.mu * g.sigma * depth


def lagrange_by_differences(system, q, v, a):
    """Return d/dt dL/dv - dL/dq by central differences, along q + t v + t^2 a/2."""

    def gradient(f, x, h):
        return np.array([(f(x + h * e) - f(x - h * e)) / (2.0 * h) for e in np.eye(x.size)])

    h = 1e-4
    momentum = [
        gradient(lambda x, t=t: lagrangian(system, q + t * v + 0.5 * t * t * a, x), v + t * a, 1.0) for t in (h, -h)
    ]  # exact: L is quadratic in v
    return (momentum[0] - momentum[1]) / (2.0 * h) - gradient(lambda x: lagrangian(system, x, v), q, 1e-6)


def random_rolling_state(system, size=0.004):
    rng = np.random.default_rng(61)
    q, v, a = (f * rng.standard_normal(system.n_dof) for f in (size, 0.1, 0.7))
    q[-1], v[-1], a[-1] = 0.37, 0.31, -0.23
    return q, v, a


@pytest.mark.parametrize("law", ["elastic", "tension-only"])
def test_the_rows_are_lagranges_equations(law):
    groups = replace(G, alpha=83.0, drive=replace(G.drive, k=0.0))
    system = RollingElements(groups, elements=3, degree=2, grading=1.4, law=law)
    q, v, a = random_rolling_state(system, 0.01)
    r, want = system.residual(0.4, q, v, a, 0), lagrange_by_differences(system, q, v, a)
    if law == "tension-only":
        assert np.abs(r - RollingElements(groups, elements=3, grading=1.4).residual(0.4, q, v, a, 0)).max() > 1e-2
    # differences of second order at 1e-4 and rounding of 1e-16/1e-6 in L
    np.testing.assert_allclose(r, want, rtol=0.0, atol=3e-7 * np.abs(want).max())
    assert abs(r[-1]) > 1e-3 * np.abs(r).max(), "the last row vanishes: the test shows nothing"
    a[-1] *= 1.001  # the row feels its own acceleration, 0.1 % of it
    assert abs(system.residual(0.4, q, v, a, 0)[-1] - want[-1]) > 1e-5


@pytest.mark.parametrize("degree", [2, 4])  # loops of degree 2 have a version of their own
@pytest.mark.parametrize("drive", ["free", "haul"])
def test_the_tangent_is_the_derivative_of_the_residual(drive, degree):
    forces = replace(G.drive, mode=drive, k=0.7, wind=0.2, thrust_table=((0.0, 0.02), (9.0, 0.05)))
    groups = replace(G if drive == "free" else Scene.load("level").groups, drive=forces, damping=0.83)
    rng = np.random.default_rng(62)
    # left out: friction by velocity; by place the turning of the tangent and parts of the corner
    for mu_r, c, bound in ((0.3, (0.0, 0.0, 1.3), 1e-6), (0.0, (0.0, 0.9, 1.3), 1e-6), (0.0, (1e-4, 0.05, 1.3), 1e-3)):
        rolling = replace(groups, drive=replace(forces, mu_r=mu_r))
        system = RollingElements(rolling, elements=3, degree=degree, grading=1.4)
        q, v, a = random_rolling_state(system, 1e-4)
        x = rng.standard_normal(system.n_dof)
        _, solve = system.linearise(0.9, q, v, a, 0, c)
        near = [system.residual(0.9, q + h * c[0] * x, v + h * c[1] * x, a + h * c[2] * x, 0) for h in (1e-6, -1e-6)]
        quotient = (near[0] - near[1]) / 2e-6
        assert np.abs(solve(quotient.copy()) - x).max() < bound * np.abs(x).max()


def test_steps_are_those_of_the_interpreted_iteration():
    one, other = (RollingElements(G, elements=4) for _ in range(2))
    other.solve_step = lambda *step: take_newmark_step(other, *step[:-1], step[-1]._replace(patience=0))
    work, same = Work(), Work()
    states, want = (
        stack_states(list(integrate(s, scheme("generalized-alpha", rho_inf=0.9), [np.linspace(0.0, 3.0, 61)], work=w)))
        for s, w in ((one, work), (other, same))
    )
    assert np.abs(states.q - want.q).max() < 1e-9
    assert (work.newton_iterations, work.residuals) == (same.newton_iterations, same.residuals)


def test_what_cannot_roll_says_so():
    with pytest.raises(ValueError, match="model stretching has no balance along the cable"):
        RollingElements(G, model="stretching")
    with pytest.raises(ValueError, match="needs the full model and a mass"):
        RollingElements(G, load="force")
    with pytest.raises(ValueError, match="needs mass-following elements"):
        FixedElements(G)
    with pytest.raises(ValueError, match="drive grip"):
        RollingElements(LEVEL)
    assert type(make_following_elements(G, elements=2)) is RollingElements
    assert type(make_following_elements(LEVEL, elements=2)) is not RollingElements


# --- statics ------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("stiffness", "elements"), [(1e2, 8), (1e4, 12), (1e5, 16)])
def test_under_a_car_of_a_thousand_cables_weight_the_cable_rests_without_folds(stiffness, elements):
    """Newton's method from the empty cable's shape finds folds there, 0.1 l off."""
    groups = ellipse.free_ride_on_stiff_rope(stiffness).groups
    groups = replace(groups, drive=replace(groups.drive, start=0.2))
    system = RollingElements(groups, elements=elements)
    q = system.start(0, None).q
    place = np.ravel(groups.coordinates(0.2)) + q[2 * system.node : 2 * system.node + 2]
    np.testing.assert_allclose(place, gripped_rest(0.2, groups).car_point[0], rtol=0, atol=1e-6)


# --- rides --------------------------------------------------------------------------------------------------------
SECOND = 1.0 / ZIP.time_scale


def test_a_rest_next_to_a_support_is_found_to_rounding_on_short_elements():
    """There slopes carry the rounding of displacements over the length of an element."""
    scene = Scene.load("tramway")
    drive = replace(scene.groups.drive, mode="free", start=5e-4, end_time=9.0, nominal=9.0)
    groups = replace(scene.groups, mu=3.0, drive=drive, motion=None)
    system = RollingElements(groups, elements=200)
    system.start(0, None)
    assert abs(system.hold - gripped_rest(5e-4, groups).hold[0]) < 1e-6 * groups.mu * groups.sigma


@pytest.mark.parametrize("method", ["radau", "gauss"])
@pytest.mark.parametrize("mode", ["free", "haul"])
def test_compiled_collocation_of_a_ride_is_that_of_its_residuals_and_tangents(mode, method):
    class Plain(RollingElements):
        def collocate_steps(self, *step):
            return collocate_first_step(self, *step)

    groups = zip_line_scene(rolling_friction=0.02).groups if mode == "free" else Scene.load("tramway").groups
    ends, works = [], []
    for cls in (Plain, RollingElements):
        system, work = cls(groups, elements=3), Work()
        system.step_fraction = lambda *x: 1.0  # steps in one go are foreseen, and others than those taken one by one
        states = integrate(system, scheme(method), step_times_by_phase(system, 200), newton=Newton(tol=1e-6), work=work)
        ends.append(list(itertools.islice(states, 25))[-1])
        works.append(work)
    assert works[0].steps == works[1].steps
    # factors that serve several steps give the same to Newton's tolerance; the last unknown of a hauled car is idle
    assert np.abs(ends[1].q - ends[0].q)[:-1].max() <= 1e-6 * np.abs(ends[0].q[:-1]).max()
    assert works[1].factorisations < works[0].factorisations


@pytest.mark.parametrize("settings", [{"method": "trapezoidal"}, DAMPED, {"method": "radau"}], ids=str)
def test_a_hauled_car_lifts_off_in_strides_as_step_by_step(settings):
    groups = FAST.groups
    named = {"name": settings["method"]} | {k: v for k, v in settings.items() if k != "method"}

    def lifts(many_steps):
        system, work = RollingElements(groups, elements=4), Work()
        system.many_steps = many_steps
        states = integrate(system, scheme(**named), step_times_by_phase(system, 400), work=work)
        n = sum(1 for _ in itertools.takewhile(lambda x: x.t < 2.8, states))  # it does not come down again
        return [(e.name, e.t) for e in work.events], n

    alone, (found, n) = lifts(False), lifts(True)
    assert [name for name, _ in found] == ["lift_off"]
    assert found[0][1] == pytest.approx(alone[0][0][1], rel=1e-6)
    assert n == alone[1]


@pytest.mark.parametrize("settings", [DAMPED, {"method": "radau"}], ids=["generalized-alpha", "radau"])
def test_a_ride_in_strides_is_the_one_step_by_step(settings):
    """Thrust that ends, release, brake, arrival: at the same instants the same to Newton's tolerance."""
    thrust = {"times": [0.0, 6.0, 11.0], "forces": [40.0, 90.0, 0.0]}
    brake = [{"from": 110.0, "force": 23.0}, {"from": 160.0, "force": 12.0}]
    drive = {"rolling_friction": 0.013, "thrust": thrust, "brake": brake, "release": 1.5, "end": {"place": 185.0}}
    groups, newton = zip_line_scene(**drive).groups, Newton(tol=1e-7)

    def places(grids, **kind):
        system, work = RollingElements(groups, elements=4), Work()
        for name, value in kind.items():
            setattr(system, name, value)
        states = list(integrate(system, scheme(**named), grids, newton=newton, work=work))
        return np.array([(x.t, *x.q[-1:], *x.q[4:8]) for x in states]).T, [(e.name, e.t) for e in work.events]

    named = {"name": settings["method"]} | {k: v for k, v in settings.items() if k != "method"}
    nominal = groups.drive.nominal
    grids = [np.arange(t0, min(t1, 3.0 * nominal), nominal / 300) for t0, t1 in groups.drive.phases]
    (t, *many_steps), events = places(grids)
    assert [name for name, _ in events][-3:] == ["brake", "brake", "arrival"]
    whole = [np.unique(np.append(t[(t >= t0) & (t <= t1)], t0)) for t0, t1 in groups.drive.phases]
    whole[-1] = np.append(whole[-1], t[-1] + nominal / 300)  # it may arrive by rounding later
    (again, *alone), same = places(whole, many_steps=False, step_fraction=lambda *x: 1.0)
    assert [name for name, _ in same] == [name for name, _ in events]
    assert np.abs([a[1] - b[1] for a, b in zip(same, events, strict=True)]).max() < 1e-7
    assert np.abs(np.interp(again, t, many_steps[0]) - alone[0]).max() < 1e-7


def test_a_heavy_car_slips_on_until_the_farther_support_answers():
    """It gains little on its first jump: ringing heeded after half of that time would still stop it."""
    scene = zip_line_scene(2000.0, rolling_friction=0.02, end={"time": 0.15})
    coarse, fine = (
        run(scene, "following-p2", elements=n, steps=m, scheme="radau").speed[-1] for n, m in ((20, 200), (40, 1000))
    )
    assert abs(coarse - fine) < 1e-4
