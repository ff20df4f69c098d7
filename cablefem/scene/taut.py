"""A rough line for Newton's method to begin with: a taut string of constant horizontal tension H."""

from __future__ import annotations

import math

import numpy as np

from cablefem.scene.bisection import bisected
from cablefem.scene.line import Case, NoLine


def guess(case: Case) -> tuple[float, np.ndarray, np.ndarray]:
    """Return H [N], places (n, 2) [m] and s (n,) [m] of the stations; NoLine where not even a string can hang."""
    x, y = (np.array([getattr(p, axis) for p in case.stations]) for axis in "xy")
    held = np.array([not p.is_car for p in case.stations])
    load = np.array([p.force if p.is_car else 0.0 for p in case.stations])
    chord, run = np.interp(x, x[held], y[held]), np.diff(x)
    slope = np.diff(chord) / run
    w = case.weight * np.hypot(1.0, slope)
    # H times the depth below the chord, m: the pulls on a car balance its weight and that of half the rope beside it
    A, b = np.eye(x.size), np.zeros(x.size)
    for i in np.flatnonzero(~held):
        A[i, i - 1 : i + 2] = [-1.0 / run[i - 1], 1.0 / run[i - 1] + 1.0 / run[i], -1.0 / run[i]]
        b[i] = load[i] + 0.5 * (w[i - 1] * run[i - 1] + w[i] * run[i])
    m = np.linalg.solve(A, b)
    shear = np.diff(m) / run

    def pieces(H: float) -> np.ndarray:
        arc = np.hypot(run, np.diff(chord + m / H)) + (w / H) ** 2 * run**3 / 24.0
        return arc / (1.0 + H * arc / run / case.EA) / case.heat

    weighed = [k for k in (0, len(case.stations) - 1) if case.stations[k].kind == "counterweight"]
    if weighed or case.length is None:
        k, T = case.tie or (weighed[0], case.stations[weighed[0]].force)
        j = min(k, len(case.stations) - 2)  # the piece that ends there
        v, c = float(shear[j] + (0.5 if k == j else -0.5) * w[j] * run[j]), float(slope[j])
        root = T**2 * (1.0 + c**2) - v**2  # of T^2 = H^2 + (c H + v)^2
        H = (math.sqrt(max(root, 0.0)) - c * v) / (1.0 + c**2)
        if root <= 0.0 or H <= 0.0:
            least = f"about {abs(v) / math.hypot(1.0, c):.3g} N would"
            raise NoLine(f"a tension of {T:.6g} N at {case.stations[k].name} does not carry it ({least})")
    else:
        length = case.length
        try:
            low, high = math.log(1e-6 * case.weight * length), math.log(case.EA)
            H = math.exp(bisected(lambda z: pieces(math.exp(z)).sum() - length, low, high))
        except ValueError:
            reach = float(np.hypot(run, np.diff(chord)).sum())
            raise NoLine(f"the rope is too short to reach: {length:.6g} m over {reach:.6g} m of chords") from None
    s = np.concatenate([[0.0], np.cumsum(pieces(H))])
    fixed = case.fixed_s
    if math.isnan(fixed[0]):
        s += fixed[-1] - s[-1]
    return H, np.stack([x, chord + m / H], axis=1), s
