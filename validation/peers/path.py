"""What a run of another code returns: the path of the mass, cut where it stops being an answer."""

from dataclasses import dataclass

import numpy as np

from cablefem.newmark import Array
from cablefem.scene import Groups, Motion


@dataclass(frozen=True, slots=True)
class PeerPath:
    """The mass path as another code computes it; dimensionless (lengths over l, time over l sqrt(rho/H))."""

    s_o: Array  # (n,) place of the mass along the static cable; the first row is the entry
    u: Array  # (n,) horizontal displacement of the mass from the static shape
    v: Array  # (n,) vertical one, positive down
    t: Array  # (n,)
    seconds: float  # wall time of the code's own time loop: without import, model set-up and read-out
    note: str  # why the path ends early, "" when it does not

    @property
    def reached(self) -> float:
        """The last s_o of the path."""
        return float(self.s_o[-1])


def travel(groups: Groups, elements: int) -> Motion:
    """Return the motion of a mass that grips the cable, or raise ValueError; `elements` is checked on the way."""
    if groups.drive.mode != "grip":
        raise ValueError(f"a car that rolls (drive {groups.drive.mode}) cannot be run there: it would grip the cable")
    if groups.motion is None or groups.mu <= 0.0:
        raise ValueError("only scenes with a travelling mass can be run in another code")
    counted(elements)
    return groups.motion


def counted(elements: int) -> int:
    """Return the number of elements, or raise ValueError."""
    if not isinstance(elements, int) or elements < 4:
        raise ValueError(f"elements must be an integer >= 4, got {elements!r}")
    return elements


def trusted(s_o: Array, place: Array, t: Array, groups: Groups, seconds: float, note: str) -> PeerPath:
    """Return the path up to the first instant that is not finite or from which it zigzags from step to step.

    place : (n, 2) position of the mass, x right and y down, origin at the left support; equal steps in t.
    """
    w = place - np.stack(groups.shape(s_o), axis=1)
    broken = np.flatnonzero(~np.isfinite(w).all(axis=1))
    n = int(broken[0]) if broken.size else s_o.size
    if n < s_o.size:
        note = f"not finite from s_o/l = {s_o[n]:.4f} on"
    # a taut string with the mass at rest in its middle sags by mu sigma / 4
    smooth = before_zigzag(w[:n, 1], 0.25 * groups.mu * groups.sigma, failed=bool(note))
    if smooth < n:
        n, note = smooth, f"the mass path zigzags from step to step from s_o/l = {s_o[smooth]:.4f} on"
    return PeerPath(s_o[:n], w[:n, 0], w[:n, 1], t[:n], seconds, note)


def before_zigzag(v: Array, scale: float, *, failed: bool = False) -> int:
    """Return how many instants of a path come before it zigzags from step to step.

    v : (n,) deflections at equal steps; scale : the size of a deflection that matters; failed : the run ended early.

    On a resolved path the second difference over one step is 1/16 of the one over four.  A jump of the acceleration
    keeps the ratio of their rms values, in these units, near 1; a kink makes it 16/sqrt(44) = 2.4.
    A ratio above 3 in a window of 20 steps is a zigzag.  It counts once its amplitude, a quarter of its second
    difference, passes 1e-3 of the scale, or a run fails in it; the path is then cut where it began.
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
