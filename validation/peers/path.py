"""The path of the mass in another code, cut where it fails."""

from dataclasses import dataclass

import numpy as np

from cablefem.newmark import Array
from cablefem.scene import Groups, Motion


@dataclass(frozen=True, slots=True)
class PeerPath:
    """The mass path; lengths over l, time over l sqrt(rho/H)."""

    s_o: Array  # (n,) along the static cable
    u: Array  # (n,) horizontal displacement from the static shape
    v: Array  # (n,) vertical one, down
    t: Array  # (n,)
    seconds: float  # wall time of the time loop
    note: str  # why it ends early, or ""

    @property
    def reached(self) -> float:
        return float(self.s_o[-1])


def travel(groups: Groups, elements: int) -> Motion:
    if groups.drive.mode != "grip":
        raise ValueError(f"a car that rolls (drive {groups.drive.mode}) cannot be run there: it would grip the cable")
    if groups.motion is None or groups.mu <= 0.0:
        raise ValueError("only scenes with a travelling mass can be run in another code")
    counted(elements)
    return groups.motion


def counted(elements: int) -> int:
    if not isinstance(elements, int) or elements < 4:
        raise ValueError(f"elements must be an integer >= 4, got {elements!r}")
    return elements


def trusted(s_o: Array, place: Array, t: Array, groups: Groups, seconds: float, note: str) -> PeerPath:
    """The path up to the first value that is not finite or zigzags from step to step.

    place : (n, 2) of the mass, x right, y down from the left support; equal steps.
    """
    w = place - np.stack(groups.shape(s_o), axis=1)
    broken = np.flatnonzero(~np.isfinite(w).all(axis=1))
    n = int(broken[0]) if broken.size else s_o.size
    if n < s_o.size:
        note = f"not finite from s_o/l = {s_o[n]:.4f} on"
    # static deflection of a taut string
    smooth = before_zigzag(w[:n, 1], 0.25 * groups.mu * groups.sigma, failed=bool(note))
    if smooth < n:
        n, note = smooth, f"the mass path zigzags from step to step from s_o/l = {s_o[smooth]:.4f} on"
    return PeerPath(s_o[:n], w[:n, 0], w[:n, 1], t[:n], seconds, note)


def before_zigzag(v: Array, scale: float, *, failed: bool = False) -> int:
    """How many instants come before a path zigzags from step to step.

    v : (n,) deflections at equal steps; scale : a typical one; failed : the run ended early.

    16 times the rms second difference over one step, over that of four, is 1 on a resolved path, 2.4 at a kink, above 3
    in a zigzag.  A zigzag counts if its amplitude passes 1e-3 scale, or the run failed.
    """
    window = 20
    if v.size < window + 9:
        return v.size
    one = (v[3:-5] - 2.0 * v[4:-4] + v[5:-3]) ** 2
    four = ((v[:-8] - 2.0 * v[4:-4] + v[8:]) / 16.0) ** 2
    mean = np.full(window, 1.0 / window)
    one, four = np.convolve(one, mean, "valid"), np.convolve(four, mean, "valid")
    zigzag = one > 9.0 * four
    large = one > (4e-3 * scale) ** 2
    large[-1] |= failed
    serious = np.flatnonzero(zigzag & large)
    if not serious.size:
        return v.size
    calm = np.flatnonzero(~zigzag[: serious[0]])
    return int(calm[-1]) + 5 if calm.size else 4
