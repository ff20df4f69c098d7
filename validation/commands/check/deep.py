"""Shared parts of both solvers against third parties: `check --deep`."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from cablefem import newmark
from cablefem.newmark import Work
from cablefem.response import Array, Response
from cablefem.scene import Scene
from cablefem.scene.statics import gripped_rest, hauled_rest
from validation.commands.modes.study import modes
from validation.core import measures
from validation.core.agreement import Agreement, Bound, BoundPart, no_bound
from validation.core.ladder import Ladder
from validation.core.methods import METHODS
from validation.core.order import error_bar
from validation.core.refine import path_error_bar_from_coarser_runs, run_with_error_bars
from validation.core.view import View

ROUNDING = 1e-8
HALVED = "the change from coarser runs"
RULES = "radau", "generalized-alpha"  # of elements and of sines


def shared_part_check_rows(scene: Scene, elements: Ladder) -> Iterator[Agreement]:
    """A row for each part that both solvers share and a third party can compute; elements : their runs."""
    for what, third in THIRD.items():
        try:
            row = third(scene, elements)
        except (measures.NotComparable, newmark.StepFailure) as error:
            row = Agreement("deep", math.nan, no_bound(error))
        if row is not None:
            yield replace(row, quantity="deep", law=what)


def _row_with_error_bars(gap: float, *parts: BoundPart) -> Agreement:
    return Agreement("deep", gap, Bound("error bars", parts))


def _worst_frequency_row(scene: Scene, elements: Ladder) -> Agreement:
    """The method whose frequencies are farthest from the exact ones, over what is allowed."""
    return max(modes(scene).rows, key=lambda row: row.gap / row.allowed)


def _rolling_start_against_statics_row(scene: Scene, elements: Ladder) -> Agreement | None:
    """Compare the start of a car that rolls with the catenary of two pieces; None for a car that grips."""
    r = elements.finest
    if r.drive == "grip":
        return None
    l = scene.length
    statics = (hauled_rest if r.drive == "haul" else gripped_rest)([r.s_o[0] / l], scene.groups)
    at = statics.car_point[0] * l

    def distance_from_rest(x: Response) -> float:
        return math.hypot(x.x[0] - at[0], x.y[0] - at[1]) / r.max_deflection

    bar = BoundPart(r.method, elements.error_bar(distance_from_rest), HALVED)
    return _row_with_error_bars(distance_from_rest(r), bar, BoundPart("rounding", ROUNDING))


def _time_driver_against_scipy_row(scene: Scene, elements: Ladder) -> Agreement | None:
    """Compare the rule of each solver with scipy's DOP853 on the same coarse semi-discrete system, from one state.

    None where the motion has an event or an end within the compared time.
    """
    # s_o/l of that state, and so much of the travel in so many steps
    begin = 0.1
    part = 0.05
    steps = 2000
    method = METHODS["following-p2"]
    settings = method.settings_for_scene(scene.groups, {"elements": 6, "steps": steps // 2})
    system: Any = method.build(scene.groups, settings, model="full", load="mass", law="elastic")
    states = newmark.integrate(system, newmark.scheme(RULES[0]), newmark.step_times_by_phase(system, settings["steps"]))
    first = next((x for x in states if system.position(x) >= begin), None)
    if first is None:
        return None
    t0 = first.t
    t1 = system.phases[first.phase][1]
    t1 = min(t1, t0 + part * min(system.phases[-1][1], scene.groups.drive.nominal))
    if not t1 > t0:
        return None
    n = system.n_dof
    last = n - (elements.finest.drive == "haul")  # the last unknown of a hauled car has no dynamics

    def march(rule: str, count: int) -> Array | None:
        """The unknowns at t1; None where an event or the end of the motion comes before it."""
        work = Work()
        grid = [np.linspace(t0, t1, count + 1)] * len(system.phases)
        states = newmark.integrate(system, newmark.scheme(rule), grid, work=work, start=first)
        end = next((x for x in states if x.t >= t1), None)
        return None if end is None or work.events else end.q[:last]

    by_rule = {rule: [march(rule, count) for count in (steps, steps // 2, steps // 4)] for rule in RULES}
    if any(end is None for ends in by_rule.values() for end in ends):
        return None
    zero = np.zeros(n)

    def rate(t: float, y: Array) -> Array:
        r, solve = system.linearise(t, y[:n], y[n:], zero, first.phase, (0.0, 0.0, 1.0))
        return np.concatenate([y[n:], -solve(r)])

    start = np.concatenate([first.q, first.v])
    answer = solve_ivp(rate, (t0, t1), start, "DOP853", t_eval=[t1], rtol=1e-7, atol=1e-10)
    if not answer.success:
        raise measures.NotComparable(f"scipy's integration failed: {answer.message}")
    expected = answer.y[:last, -1]
    size = float(np.abs(expected).max())
    rows = []
    for rule, ends in by_rule.items():
        gap, change, change_before = (float(np.abs(a - b).max()) / size for a, b in pairwise([expected, *ends]))
        bar = error_bar(change, change_before, (2.0, 2.0), newmark.scheme(rule).order)
        rows.append(_row_with_error_bars(gap, BoundPart(rule, bar, HALVED), BoundPart("scipy", ROUNDING)))
    return max(rows, key=lambda row: row.gap / row.allowed)


def _path_against_degree_4_row(scene: Scene, elements: Ladder) -> Agreement:
    """Compare the elements' path with degree 4 in twice the steps, with its own bar.

    Radau's rule would damp the axial waves.
    """
    r = elements.finest
    finer = r.settings | {"elements": max(4, r.settings["elements"] // 2), "steps": 2 * r.settings["steps"]}
    view = View.of_scene(scene)
    other = run_with_error_bars(scene, "following-p4", until=view.last_needed_relative_position, **finer)
    window = view.cut_to_valid_range(r, other.finest).window
    gap = measures.relative_path_gap(other.finest, r, window).largest
    bars = [BoundPart(x.method, path_error_bar_from_coarser_runs(x), HALVED) for x in (r, other.finest)]
    return _row_with_error_bars(gap, *bars)


Third = Callable[[Scene, Ladder], Agreement | None]
THIRD: dict[str, Third] = {
    "static catenary and groups: exact frequencies": _worst_frequency_row,
    "start of a car that rolls: catenary of two pieces": _rolling_start_against_statics_row,
    "time driver: scipy's DOP853 on the same system": _time_driver_against_scipy_row,
    "error bars: degree 4 in twice the steps": _path_against_degree_4_row,
}
