"""The judge tests itself: a planted gap must be a disagreement."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from cablefem.scene.line import Line
from validation.commands.check.study import Check
from validation.core.agreement import Verdict, worst_deciding_verdict
from validation.core.methods import find_method
from validation.core.refine import run_with_error_bars
from validation.core.rows import compare
from validation.core.view import View
from validation.page import terminal

FAULT = {"mass.mass": "+1%"}


def run_and_judge_with_mass_fault(result: Check) -> Verdict:
    """Compare a check's first solver with its second one, run at half the resolution and steps with 1 % more mass.

    The judge knows the check's scene alone.
    """
    scene = result.scene
    coarse = (*result.b.space.runs, result.b.finest)[0]
    shorter = (*result.b.time.runs, result.b.finest)[0]
    settings = coarse.settings | {"steps": shorter.settings["steps"]}
    stop = View.of_scene(scene).last_needed_relative_position
    faulty = run_with_error_bars(scene.replace(FAULT), find_method(coarse.method), until=stop, **settings)
    toml = scene.to_toml()
    faulty = faulty.map(lambda r: replace(r, scene_toml=toml))
    return worst_deciding_verdict(compare(scene, result.a, faulty, tol=result.tol))


def check_with_mass_fault(check_line: Callable[..., Any], line: Line, tol: float, tol_tension: float | None) -> Any:
    """The check of a line whose second solver has 1 % more mass of the first car.

    check_line : of a line at rest or in motion.
    """
    return check_line(line, tol, tol_tension, line.replace({f"car.{line.car[0].name}.mass": FAULT["mass.mass"]}))


def print_whether_fault_is_seen(verdict: Verdict, method: str, tol: float) -> bool:
    """Whether the self-test sees its fault, which is printed; method : of the second solver."""
    seen = verdict is Verdict.DISAGREE
    missed = f"NOT seen ({verdict.value}); at --tol {tol:g} this check would miss such a fault"
    terminal.print_text(f"  self-test: 1 % more mass for {method} is {'seen' if seen else missed}")
    return seen
