"""Where a monotone function changes its sign; scipy's root finders would take half of the time to load a scene."""

from collections.abc import Callable


def bisected(f: Callable[[float], float], low: float, high: float) -> float:
    """The place between low and high where f changes its sign, to the last bit; ValueError if it has one sign there."""
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
