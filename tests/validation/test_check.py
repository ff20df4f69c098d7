"""The check agrees for right solvers and disagrees when a fault is planted in one of them, by substitution."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from cablefem import Scene
from cablefem.elements.following import FollowingElements
from cablefem.newmark import NO_STEPS, iterate
from galerkin.bases.fourier import Fourier
from galerkin.equations import GalerkinSystem
from validation.commands.check import study
from validation.commands.check.study import check
from validation.core.agreement import Verdict, agree, overall
from validation.core.estimate import Estimated, companions, estimated
from validation.core.methods import METHODS

LEVEL = Scene.load("level")
ELEMENTS = {"elements": 12, "steps": 700}
SINES = {"terms": 30, "steps": 700}


class Altered:
    """The scene's groups with something changed, for one wing only."""

    def __init__(self, groups, **changes):
        self._groups, self._changes = groups, changes

    def __getattr__(self, name):
        return self._changes[name] if name in self._changes else getattr(self._groups, name)


class Interpreted:
    """Steps by residuals and tangents of the system itself: compiled ones would not know the fault."""

    def settle(self, *step):
        return iterate(self, *step)

    def stride(self, *steps):
        return NO_STEPS


class NoCoriolis(Interpreted, GalerkinSystem):
    """(22) left out."""

    def _instant(self, *kinematics):
        x = super()._instant(*kinematics)
        return dataclasses.replace(x, carried=x.carried._replace(f_v=0.0 * x.carried.f_v))


class HalfCentrifugal(Interpreted, GalerkinSystem):
    """Half of ds_o^2 (phi'' and X'') in (23) and (27)."""

    def _instant(self, s_o, ds_o, dds_o):
        x = super()._instant(s_o, ds_o, dds_o)
        f_q = 0.5 * (x.carried.f_q + dds_o * x.carried.f_s)
        return dataclasses.replace(x, carried=x.carried._replace(f_q=f_q))

    def _load(self, s_o, ds_o, dds_o):
        _, curvature = self.cable.static_slope(np.float64(s_o))
        return super()._load(s_o, ds_o, dds_o) - 0.5 * ds_o**2 * curvature


class SignOfCurvature(Interpreted, GalerkinSystem):
    """+y'' where -y'' belongs in the load (27)."""

    def _load(self, s_o, ds_o, dds_o):
        _, curvature = self.cable.static_slope(np.float64(s_o))
        return super()._load(s_o, ds_o, dds_o) - np.array([0.0, 2.0 * ds_o**2 * curvature[1]])


class StillMesh(Interpreted, FollowingElements):
    """The mesh moves, but its velocity is left out of the equations."""

    def _time(self, t, phase):
        super()._time(t, phase)
        self._coefficients[2:] = 0.0  # G, its transpose, H


def sines(kind, groups=lambda g: g):
    return dataclasses.replace(
        METHODS["fourier-kink"],
        builder=lambda g, x, **how: kind(groups(g), Fourier(x["terms"]), kink=True, **how),
    )


def elements(kind, groups=lambda g: g):
    return dataclasses.replace(
        METHODS["following-p2"],
        builder=lambda g, x, **how: kind(groups(g), elements=x["elements"], **how),
    )


FAULTS = {
    "Coriolis term dropped": sines(NoCoriolis),
    "centrifugal term halved": sines(HalfCentrifugal),
    "sign of y''": sines(SignOfCurvature),
    "mass off by 5 percent, sines": sines(GalerkinSystem, lambda g: Altered(g, mu=1.05 * g.mu)),
    "EA off by 5 percent, sines": sines(GalerkinSystem, lambda g: Altered(g, alpha=1.05 * g.alpha)),
    "mesh velocity dropped": elements(StillMesh),
    "mass off by 5 percent, elements": elements(FollowingElements, lambda g: Altered(g, mu=0.95 * g.mu)),
    "EA off by 5 percent, elements": elements(FollowingElements, lambda g: Altered(g, alpha=0.95 * g.alpha)),
}


@pytest.fixture(scope="module")
def right() -> tuple[Estimated, Estimated]:
    """What the check's ladders end with."""
    return tuple(companions(LEVEL, METHODS[m], **x) for m, x in (("following-p2", ELEMENTS), ("fourier-kink", SINES)))


@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_turns_the_verdict(right, fault):
    method = FAULTS[fault]
    if method.wing == "galerkin":
        rows = agree(LEVEL, right[0], companions(LEVEL, method, **SINES))
    else:
        rows = agree(LEVEL, companions(LEVEL, method, **ELEMENTS), right[1])
    assert overall(rows) is Verdict.DISAGREE, [(r.quantity, r.gap, r.allowed) for r in rows]
    path = next(r for r in rows if r.quantity == "path_max")
    assert path.verdict is Verdict.DISAGREE, (path.gap, path.allowed)


def test_plain_sines_are_not_hidden_and_their_extrapolation_meets_the_elements(right):
    """N = 30 is about 3 percent away by the kink at the mass; 2 f(60) - f(30) meets the elements within 2e-3."""
    from validation.core import measures

    raw = estimated(LEVEL, "fourier", terms=30, steps=500)
    window = measures.window_of(raw.run, right[0].run)
    far = measures.path_gap(raw.run, right[0].run, window)[0]
    assert 0.02 < far < 0.045
    fine = estimated(LEVEL, "fourier", terms=60, steps=700)
    rows = agree(LEVEL, right[0], fine)
    path = next(r for r in rows if r.quantity == "path_max")
    assert path.gap < 2e-3
    assert path.verdict is Verdict.AGREE
    assert "extrapolated 2 f(60) - f(30)" in path.allowed_because


def test_bars_beyond_the_tolerance_are_too_coarse(right):
    coarse = estimated(LEVEL, "fourier-kink", terms=10, steps=200)
    path = agree(LEVEL, right[0], coarse, tol=1e-3)[0]
    assert path.verdict is Verdict.TOO_COARSE
    assert "too coarse" in path.allowed_because
    assert agree(LEVEL, right[0], coarse, tol=0.2)[0].verdict is Verdict.AGREE


def test_check_meets_its_tolerance_and_writes_the_contract(tmp_path):
    import json

    result = check("inclined", tol=5e-3)
    assert result.verdict is Verdict.AGREE, [(r.quantity, r.gap, r.allowed) for r in result.rows]
    result.write(tmp_path)
    content = json.loads((tmp_path / "agreement.json").read_text())
    assert content["verdict"] == "agree"
    assert content["range"] == [0.02, 0.8]
    for row in content["rows"]:
        assert set(row) >= {"quantity", "gap", "allowed", "allowed_because", "verdict"}
    for method in content["methods"]:
        assert {f.name for f in (tmp_path / method).iterdir()} >= {"path.csv", "tension.csv", "summary.json"}
        assert json.loads((tmp_path / method / "summary.json").read_text())["path_error"] <= 2.5e-3
    run = result.a.run
    place = np.linspace(0.6, 0.95, 3501)  # between the steps: the bottom is flat
    lowest = place[np.argmax(CubicSpline(run.s_o / run.length, run.y)(place))]
    assert abs(lowest - 0.80) < 0.01  # the paper's figure 8


@pytest.mark.parametrize("tol", [0.0, -1e-3, 0.5, float("nan")])
def test_a_tolerance_out_of_range_is_named(tol):
    with pytest.raises(ValueError, match="tol must lie in"):
        check("level", tol=tol)


def test_what_confirms_is_finer_in_space_and_time(right):
    e = right[0]
    finer = study._resolved(LEVEL, METHODS["following-p2"], 0.1, 1e9, 0.3, e, (1.5, 1.5), lambda *told: None)
    assert finer.run.settings["elements"] == 1.5 * e.run.settings["elements"]
    assert finer.run.settings["steps"] == 1.5 * e.run.settings["steps"]
    assert finer.in_time.settings["steps"] == 0.5 * finer.run.settings["steps"]
