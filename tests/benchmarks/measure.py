"""Processor time of runs, observation, checks and commands: `python tests/benchmarks/measure.py [REPEATS]`.

Run it before and after a change, with OPENBLAS_NUM_THREADS=1 and compiled kernels. Times of a loaded machine differ:
compare the ratios. The smallest of the repeats is printed, and the range of all over the smallest unit.
"""

import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial

import cablefem as cf
from validation.core.running import Run, run

HOW = {"following-p2": {"elements": 16, "steps": 400}, "fourier-kink": {"terms": 32, "steps": 400}}
UNTIL = 0.8
PACKAGES = "numpy, scipy.interpolate, pydantic, typer, rich, jinja2"  # of any command that draws a page
SOLVERS = "numba, skfem, meshio, h5py"
COMMANDS = {
    "--help": ["--help"],
    "scenes": ["scenes"],
    "run zipline --model quasi-static": ["run", "zipline", "--model", "quasi-static"],
    "check level": ["check", "level"],
}
FEW = 2  # repeats of what takes seconds

Work = Callable[[], object]


def own_time(work: Work) -> float:
    """Processor time [s] of a call."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


def time_of(*arguments: str) -> float:
    """Processor time [s] of an interpreter and its processes."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *arguments], capture_output=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def show(title: str, unit: float, times: dict[str, list[float]]) -> None:
    print(f"{title:46} {'time [ms]':>10} {'ratio':>8} {'range':>16}")
    for name, values in times.items():
        ends = f"{min(values) / unit:.2f} .. {max(values) / unit:.2f}"
        print(f"{name:46} {1e3 * min(values):10.1f} {min(values) / unit:8.2f} {ends:>16}")
    print()


def repeated(measure: Callable[[], float], repeats: int) -> list[float]:
    """Times after a first call, which may compile."""
    measure()
    return [measure() for _ in range(repeats)]


def runs(method: str, repeats: int, variant_count: int = 100) -> None:
    """Rows of a method over its march."""
    scene = cf.Scene.load("level")
    how = HOW[method]
    variants = list(scene.variants({"mass.mass": [2_000.0 + i for i in range(variant_count)]}))

    def whole() -> None:
        r = run(scene, method, until=UNTIL, **how)
        r.energy, r.fields  # noqa: B018

    def with_design() -> None:
        r = cf.run(scene, method, bars=False, until=UNTIL, **how)
        r.flags, r.design  # noqa: B018

    rows: dict[str, Work] = {
        "march": lambda: Run(scene, method, **how).march_until_end_or_failure(UNTIL),
        "path alone": lambda: cf.run(scene, method, until=UNTIL, **how),
        "whole response: fields, forces, energies": whole,
        "the same with flags and design numbers": with_design,
        "the same with bars of coarser runs": lambda: cf.run(scene, method, until=UNTIL, **how).summary(),
    }
    times = {name: repeated(partial(own_time, work), repeats) for name, work in rows.items()}
    times[f"{variant_count} variants, path alone"] = repeated(
        lambda: own_time(lambda: [cf.run(x, method, until=UNTIL, **how) for x in variants]), FEW
    )
    show(f"{method}, over the march", min(times["march"]), times)


def statics(repeats: int) -> None:
    zipline = cf.Scene.load("zipline")
    rows: dict[str, Work] = {
        "path and events": lambda: cf.quasi_static(zipline),
        "all fields": lambda: cf.quasi_static(zipline).fields,
    }
    times = {name: repeated(partial(own_time, work), repeats) for name, work in rows.items()}
    show("quasi-static zip line, over its path", min(times["path and events"]), times)


def commands() -> None:
    """Commands over the bare imports of the packages that a page needs."""
    times = {
        "bare interpreter": repeated(lambda: time_of("-c", "pass"), FEW),
        "its packages imported": repeated(lambda: time_of("-c", f"import {PACKAGES}"), FEW),
        "the solvers' packages, too": repeated(lambda: time_of("-c", f"import {PACKAGES}, {SOLVERS}"), FEW),
    }
    with tempfile.TemporaryDirectory() as folder:
        for name, words in COMMANDS.items():
            out = ["--out", folder + "/out"] if words[0] in ("run", "check") else []
            times[name] = repeated(partial(time_of, "-m", "validation.cli", *words, *out), FEW)
    show("commands, over the imports of packages", min(times["its packages imported"]), times)


def main() -> None:
    repeats = int(sys.argv[1]) if len(sys.argv) > 1 else 7
    for method in HOW:
        runs(method, repeats)
    statics(repeats)
    commands()


if __name__ == "__main__":
    main()
