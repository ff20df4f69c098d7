"""Moving forces: every oracle satisfies the wave equation with its source, its supports and its state of rest."""

import numpy as np
import pytest

from validation.oracles import accelerating_force, moving_force

from .wave_identity import random_parallelograms, wave_defect

# All forces here give v of order 1 and everything is a closed form: 1e-12 is rounding with a margin for 1/|1 - V^2|.
ROUNDING = 1e-12


def parallelograms_on_string(V):
    return random_parallelograms(np.random.default_rng(3), 60, x=(0.0, 1.0), t=(0.0, 1.6 / V), size=0.7, clip=True)


def parallelograms_on_line(seed, span=3.0):
    return random_parallelograms(np.random.default_rng(seed), 60, x=(-span, span), t=(0.0, span), size=1.3, clip=False)


@pytest.mark.parametrize("V", [0.27, 0.83, 1.7])
def test_fryba_solves_the_wave_equation_between_fixed_ends_from_rest(V):
    P = 2.3

    def v(x, t):
        return moving_force.displacement(x, t, P=P, V=V)

    defect = wave_defect(v, lambda s: P * s, lambda s: V * s, parallelograms_on_string(V), 1.0 / V)
    assert np.abs(defect).max() < ROUNDING
    t = np.linspace(0.0, 2.7 / V, 200)
    assert np.abs(v(0.0, t)).max() < ROUNDING
    assert np.abs(v(1.0, t)).max() < ROUNDING
    x, t = np.meshgrid(np.linspace(0.0, 1.0, 41), np.linspace(0.0, 0.5, 31))
    ahead = x > max(V, 1.0) * t + 1e-12
    assert np.abs(v(x, t)[ahead]).max() < ROUNDING  # at rest until the first wave or the force itself arrives


@pytest.mark.parametrize("spoil", ["reflection", "speed", "strength"])
def test_a_spoiled_moving_force_is_noticed(spoil):
    P, V = 2.3, 0.27

    def v(x, t):
        if spoil == "reflection":  # the free wave with the wrong sign: the string is not at rest any more
            still = moving_force.continued_green_function(x, V * t)
            wave = moving_force.continued_green_function(x, t)
            return P / (1.0 - V * V) * (still + V * wave)
        return moving_force.displacement(x, t, P=P * (1.01 if spoil == "strength" else 1.0), V=V)

    xi = (lambda s: 0.3 * s) if spoil == "speed" else (lambda s: V * s)
    quads = random_parallelograms(np.random.default_rng(3), 60, x=(0.0, 1.0), t=(0.0, 1.0), size=0.7, clip=True)
    defect = np.abs(wave_defect(v, lambda s: P * s, xi, quads, 1.0 / V)).max()
    rest = np.abs(v(np.linspace(0.5, 1.0, 20), 0.3)).max()
    assert max(defect, rest) > 1e-3


@pytest.mark.parametrize(("V0", "a"), [(0.0, 0.9), (0.3, 0.55), (1.8, -0.7), (0.6, -0.4), (0.45, 0.0)])
def test_flaherty_solves_the_wave_equation_through_the_wave_speed(V0, a):
    P = 1.4

    def v(x, t):
        return accelerating_force.displacement(x, t, P=P, V0=V0, a=a)

    def xi(s):
        return s * (V0 + 0.5 * a * s)

    turns = () if a == 0.0 else ((1.0 - V0) / a, (-1.0 - V0) / a)
    assert (
        np.abs(wave_defect(v, lambda s: P * s, xi, parallelograms_on_line(11), 6.0, turns)).max() < 1e-11
    )  # square roots at fronts
    assert np.abs(wave_defect(v, lambda s: -P * s, xi, parallelograms_on_line(11), 6.0, turns)).max() > 0.1
    x = np.linspace(-6.0, 6.0, 200)
    for t in (0.7, 2.1):
        s = np.linspace(0.0, t, 999)  # out of reach of every wave, whenever it was sent
        far = (x > (xi(s) + t - s).max() + 1e-5) | (x < (xi(s) - t + s).min() - 1e-5)
        assert np.abs(v(x, t)[far]).max() == 0.0


def test_parameters_outside_the_validity_are_refused():
    for call in (
        lambda: moving_force.displacement(0.3, 0.2, P=1.0, V=-0.4),
        lambda: moving_force.displacement(0.3, 0.2, P=1.0, V=1.0),
        lambda: moving_force.displacement(1.3, 0.2, P=1.0, V=0.4),
        lambda: accelerating_force.displacement(0.3, -0.2, P=1.0, a=0.4),
    ):
        with pytest.raises(ValueError, match=r"speed|string|series|t >= 0|rest"):
            call()
