"""Internal damping N = T + EA (eps + tau deps/dt): scene, refusals, both wings, laws, exact answers."""

import functools
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import newton

from cablefem import Scene, SceneError
from cablefem.elements.following import FollowingElements
from cablefem.scene.motion import rest_motion
from galerkin.riding import RidingSystem
from tests.runs import STEEP, tangent_defect
from tests.validation.ladders import ladder
from tests.validation.test_laws import held
from validation import run
from validation.core.agreement import Verdict
from validation.core.methods import METHODS, checking_pair
from validation.core.refine import run_with_error_bars
from validation.core.rows import compare
from validation.oracles import irvine
from validation.oracles.case import BARE

LEVEL = Scene.load("level")
MADE = (
    lambda g, **kind: FollowingElements(g, elements=3, **kind),
    lambda g, **kind: FollowingElements(g, elements=2, degree=4, **kind),
    lambda g, **kind: RidingSystem(g, 4, **kind),
)


def damped(tau, **changes):
    """Level, let in at 0.02 of its length, with tau in units of l sqrt(rho/H)."""
    at = {"travel.from": 0.02 * LEVEL.length, "cable.internal_damping": tau * LEVEL.time_scale}
    return LEVEL.replace(at | changes)


@pytest.mark.parametrize("law", ["elastic", "tension-only"])
@pytest.mark.parametrize("make", MADE)
def test_tangent(make, law):
    system = make(replace(STEEP, internal_damping=3e-3), law=law)
    assert tangent_defect(system, 1.07, np.random.default_rng(2), size=0.02) < 1e-5
    system = make(replace(STEEP, internal_damping=3e-3))
    right = system.linearise
    system.linearise = lambda *x: (right(*x)[0], right(*x[:-3], x[-3], 0.0, x[-1])[1])
    assert tangent_defect(system, 1.07, np.random.default_rng(2), size=0.02) > 1e-3


def test_a_car_that_rolls_is_refused():
    with pytest.raises(SceneError, match=r"must be 0 with drive.mode = 'free'; only a car that grips"):
        Scene.load("zipline").replace({"cable.internal_damping": 1.0})


def test_it_is_written_and_kept():
    scene = damped(3e-4)
    assert Scene.from_toml(scene.to_toml(), name="level") == scene
    assert scene.groups.internal_damping == pytest.approx(3e-4, rel=1e-12)
    assert "internal_damping" not in LEVEL.to_toml()


def test_methods_that_lack_it_refuse():
    scene = damped(3e-4)
    assert checking_pair(scene.groups) == ("following-p2", "fourier-riding")
    assert checking_pair(LEVEL.groups) == ("following-p2", "fourier-kink")
    for name in METHODS.keys() - {"following-p2", "following-p4", "fourier-riding"}:
        with pytest.raises(ValueError, match=r"internal damping: not with .*; take following-p2 or fourier-riding"):
            run(scene, name)
    with pytest.raises(ValueError, match="only the full model has it"):
        run(scene, "following-p2", model="sagged")


@functools.cache
def past_slack(method, tau):
    size = {"elements" if method == "following-p2" else "terms": 20}
    return run(damped(tau), method, steps=1500, until=0.985, **size)


def gap(a, b, begin, end):
    s = np.linspace(begin, end, 300) * LEVEL.length
    x, y = (np.interp(s, a.s_o, getattr(a, k)) - np.interp(s, b.s_o, getattr(b, k)) for k in "xy")
    return np.hypot(x, y).max() / a.path_scale


def test_both_wings_agree_past_slack_and_see_another_tau():
    elements, sines = past_slack("following-p2", 3e-4), past_slack("fourier-riding", 3e-4)
    assert elements.slack_onset == pytest.approx(0.893, abs=1e-3)
    assert gap(elements, sines, 0.04, 0.8) < 1e-4
    assert gap(elements, sines, 0.8, 0.95) < 1.5e-3
    wrong = past_slack("fourier-riding", 1e-3)
    assert gap(elements, wrong, 0.04, 0.8) > 1e-3
    assert gap(elements, wrong, 0.8, 0.95) > 4e-3


@pytest.mark.slow
def test_a_wrong_path_past_slack_is_judged():
    """Without internal damping it is shown alone."""
    scene, how = damped(1e-3), {"steps": 1000, "until": 0.95, "scheme": "generalized-alpha", "rho_inf": 0.8}
    a, b = (
        run_with_error_bars(scene, "following-p2", elements=16, **how),
        run_with_error_bars(scene, "fourier-riding", terms=16, **how),
    )

    def sinks(r):
        return replace(r, v=r.v * (1.0 + 4.0 * np.maximum(0.0, r.s_o / r.length - 0.89)))

    for change, verdict in ((lambda r: r, Verdict.AGREE), (sinks, Verdict.DISAGREE)):
        (row,) = (row for row in compare(scene, a.map(change), b, tol=1e-2) if row.quantity == "path_slack")
        assert (row.decides, row.verdict) == (True, verdict)


def test_both_wings_lose_the_same():
    a, b = past_slack("following-p2", 3e-4), past_slack("fourier-riding", 3e-4)
    s = np.linspace(0.05, 0.8, 4000) * LEVEL.length
    one, other = (np.interp(s, r.s_o, r.powers["lost_internal"]) for r in (a, b))
    assert one.max() <= 0.0
    assert np.abs(one - other).max() < 0.05 * np.abs(one).max()


def test_laws_see_it_from_the_file_alone():
    scene = damped(3e-4)
    runs = ladder(scene, elements=16, steps=2000, until=0.8)
    right = held(runs, (0.04, 0.78))
    assert {law for law, h in right.items() if not h.gap <= 2.0 * h.allowed} == set()
    assert "internal losses" in right
    other = damped(6e-4).to_toml()
    wrong = held(runs.map(lambda r: replace(r, scene_toml=other)), (0.04, 0.78))
    broken = {law for law, h in wrong.items() if h.gap > 3.0 * h.allowed}
    assert {"stretch", "internal losses"} <= broken


# --- exact answers ------------------------------------------------------------------------------------------

MODES = {  # another program
    (1e-3, 0.0): (5.34978478 + 0.00890599j, 9.57343072 + 0.00181886j),
    (1e-2, 0.0): (5.34935096 + 0.08907304j, 9.57294034 + 0.01817702j),
    (1e-3, 0.1): (5.34946788 + 0.05890604j, 9.57329065 + 0.05181881j),
}


def internal_mode(w, L2, tau, c=0.0):
    """w of the symmetric mode next to `w` of a shallow cable, whose stiffness internal damping makes complex.

    tan(k/2) = k/2 - 4/(L^2 (1 + i w tau)) (k/2)^3,  k^2 = w^2 - i w c.
    """

    def off(w):
        half = 0.5 * np.sqrt(w * w - 1j * w * c)
        return complex(np.tan(half) - half + 4.0 / (L2 * (1.0 + 1j * w * tau)) * half**3)

    return complex(newton(off, complex(w), x1=complex(w) + 1e-4j, tol=1e-14))


@pytest.mark.parametrize(("tau", "c"), MODES)
def test_modes_of_the_complex_equation(tau, c):
    L2 = irvine.irvine_parameter(BARE.sigma, BARE.alpha)
    undamped = irvine.frequencies(L2, 4)[[0, 2]]
    found = [internal_mode(w, 24.084, tau, c) for w in undamped]
    np.testing.assert_allclose(found, MODES[tau, c], rtol=0.0, atol=2e-5)
    assert abs(internal_mode(undamped[0], 24.084, 0.9 * tau, c) - MODES[tau, c][0]) > 1e-4


def modes_of(system, count):
    """w of small motions about rest, by central differences of the residual."""
    n, step = system.n_dof, 1e-6
    none, rows = np.zeros((n, n)), step * np.eye(n)

    def columns(place):
        def at(sign):
            x = [none, none, none]
            x[place] = sign * rows
            return np.array([system.residual(0.0, *y, 0) for y in zip(*x, strict=True)])

        return (at(1.0) - at(-1.0)).T / (2.0 * step)

    K, C, M = map(columns, range(3))
    eye = np.eye(n)
    found = -1j * np.linalg.eigvals(np.block([[0.0 * eye, eye], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]]))
    return np.sort_complex(found[found.real > 1.0])[:count]


@pytest.mark.parametrize(
    "make", [lambda g: RidingSystem(g, 12), lambda g: FollowingElements(g, elements=8)], ids=["sines", "elements"]
)
def test_both_wings_come_to_the_damped_modes_of_a_shallow_cable(make):
    """The deviation falls like sigma^2 at the same L^2: 4e-3 at 0.17."""
    L2, off = irvine.irvine_parameter(BARE.sigma, BARE.alpha), []
    exact = internal_mode(irvine.frequencies(L2, 1)[0], L2, 1e-2)
    for part in (1.0, 0.2):
        sigma = part * BARE.sigma
        g = replace(
            BARE, mu=0.0, sigma=sigma, c=0.5 * sigma, alpha=BARE.alpha / part**2, internal_damping=1e-2,
            motion=rest_motion(0.43, 1.0),
        )  # fmt: skip
        off.append(abs(modes_of(make(g), 1)[0] - exact))
    assert off[0] < 1e-2
    assert off[1] < 1e-3
    assert abs(exact.imag) > 8e-2
