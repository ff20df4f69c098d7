"""Bisection; scipy's root finders are slow to import."""

from collections.abc import Callable


def bisected(f: Callable[[float], float], low: float, high: float) -> float:
    """The zero of f between low and high, to the last bit; ValueError without a change of sign."""
    ends = f(low), f(high)
    if not min(ends) <= 0.0 <= max(ends):
        raise ValueError(f"f({low!r}) = {ends[0]!r} and f({high!r}) = {ends[1]!r} have one sign")
    rising = ends[1] > ends[0]
    while low < (middle := 0.5 * (low + high)) < high:
        if (f(middle) < 0.0) is rising:
            low = middle
        else:
            high = middle
    return high
