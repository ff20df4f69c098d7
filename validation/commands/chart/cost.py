import time
from timeit import timeit
from typing import Any

import numpy as np
from scipy.linalg import lapack
from threadpoolctl import threadpool_limits

from cablefem import newmark
from cablefem.scene import Scene


def iteration_cost_over_bare_solve(scene: Scene, *, repeats: int = 9) -> dict[str, Any]:
    """Cost of an iteration of following-p2 over LAPACK's bare banded solve of the same size, medians.

    iteration : tangent, factors and solution;  run : a run's seconds per Newton iteration.
    """
    from cablefem.elements.following import FollowingElements

    elements = 10
    steps = 480
    system = FollowingElements(scene.groups, elements=elements)
    n = system.n_dof
    band = system._band
    rng = np.random.default_rng(5)
    matrix = np.zeros((3 * band + 1, n), order="F")
    matrix[band:] = rng.standard_normal((2 * band + 1, n))
    matrix[2 * band] += 20.0
    b = rng.standard_normal(n)
    dt = system.phases[-1][1] / steps
    c = 0.25 * dt * dt, 0.5 * dt, 1.0
    grid = newmark.step_times_by_phase(system, steps)
    rows = []
    with threadpool_limits(1):
        for _ in range(repeats):
            work = newmark.Work()
            begin = time.perf_counter()
            advance = newmark.integrate(system, newmark.scheme("trapezoidal"), grid, work=work)
            x = next(x for x in advance if work.steps >= steps // 2)
            full_iteration = (time.perf_counter() - begin) / work.newton_iterations

            def solver_iteration(x: newmark.State = x) -> None:
                r, solve = system.linearise(x.t, x.q, x.v, x.a, x.phase, c)
                solve(r)

            def bare_solve() -> None:
                lapack.dgbsv(band, band, matrix, b)  # copies both

            def copy_arrays() -> None:
                matrix.copy(order="F"), b.copy()

            jobs = solver_iteration, bare_solve, copy_arrays
            one, solve_with_copy, copy = (timeit(job, job, number=200) / 200 for job in jobs)
            rows.append((solve_with_copy - copy, one, full_iteration))
    lone, one, full_iteration = np.median(rows, axis=0).tolist()
    return {
        "method": "following-p2", "elements": elements, "steps": steps, "n_dof": n, "bare_solve": lone,
        "iteration": one, "run_iteration": full_iteration, "ratio": one / lone, "run_ratio": full_iteration / lone,
    }  # fmt: skip
