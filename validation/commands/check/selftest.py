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

FAULT = {"mass.mass": "+1%"}


def verdict_with_mass_fault(result: Check) -> Verdict:
    """Compare a check's first solver with its second one, run at half the resolution and steps with 1 % more mass.

    The judge knows the check's scene alone.
    """
    scene = result.scene
    coarse = (*result.b.space.runs, result.b.finest)[0]
    shorter = (*result.b.time.runs, result.b.finest)[0]
    settings = coarse.settings | {"steps": shorter.settings["steps"]}
    stop = View.of_scene(scene).last_needed_position
    faulty = run_with_error_bars(scene.replace(FAULT), find_method(coarse.method), until=stop, **settings)
    toml = scene.to_toml()
    faulty = faulty.map(lambda r: replace(r, scene_toml=toml))
    return worst_deciding_verdict(compare(scene, result.a, faulty, tol=result.tol))


def line_verdict_with_mass_fault(
    check_line: Callable[..., Any], line: Line, tol: float, tol_tension: float | None
) -> Verdict:
    """Check a line whose second solver has 1 % more mass of the first car.

    check_line : of a line at rest or in motion.
    """
    fault = {f"car.{line.car[0].name}.mass": FAULT["mass.mass"]}
    verdict: Verdict = check_line(line, tol, tol_tension, line.replace(fault)).verdict
    return verdict


def self_test_sentence(verdict: Verdict, method: str, tol: float) -> str:
    """What the self-test says of the verdict; method : of the second solver."""
    planted = f"self-test: 1 % more mass for {method}"
    if verdict is Verdict.DISAGREE:
        return f"{planted} is seen"
    return f"{planted} is NOT seen ({verdict.value}); at --tol {tol:g} this check would miss such a fault"
