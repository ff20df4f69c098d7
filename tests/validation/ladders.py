"""Ladders of element runs, for tests of what is read off them."""

from dataclasses import replace

from validation.core.ladder import Branch, Ladder
from validation.core.running import run

FINE = {"elements": 12, "steps": 800, "until": 0.42}


def run_ladder(scene, change=lambda r: r, claims=None, **how):
    """Run a scene, with halves and quarters of elements and steps, and let the answers claim to be of another."""
    how = how or FINE

    def ran(**coarser):
        r = run(scene, "following-p2", **how | coarser)
        return change(replace(r, scene_toml=(claims or scene).to_toml()))

    space, time = (
        Branch(tuple(ran(**{name: how[name] // part}) for part in (2, 4)), (2.0, 2.0), 2.0)
        for name in ("elements", "steps")
    )
    return Ladder(ran(), space, time)


def ladder_without_coarser_runs(r):
    return Ladder(r, *(Branch((r,), (2.0,), 2.0) for _ in range(2)))
