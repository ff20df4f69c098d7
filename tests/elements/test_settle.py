"""The compiled Newton's method of the elements against the driver's own, which knows no mesh and no band."""

import math
from itertools import pairwise

import numpy as np
import pytest

from cablefem.elements.fixed import FixedElements
from cablefem.elements.following import FollowingElements
from cablefem.newmark import (
    NO_STEPS,
    NewtonStalled,
    Work,
    integrate_blocks,
    scheme,
    state_inside_step,
    step_times_by_phase,
    take_newmark_step,
)
from cablefem.newmark.tableau import tableau
from cablefem.scene import Scene
from tests.runs import DAMPED, LEVEL, STEEP
from validation.core.running import Run


def without_compiled_steps(system):
    """Return the system with nothing compiled but its residuals and tangents."""
    system.solve_step, system.solve_steps = lambda *step: take_newmark_step(system, *step), lambda *steps: NO_STEPS
    return system


def positions_work_and_tensions(system, steps, rule):
    """Return q at the end of each step up to where the run ends, the work, and the least tensions that are told."""
    work, q, least = Work(), [], []
    try:
        for states in integrate_blocks(system, scheme(rule), step_times_by_phase(system, steps), work=work):
            q += [x.q for x in states]
            least += [math.nan] * (len(states) - 1) + [system.min_tension_and_position[0]]
    except NewtonStalled:
        pass
    return np.array(q), work, np.array(least)


@pytest.mark.parametrize("rule", ["trapezoidal", "newmark", "generalized-alpha"])
@pytest.mark.parametrize("model", ["full", "string", "sagged", "stretching"])
def test_steps_are_those_of_the_interpreted_iteration(model, rule):
    kind = {"elements": 4, "model": model}
    one, other = FollowingElements(DAMPED, **kind), without_compiled_steps(FollowingElements(DAMPED, **kind))
    (q, work, least), (want, same_work, same_least) = (
        positions_work_and_tensions(one, 90, rule),
        positions_work_and_tensions(other, 90, rule),
    )
    assert q.shape == want.shape
    # the same operations in another order; the Newton iterations end at 1e-4 of the load, far above rounding
    assert np.abs(q - want).max() <= 1e-9 * np.abs(want).max()
    told = np.isfinite(least[1:])  # after the last of many steps in one go
    assert np.count_nonzero(told) > 1
    assert least[1:][told] == pytest.approx(same_least[1:][told], rel=1e-7)
    assert work == same_work


def test_a_slack_cable_whose_corrections_are_halved_and_steps_cut_ends_the_same_way():
    """The elastic law past the slack onset: guesses are dropped, corrections halved, steps cut, and the run stalls."""
    runs = [
        positions_work_and_tensions(s, 240, "trapezoidal")
        for s in (FollowingElements(LEVEL), without_compiled_steps(FollowingElements(LEVEL)))
    ]
    (q, work, _), (want, same_work, _) = runs
    assert work.residuals > work.newton_iterations, "nothing was halved: the test shows nothing"
    assert min(work.rejected, same_work.rejected) > 0
    # compression makes the elastic law ill-posed: from there on rounding grows, so only the end of the run is alike
    n = len(want) // 2
    assert np.abs(q[:n] - want[:n]).max() <= 1e-7 * np.abs(want[:n]).max()
    assert abs(len(q) - len(want)) <= 2


@pytest.mark.parametrize("element", ["hermite", "p1"])
def test_so_are_those_of_elements_the_mass_moves_through(element):
    kind = {"elements": 9, "element": element, "coupling": "chain" if element == "hermite" else "naive"}
    one, other = FixedElements(STEEP, **kind), without_compiled_steps(FixedElements(STEEP, **kind))
    (q, work, _), (want, same_work, _) = (
        positions_work_and_tensions(one, 90, "newmark"),
        positions_work_and_tensions(other, 90, "newmark"),
    )
    assert np.abs(q - want).max() <= 1e-9 * np.abs(want).max()
    assert work == same_work


@pytest.mark.parametrize(
    ("scene", "end", "settings"),
    [
        *(("level", end, {"scheme": "trapezoidal"}) for end in (0.3, 0.31, 1.0)),
        *(("level", 1.0, {"scheme": scheme}) for scheme in ("radau", "gauss")),
        *(("tramway", 0.8, {"scheme": scheme}) for scheme in ("generalized-alpha", "radau", "gauss")),
    ],
)
def test_a_run_ends_at_the_same_step_whether_steps_are_taken_in_one_go_or_not(scene, end, settings):
    run, alone = (Run(Scene.load(scene), "following-p2", elements=3, steps=150, **settings) for _ in range(2))
    alone.history.solver.many_steps = False
    one, other = run.run_to(end), alone.run_to(end)
    assert np.array_equal(one.t, other.t)
    assert np.abs(one.v - other.v).max() <= 1e-9 * np.abs(other.v).max()
    assert one.work == other.work
    assert one.slack_onset == other.slack_onset


def test_steps_taken_in_one_go_remember_what_was_inside():
    run = Run(Scene.load("tramway"), "following-p2", elements=3, steps=150, scheme="radau")
    run.run_to(0.4)
    rule, states = tableau(run.scheme.nodes), run.history.states
    for before, after in pairwise(states[20:40]):
        for t, a in zip(rule.node_times(np.array([before.t, after.t]))[0], after.inside.a, strict=True):
            x = state_inside_step(after, t)
            assert np.abs(x.a - a).max() <= 1e-8 * np.abs(a).max()
            r = run.history.solver.residual(t, x.q, x.v, x.a, x.phase)
            assert np.linalg.norm(r) <= 1.1e-4 * run.history.solver.force_scale
