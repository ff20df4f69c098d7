"""Every exact answer held against the solvers.

A row agrees when the finest run lies within its own bar, and errors fall with the order of theory.  Some rows must
disagree: a wrong method, another limit, a law without one of its terms.  A row that cannot be computed has the verdict
"failed" with a reason, and is never as expected.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cablefem import newmark
from cablefem.newmark import stack_states
from cablefem.newmark.equilibrium import solve_equilibrium
from cablefem.response import Array, Response, write_json
from cablefem.scene import Drive, Groups, Scene
from cablefem.scene.line import Line, LineRest
from cablefem.scene.motion import rest_motion
from validation import oracles
from validation.commands.modes.study import scaled_cable_frequencies
from validation.core import store
from validation.core.crossing import compute_dimensionless_path
from validation.core.methods import ELEMENTS, LEVELS, METHODS, TERMS, find_method
from validation.core.running import run
from validation.core.sidebyside import Progress, no_progress
from validation.oracles.case import Case, Crossing, Rung, Solvers
from validation.oracles.case import Path as MassPath

ROWS = "oracles.jsonl"
RESULT = "oracles.json"
Row = dict[str, Any]
SAFETY = 1.5  # of the remaining change by the order, between Roache's 1.25 for three grids and 3 for two


@dataclass(frozen=True, slots=True)
class Task:
    """A row still to be computed."""

    oracle: str
    case: Case
    method: str

    @property
    def key(self) -> tuple[str, str, str]:
        return self.oracle, self.case.name, self.method

    def compute_row(self, solvers: Solvers | None = None) -> Row:
        """Run the case's ladder, compare every rung with the exact answer; what breaks has the verdict "failed".

        ladder : what was refined, coarse to fine; sizes : resolution, or one over the parameter of a limit;
        errors : relative rms, nan of a run that broke; error, worst : rms and largest of the finest;
        observed_order : nan where none shows; reason : what kept the row from being computed, else empty.
        """
        solvers = solvers or SOLVERS
        case = self.case
        method = self.method
        rungs = case.ladder(solvers, method)
        p, because = case.expected_order(solvers, method)
        settings = [", ".join(f"{k} {v:g}" for k, v in rung.settings.items()) for rung in rungs]
        row = {
            "oracle": self.oracle, "case": case.name, "method": method, "ladder": settings, "refined": case.refined,
            "sizes": [rung.size for rung in rungs], "expected_order": p, "because": because,
            "expected": case.expected_verdict(solvers, method),
        }  # fmt: skip
        try:
            return row | self._run_and_judge(solvers, rungs, p)
        except Exception as error:  # whatever breaks in one row, the others are still worth having
            row |= dict.fromkeys(("error", "worst", "observed_order", "allowed"), math.nan)
            reason = f"{type(error).__name__}: {error}"
            errors = [math.nan] * len(rungs)
            return row | {"errors": errors, "allowed_because": "it broke", "verdict": "failed", "reason": reason}

    def _run_and_judge(self, solvers: Solvers, rungs: Sequence[Rung], p: float | None) -> Row:
        """Run every rung; return errors, what is allowed, and the verdict."""
        case = self.case
        answers = [case.compute_answer(solvers, self.method, rung) for rung in rungs]
        largest, rms = zip(*[case.largest_and_rms_error(answer) for answer in answers], strict=True)
        sizes = [rung.size for rung in rungs]
        size_ratio = sizes[-1] / sizes[-2]
        gap = case.relative_distance(*answers[-2:])
        if gap is None:
            allowed, why = _allowed_deviation_from_limit(size_ratio, p, rms[-2])
        else:
            allowed, why = _own_error_bar(size_ratio, p, gap)
        if not math.isfinite(allowed):
            why = "the run broke"
        observed = observed_order(sizes, rms)
        verdict = verdict_of_row(rms[-1], allowed, observed, p)
        return {
            "errors": list(rms), "error": rms[-1], "worst": largest[-1], "observed_order": observed,
            "allowed": allowed, "allowed_because": why, "verdict": verdict, "reason": "",
        }  # fmt: skip


def _allowed_deviation_from_limit(size_ratio: float, order: float | None, previous: float) -> tuple[float, str]:
    """The allowed deviation of the last run of a limit, and why; previous : deviation of the run before."""
    assert order is not None
    return SAFETY * previous / size_ratio**order, f"{SAFETY} x the deviation before, fallen with order {order:g}"


def _own_error_bar(size_ratio: float, order: float | None, gap: float) -> tuple[float, str]:
    """The error bar of the finest run from its gap to the run before, and how it is made; order : of theory."""
    most = 1.5  # largest order that is credited: wave fronts pass the mass as spikes
    credited = 1.0 if order is None else min(order, most)
    bar = SAFETY * gap / (size_ratio**credited - 1.0)
    return bar, f"own error bar: {SAFETY} x gap to the run before / (ratio to the {credited:g} - 1)"


def all_tasks() -> list[Task]:
    """All rows of the table, by groups of exact answers."""
    out = []
    for name, oracle in sorted(oracles.find_oracles().items(), key=lambda entry: entry[1].group):
        for case in oracle.cases():
            out += [Task(name, case, method) for method in case.methods or METHODS]
    return out


def write_oracle_table(out: Path, progress: Progress = no_progress, *, quick: bool = False) -> Row:
    """Compute all rows and write oracles.json; an interrupted table goes on where it stopped.

    quick : of each heading a comparison that must agree and one that must not.
    """
    tasks = all_tasks()
    if quick:
        tasks = _one_task_of_each_group_and_verdict(tasks)
    jobs = {json.dumps(task.key): task for task in tasks}
    report = partial(progress, "oracles")
    results = store.compute_and_store_missing(out / ROWS, jobs, lambda task: task.compute_row(), report)
    rows = list(results.values())
    as_expected = all(row["verdict"] == row["expected"] for row in rows)
    exact = []
    for name, oracle in oracles.find_oracles().items():
        words = {word: getattr(oracle, word) for word in ("title", "source", "validity", "group")}
        exact.append({"name": name} | words)
    content = {"verdict": "agree" if as_expected else "disagree", "rows": rows, "oracles": exact}
    write_json(out / RESULT, content)
    (out / ROWS).unlink()
    return content


def _one_task_of_each_group_and_verdict(tasks: list[Task]) -> list[Task]:
    """The first task of each group of exact answers and expected verdict."""
    exact = oracles.find_oracles()
    first: dict[tuple[str, str], Task] = {}
    for task in tasks:
        group = exact[task.oracle].group
        expected = task.case.expected_verdict(SOLVERS, task.method)
        first.setdefault((group, expected), task)
    return list(first.values())


def observed_order(sizes: Sequence[float], errors: Sequence[float]) -> float:
    """Slope of log(error) on log(1/size); nan where a run failed or the error does not fall.

    Finest runs with zero error do not count.
    """
    e = np.trim_zeros(np.asarray(errors, float), "b")
    computed = np.isfinite(e).all() and np.all(e > 0.0) and e.size > 1
    if not (computed and e[-1] < e[0]):
        return math.nan
    return float(-np.polyfit(np.log(sizes[: e.size]), np.log(e), 1)[0])


def verdict_of_row(error: float, allowed: float, order: float, expected_order: float | None) -> str:
    """The verdict: the error is allowed, and falls with the expected order, if there is one."""
    close = math.isfinite(error) and error <= allowed
    scatter = 0.3  # of an order from three or four runs: fronts meet the mass elsewhere in each mesh
    falls = expected_order is None or order >= expected_order - scatter
    return "agree" if close and falls else "disagree"


BASES = {  # of frequencies: what is refined; order and why
    "P2 elements": (ELEMENTS, 4.0, "twice the degree: frequencies are stationary values"),
    "sines": (TERMS, 3.0, "coefficients of symmetric modes fall like 1/n³ against sines' own ends"),
    "wavelets": (LEVELS, 3.0, "db4 reproduces cubics: three orders at least"),
}


class _Solvers:
    """Solvers for the cases; dimensionless, but `run_scene` in SI."""

    def theoretical_order(self, method_name: str) -> tuple[float | None, str]:
        """Order of the path, None if it is wrong, and why."""
        if method_name in BASES:
            return BASES[method_name][1:]
        method = find_method(method_name)
        if method.wrong:
            return None, "none: the centrifugal force is lost at the nodes, it converges to something else"
        if method.space_order <= 1.0:
            return method.space_order, "the kink under the mass lies inside an element or between the basis's waves"
        return method.space_order, (
            "a node or a hat rides on the mass, so the kink costs nothing; the jump of curvature at the mass and at "
            "fronts is left"
        )

    def rungs(self, method_name: str, *, finer: float = 1.0) -> list[Rung]:
        """Four rungs of a method; three of a basis, and where one more would cost minutes."""
        if method_name in BASES:
            resolution = BASES[method_name][0]
            values = (0, 1, 2) if resolution.doubling else (10, 20, 40)
            return [Rung({resolution.setting: n}, resolution.unknowns(n)) for n in values]
        method = find_method(method_name)
        sharp = method.resolution.doubling and method.space_order > 1.0
        slow = finer > 1.0 or sharp or method.steps_exponent > 2.0
        out = []
        for settings in method.settings_from_coarse_to_fine(3 if slow else 4, finer):
            unknowns = method.resolution.unknowns(method.resolution_value(settings))
            out.append(Rung(method.resolution_and_steps(settings), unknowns))
        return out

    def mass_path(self, crossing: Crossing, method_name: str, **settings: Any) -> MassPath:
        if crossing.scene:
            scene = Scene.load(crossing.scene)
            r = run(scene, method_name, model="string", until=crossing.until, **settings)
            return MassPath(r.t / scene.time_scale, r.s_o / r.length, r.v / r.length)
        return MassPath(*compute_dimensionless_path(crossing.groups, method_name, settings, **crossing.run_arguments))

    def frequencies(self, method_name: str, groups: Groups, model: str, count: int, **settings: Any) -> Array:
        return scaled_cable_frequencies(groups, degree=2, model=model, n=count, **settings)

    def damped_frequencies(self, method_name: str, groups: Groups, model: str, count: int, **settings: Any) -> Any:
        """Matrices of the linear model column by column, then its quadratic eigenvalues i w."""
        bare = replace(groups, mu=0.0, motion=rest_motion(0.4, 1.0))
        system = _build_system(method_name, bare, model, settings)
        n = system.n_dof
        unit = np.eye(n)
        none = np.zeros((n, n))
        at_rest_residual = system.residual(0.0, none[0], none[0], none[0], 0)

        def matrix(q: Array, v: Array, a: Array) -> Array:
            residuals = [system.residual(0.0, *state, 0) for state in zip(q, v, a, strict=True)]
            return (np.array(residuals) - at_rest_residual).T

        K = matrix(unit, none, none)
        C = matrix(none, unit, none)
        M = matrix(none, none, unit)
        accelerations = [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]
        A = np.block([[none, unit], accelerations])  # (2 n, 2 n)
        omega = -1j * np.linalg.eigvals(A)
        return np.sort_complex(omega[omega.real > 0.0])[:count]

    def release_string(
        self, method_name: str, groups: Groups, p: float, end_time: float, **settings: Any
    ) -> tuple[Array, Array]:
        """Release a straight string that the weight of groups holds at p; return t, and w at p."""
        groups = replace(groups, motion=rest_motion(p, end_time))
        loaded = _build_system(method_name, groups, "straight", settings)
        free = _build_system(method_name, replace(groups, mu=0.0), "straight", settings)
        rest = solve_equilibrium(loaded)
        start = newmark.consistent_acceleration(free, 0.0, rest, np.zeros_like(rest), 0)
        steps = find_method(method_name).complete_settings(settings)["steps"]
        times = np.linspace(0.0, end_time, 1 + steps)
        states = [start, *newmark.integrate(free, newmark.scheme("trapezoidal"), [times], start=start)]
        history = stack_states(states)
        path = free.observe(history, np.zeros(0), np.zeros(0, np.intp)).path
        return history.t, path[:, 1]

    def run_scene(self, scene: Scene, method_name: str, **settings: Any) -> Response:
        return run(scene, method_name, **settings)

    def holding_force(self, groups: Groups, method_name: str, start: float, **settings: Any) -> float:
        """Force along the cable that holds a free car at its start."""
        groups = replace(groups, motion=None, drive=Drive(mode="free", start=start, end_time=1.0, nominal=1.0))
        solver = _build_system(method_name, groups, "full", settings)
        solver.start(0, None)
        return float(solver.hold)

    def line_at_rest(self, line: Line, method_name: str, **settings: Any) -> LineRest:
        from cablefem import catenary_line
        from cablefem.elements import line as elements

        solve = catenary_line.solve if method_name == "catenaries" else elements.solve
        return line.solve_at_rest(lambda cases: solve(cases, **settings))


SOLVERS: Solvers = _Solvers()


def _build_system(method_name: str, groups: Groups, model: str, settings: dict[str, Any]) -> Any:
    method = find_method(method_name)
    return method.build(groups, method.settings_for_scene(groups, settings), model=model, load="mass", law="elastic")
