"""Tension and reactions from equilibrium: exact states, the balance of the whole cable, the pointwise tension."""

from dataclasses import replace

import numpy as np
import pytest

from cablefem.elements.fixed import FixedElements
from cablefem.elements.following import FollowingElements
from cablefem.newmark import State, States, stack_states
from tests.runs import INCLINED, MODELS, STEEP, march_with_positions, observe

STATIONS = np.linspace(0.0, 1.0, 2001)


def states_at_rest(system, t):
    zero = np.zeros((1, system.n_dof))
    return States(np.array([t]), zero, zero, zero, np.array([0]))


@pytest.mark.parametrize("kind", [FollowingElements, FixedElements])
def test_the_hanging_cable_pulls_at_its_supports(kind):
    system = kind(replace(STEEP, mu=1e-300), elements=3)
    o = observe(system, states_at_rest(system, 1.07), STATIONS, [0])
    np.testing.assert_allclose(o.reaction_left, [[-1.0, -0.52]], rtol=1e-14)  # H = 1, and p = c - sigma s upwards
    np.testing.assert_allclose(o.reaction_right, [[1.0, 0.52 - 0.31]], rtol=1e-14)
    np.testing.assert_allclose(o.T, [STEEP.static_tension(STATIONS)], rtol=1e-14)


def momentum_defect(system, states, sigma):
    """Return the rate of momentum of the whole cable less all forces on it at the last state, over the largest one."""
    dt, (t, q, v, a) = 1e-4, (x[-1] for x in (states.t, states.q, states.v, states.a))
    near = stack_states([State(t + x, q + x * v + 0.5 * x * x * a, v + x * a, a) for x in (-dt, 0.0, dt)])
    momentum = []
    for k in range(3):
        s_o = system.motion.position_with_rates(near.t[k], 0)[0]
        s = np.concatenate([np.linspace(0.0, s_o, 4001), np.linspace(s_o + 1e-12, 1.0, 4001)])
        o = observe(system, near, s, [k])
        momentum.append(np.trapezoid(np.stack([o.du[0], o.dv[0]]), s, axis=1))
    weight = sigma if np.ndim(sigma) else [0.0, sigma]
    forces = np.array([o.reaction_left[1], o.reaction_right[1], o.contact[1], weight])
    defect = (momentum[2] - momentum[0]) / (2.0 * dt) - forces.sum(axis=0)
    if system.fields == 1:  # motion is normal to the chord, and so is the balance
        defect = system.direction @ defect
    return np.abs(defect).max() / np.abs(forces).max()


@pytest.mark.parametrize("model", MODELS)
def test_reactions_balance_the_whole_cable(model):
    system = FollowingElements(STEEP, elements=5, degree=3, model=model)
    states, _ = march_with_positions(system, 300, until=0.6)
    assert momentum_defect(system, states, STEEP.sigma) < 3e-4  # differences over 1e-4; steps are solved to 1e-4
    assert momentum_defect(system, states, 1.01 * STEEP.sigma) > 1e-3


@pytest.mark.parametrize("model", ["full", "stretching"])
@pytest.mark.parametrize(("element", "coupling"), [("hermite", "chain"), ("p1", "path")])
def test_so_they_do_where_the_mass_moves_through_the_elements(element, coupling, model):
    system = FixedElements(STEEP, elements=9, element=element, coupling=coupling, model=model)
    states, _ = march_with_positions(system, 200, "newmark", until=0.52)  # inside an element
    assert momentum_defect(system, states, STEEP.sigma) < 3e-3  # w' jumps between P2 elements
    assert momentum_defect(system, states, 1.1 * STEEP.sigma) > 6e-3


def test_recovered_tension_is_better_than_pointwise():
    def tensions(elements, degree, steps):
        system = FollowingElements(INCLINED, elements=elements, degree=degree)  # enters from rest: no fronts
        states, s_o = march_with_positions(system, steps, "generalized-alpha", rho_inf=0.9, until=0.7)
        o = observe(system, states)
        t = 0.61 * system.phases[0][1]
        k = np.searchsorted(states.t, t) - np.array([1, 0])
        along, part = observe(system, states, np.linspace(0.0, 1.0, 51), k), np.interp(t, states.t[k], [0.0, 1.0])
        places = np.linspace(0.1, 0.65, 400)
        return {
            name: np.interp(places, s_o, getattr(o, name)) if "h" in name else [1.0 - part, part] @ getattr(along, name)
            for name in ("T_behind", "T_ahead", "T", "T_behind_pointwise", "T_ahead_pointwise", "T_pointwise")
        }

    fine, coarse = tensions(12, 5, 2000), tensions(8, 2, 500)
    error = {name: float(np.sqrt(np.mean((coarse[name] - fine[name]) ** 2))) for name in fine}
    for name in ("T_behind", "T_ahead", "T"):
        assert error[name] < 5e-5
        assert error[name] < 0.4 * error[f"{name}_pointwise"]
