"""Adapters to other codes: without them by fakes with known answers, with them against the following elements."""

import math
import sys
import types
from dataclasses import replace
from unittest.mock import MagicMock

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from cablefem.scene import Scene
from validation.core.running import run
from validation.peers import PEERS, PeerPath, import_failure_reason
from validation.peers.path import path_until_nan

# What is importable here decides which tests exist: the other codes are optional.
INSTALLED = [name for name in PEERS if import_failure_reason(name) is None]


# --- availability ----------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", PEERS)
def test_a_missing_package_is_said_to_be_not_installed(name, monkeypatch):
    class Nowhere:
        def find_spec(self, wanted, path=None, target=None):
            if wanted == PEERS[name].module.split(".")[0]:
                raise ModuleNotFoundError(f"No module named {wanted!r}", name=wanted)

    for module in [m for m in sys.modules if m.split(".")[0] == PEERS[name].module.split(".")[0]]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setattr(sys, "meta_path", [Nowhere(), *sys.meta_path])
    assert import_failure_reason(name) == "not installed"


@pytest.mark.parametrize("name", PEERS)
def test_a_package_that_imports_is_available(name, monkeypatch):
    _install(
        monkeypatch,
        {module: types.ModuleType(module) for module in (PEERS[name].module.split(".")[0], PEERS[name].module)},
    )
    assert import_failure_reason(name) is None


def test_a_broken_import_names_its_first_cause_in_one_line(monkeypatch):
    class Broken:
        def find_spec(self, wanted, path=None, target=None):
            if wanted.startswith("openseespy"):
                try:
                    raise ImportError("libblas.so.3: cannot open shared object file\nsecond line")
                except ImportError:
                    raise RuntimeError("Failed to import openseespy on Linux.")  # noqa: B904  (as the package does)

    for module in [m for m in sys.modules if m.startswith("openseespy")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setattr(sys, "meta_path", [Broken(), *sys.meta_path])
    assert import_failure_reason("opensees") == "libblas.so.3: cannot open shared object file"


def test_ladders_refine_and_fit_the_runs():
    for peer in PEERS.values():
        elements = [rung["elements"] for rung in peer.ladder]
        assert elements == sorted(set(elements))
        assert all(set(rung) <= {"elements", "steps"} for rung in peer.ladder)


# --- the cut ---------------------------------------------------------------------------------------------
def test_what_is_not_finite_never_leaves():
    groups = Scene.load("inclined").groups
    s_o = np.linspace(0.0, 0.9, 91)
    place = np.stack(groups.coordinates(s_o), axis=1) + 0.013 * np.sin(3.1 * s_o)[:, None]
    whole = path_until_nan(s_o, place, s_o * 2.3, groups, 0.7, "as it was")
    assert whole.reached == 0.9
    assert whole.note == "as it was after s_o/l = 0.9000"
    np.testing.assert_allclose(whole.v, 0.013 * np.sin(3.1 * s_o), rtol=0, atol=1e-15)  # rounding of places below 1

    broken = place.copy()
    broken[47, 0] = np.nan
    path = path_until_nan(s_o, broken, s_o * 2.3, groups, 0.7, "")
    assert (path.t.size, path.note) == (47, "not finite from s_o/l = 0.4700 on")


# --- OpenSees, with a fake that has the mass but no cable ------------------------------------------------
class FreeNodes:
    """The calls the adapter makes, answered by Newmark's formulas for nodes that nothing holds: M a = F."""

    def __init__(self, gamma: float, beta: float, fail_at: int) -> None:
        self.gamma, self.beta, self.fail_at = gamma, beta, fail_at
        self.state: dict[int, np.ndarray] = {}  # tag: (u, v, a), each (2,)
        self.masses: dict[int, float] = {}
        self.loads: dict[int, dict[int, np.ndarray]] = {}
        self.pattern_now = -1
        self.steps = self.wiped = 0

    def __getattr__(self, name):
        return lambda *args: None

    def wipe(self):
        self.wiped += 1

    def node(self, tag, x, y):
        self.state[tag] = np.zeros((3, 2))

    def mass(self, tag, mx, my):
        assert mx == my
        self.masses[tag] = mx

    def pattern(self, kind, tag, series):
        self.pattern_now, self.loads[tag] = tag, {}

    def load(self, tag, fx, fy):
        self.loads[self.pattern_now][tag] = np.array([fx, fy])

    def remove(self, what, tag):
        del self.loads[tag]

    def nodeDisp(self, tag):
        return list(self.state[tag][0])

    def nodeVel(self, tag):
        return list(self.state[tag][1])

    def nodeAccel(self, tag):
        return list(self.state[tag][2])

    def analyze(self, count, dt):
        if self.steps == self.fail_at:
            return -3
        self.steps += 1
        (node,) = [tag for tag, mass in self.masses.items() if mass > 0.0]  # the mass is on one node at a time
        u, v, a = self.state[node]
        new = self.loads[1][node] / self.masses[node]
        u = u + dt * v + dt * dt * ((0.5 - self.beta) * a + self.beta * new)
        self.state[node] = np.array([u, v + dt * ((1.0 - self.gamma) * a + self.gamma * new), new])
        return 0


@pytest.mark.parametrize(("beta", "falls"), [(0.3025, True), (0.25, False)])
def test_handed_from_node_to_node_without_a_cable_the_mass_falls_freely(beta, falls, monkeypatch):
    """Newmark's formulas are exact for a free fall; a fake with another beta is not the scheme the load is made for."""
    fake = FreeNodes(0.6, beta, fail_at=38)
    _install_opensees(monkeypatch, fake)
    motion = Scene.load("level").groups.motion
    assert motion is not None
    groups = replace(Scene.load("inclined").groups, motion=motion, mu=0.37)
    path = PEERS["opensees"].run(groups, elements=53)
    assert path.t.size == 39
    assert path.note == f"OpenSees' Newton method failed after s_o/l = {path.reached:.4f}"
    assert fake.wiped == 2
    _, xp, yp = groups.tension_and_slope(0.0)
    speed = motion.position_with_rates(0.0, 0)[1]
    x, y = groups.coordinates(path.s_o)
    gap = np.hypot(
        path.u + x - speed * xp * path.t, path.v + y - speed * yp * path.t - 0.5 * groups.sigma * path.t**2
    ).max()
    assert (gap < 1e-12) == falls  # rounding of 39 steps on lengths below 1; the wrong beta gives 1e-5 and more


# --- Exudyn, with a fake that says "ok" ------------------------------------------------------------------
def test_a_failure_of_exudyn_is_told_with_its_place(monkeypatch):
    groups = Scene.load("level").groups
    motion = groups.motion
    assert motion is not None
    t = np.linspace(0.0, motion.phases[-1][1] * 0.99, 100)
    x, y = groups.coordinates(motion.position(t))
    y = y + 0.011 * np.sin(1.7 * t)
    fake = MagicMock()
    fake.SolverError = ZeroDivisionError
    system = fake.SystemContainer.return_value.AddSystem.return_value
    system.SolveDynamic.return_value = True
    system.GetSensorStoredData.return_value = np.column_stack([t, x, -y, 0.0 * t])
    _install(monkeypatch, {"exudyn": fake, "exudyn.itemInterface": fake.itemInterface})
    path = PEERS["exudyn"].run(groups, elements=5, steps=100)
    assert (path.t.size, path.note) == (100, "")
    np.testing.assert_allclose(path.v, 0.011 * np.sin(1.7 * t), rtol=0, atol=1e-15)

    system.SolveDynamic.side_effect = ZeroDivisionError
    system.GetSensorStoredData.return_value = np.column_stack([t, x, -y, 0.0 * t])[:31]
    path = PEERS["exudyn"].run(groups, elements=5, steps=100)
    assert path.t.size == 31
    assert path.note == f"Exudyn's Newton method failed after s_o/l = {path.reached:.4f}"


# --- the real codes --------------------------------------------------------------------------------------
def reference_path(name: str) -> CubicSpline:
    """(u, v) of the mass over s_o up to 0.82: ten elements of degree 2 a side, 4.5e-4 from the converged path."""
    r = run(Scene.load(name), "following-p2", elements=10, steps=500, until=0.82)
    return CubicSpline(r.s_o / r.length, np.stack([r.u, r.v], 1) / r.length)


def relative_path_error(path: PeerPath, exact: CubicSpline) -> float:
    """Largest gap of v for 0.02 <= s_o/l <= 0.8 over the largest deflection there; inf if the path ends before."""
    if path.reached < 0.8:
        return math.inf
    inside = (path.s_o >= 0.02) & (path.s_o <= 0.8)
    v = exact(path.s_o[inside])[:, 1]
    return float(np.abs(path.v[inside] - v).max() / np.abs(v).max())


if INSTALLED:
    # Small settings, and 1.5 times the error they were seen to have on each scene (the reference's own is 5e-4).
    CASES = {
        "opensees": ({"elements": 100}, {"level": 0.0142, "cruise": 0.0132, "inclined": 0.0043}),
        "exudyn": ({"elements": 20, "steps": 400}, {"level": 0.042, "cruise": 0.084, "inclined": 0.026}),
    }

    @pytest.mark.parametrize("scene", ["level", "cruise", "inclined"])
    @pytest.mark.parametrize("name", INSTALLED)
    def test_another_code_finds_the_same_path(name, scene):
        groups = Scene.load(scene).groups
        settings, bounds = CASES[name]
        assert groups.motion is not None
        path = PEERS[name].run(groups, **settings)
        exact = reference_path(scene)
        assert path.s_o[0] == path.t[0] == 0.0
        assert path.seconds > 0.0
        np.testing.assert_allclose(path.s_o, groups.motion.position(path.t), rtol=0, atol=1e-12)
        assert relative_path_error(path, exact) < bounds[scene]
        # twins: another mass, and the path a hundredth of the cable late
        other = PEERS[name].run(replace(groups, mu=0.8), **settings)
        assert relative_path_error(other, exact) > bounds[scene]
        late = replace(path, s_o=path.s_o + 0.01)
        assert relative_path_error(late, exact) > bounds[scene]


if "exudyn" in INSTALLED:

    @pytest.mark.parametrize("friction", [1.0, 0.5])
    def test_exudyns_sliding_joint_lets_a_rider_go_as_ours(friction):
        """The first 150 m of the built-in zip line, over time; with half the friction (must fail) he is ahead."""
        scene = Scene.load("zipline")
        text = scene.to_toml().replace('mode = "free"', 'mode = "free"\nend = {place = 150.0}')
        scene = Scene.from_toml(text.replace("friction = 0.02", f"friction = {0.02 * friction!r}"))
        ours = run(Scene.from_toml(text), "following-p2", elements=8, steps=200)  # 1e-4 of the length
        path = PEERS["exudyn"].run(scene.groups, elements=20, steps=300)
        assert path.note == ""
        assert path.reached >= 150.0 / scene.length
        t = path.t[path.t * scene.time_scale <= ours.t[-1]] * scene.time_scale
        place = np.stack(scene.groups.coordinates(path.s_o), 1) + np.stack([path.u, path.v], 1)
        gap = scene.length * place[: t.size] - CubicSpline(ours.t, np.stack([ours.x, ours.y], 1))(t)
        # 3.6e-3 with these settings, 1e-3 with twice as many elements and 13 times the steps
        assert (np.hypot(*gap.T).max() < 5e-3 * scene.length) == (friction == 1.0)


def _install(monkeypatch, modules):
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)


def _install_opensees(monkeypatch, ops):
    _install(monkeypatch, {"openseespy": types.SimpleNamespace(opensees=ops), "openseespy.opensees": ops})
