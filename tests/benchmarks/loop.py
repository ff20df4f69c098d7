"""Processor time of runs in a loop, over that of the march: `python tests/benchmarks/loop.py [REPEATS]`.

Run it before and after a change, with OPENBLAS_NUM_THREADS=1. The smallest of the repeats and their range are printed.
"""

import sys
import time
from collections.abc import Callable

import cablefem as cf
from validation.core.running import Run, run

METHOD = "following-p2"
HOW = {"elements": 16, "steps": 400}
UNTIL = 0.8


def times(work: Callable[[], object], repeats: int) -> list[float]:
    """Sorted processor times [s] after a first call, which may compile."""
    work()
    found = []
    for _ in range(repeats):
        begin = time.process_time()
        work()
        found.append(time.process_time() - begin)
    return sorted(found)


def main() -> None:
    repeats = int(sys.argv[1]) if len(sys.argv) > 1 else 7
    scene = cf.Scene.load("level")
    zipline = cf.Scene.load("zipline")
    variants = list(scene.variants({"mass.mass": [2_000.0 + i for i in range(100)]}))

    def march() -> None:
        Run(scene, METHOD, **HOW).march(UNTIL, None, float("inf"))

    def with_design() -> None:
        r = cf.run(scene, METHOD, bars=False, until=UNTIL, **HOW)
        r.flags, r.design  # noqa: B018

    rows = {
        "march": march,
        "path alone": lambda: cf.run(scene, METHOD, until=UNTIL, **HOW),
        "all fields, forces, energies": lambda: run(scene, METHOD, until=UNTIL, **HOW).energy,
        "the same with flags and design numbers": with_design,
        "the same with bars of coarser runs": lambda: cf.run(scene, METHOD, until=UNTIL, **HOW).summary(),
        "100 variants, path alone": lambda: [cf.run(x, METHOD, until=UNTIL, **HOW) for x in variants],
        "quasi-static zip line": lambda: cf.quasi_static(zipline),
    }
    unit = 0.0
    print(f"{'':40} {'time [ms]':>10} {'over march':>11} {'range':>15}")
    for name, work in rows.items():
        found = times(work, 2 if "variants" in name else repeats)
        unit = unit or found[0]
        ends = f"{found[0] / unit:.1f} .. {found[-1] / unit:.1f}"
        print(f"{name:40} {1e3 * found[0]:10.1f} {found[0] / unit:11.2f} {ends:>15}")


if __name__ == "__main__":
    main()
