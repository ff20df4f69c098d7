"""The root finder of scenes: to the last bit, and no root where there is none."""

import math

import pytest

from cablefem.scene.bisection import bisect_zero


@pytest.mark.parametrize(("low", "high", "sign"), [(0.3, 2.9, 1.0), (2.9e-9, 2.9, -1.0)])
def test_a_root_to_the_last_bit(low, high, sign):
    place = 1.7320508075688772
    found = bisect_zero(lambda x: sign * (x - place), low, high)
    assert abs(found - place) <= math.ulp(place)


def test_one_sign_is_no_root():
    with pytest.raises(ValueError, match="one sign"):
        bisect_zero(lambda x: x * x + 0.1, -0.7, 1.3)
