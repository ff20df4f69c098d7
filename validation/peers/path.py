"""The path of the mass in another code, cut where it fails."""

from dataclasses import dataclass

import numpy as np

from cablefem.newmark import Array
from cablefem.scene import Groups


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
        """s_o/l of the last step."""
        return float(self.s_o[-1])


def path_until_nan(s_o: Array, points: Array, t: Array, groups: Groups, seconds: float, note: str) -> PeerPath:
    """The path up to the first value that is not finite.

    points : (n, 2), y down;  note : why the code gave up, or "".
    """
    w = points - np.stack(groups.coordinates(s_o), axis=1)
    broken = np.flatnonzero(~np.isfinite(w).all(axis=1))
    n = int(broken[0]) if broken.size else s_o.size
    if n < s_o.size:
        note = f"not finite from s_o/l = {s_o[n]:.4f} on"
    elif note:
        note = f"{note} after s_o/l = {s_o[-1]:.4f}"
    return PeerPath(s_o[:n], w[:n, 0], w[:n, 1], t[:n], seconds, note)
