"""Bisection; scipy's root finders are slow to import."""

from collections.abc import Callable


def bisect_zero(f: Callable[[float], float], low: float, high: float, tolerance: float = 0.0) -> float:
    """The zero of f between low and high, within a tolerance or to the last bit; ValueError if the sign stays."""
    at_low = f(low)
    at_high = f(high)
    if not min(at_low, at_high) <= 0.0 <= max(at_low, at_high):
        raise ValueError(f"f({low!r}) = {at_low!r} and f({high!r}) = {at_high!r} have one sign")
    rising = at_high > at_low
    middle = 0.5 * (low + high)
    while low < middle < high and high - low > tolerance:
        if (f(middle) < 0.0) is rising:
            low = middle
        else:
            high = middle
        middle = 0.5 * (low + high)
    return high
