"""The ways methods fail (catalogue.toml), each with a case that shows the failure and one with the remedy.

Below are the measures that the cases name.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any, Literal

import jinja2
import numpy as np

from cablefem import newmark
from cablefem.response import Response
from cablefem.scene import Scene
from galerkin.bases.daubechies import Daubechies
from galerkin.bases.fourier import Fourier
from galerkin.equations import GalerkinSystem
from galerkin.modes import bare_frequencies
from validation.commands.atlas import specimens
from validation.core import measures, store
from validation.core.running import run
from validation.core.trust import convergence_limit, post_slack_spread
from validation.core.watch import MOST_GAIN

Row = dict[str, Any]

CATALOGUE: tuple[Row, ...] = tuple(store.shipped(__package__, "catalogue.toml")["row"])
_CONDITIONS = jinja2.Environment(undefined=jinja2.StrictUndefined)


def run_row(row: Row) -> dict[str, Any]:
    """Run one row and return it as data: what it says, what was measured, and whether both showed."""
    words = {k: row[k] for k in ("name", "scene", "method", "symptom", "cause", "remedy")}
    failed, cured = _measured(row["shows"]), _measured(row["cures"])
    return words | {
        "failure": failed, "cure": cured, "failure_shown": holds(row["shown"], failed),
        "remedy_works": holds(row["cured"], cured),
    }  # fmt: skip


def holds(condition: str, x: dict[str, float]) -> bool:
    """Return whether a condition on measured numbers is true."""
    return bool(_CONDITIONS.compile_expression(condition, undefined_to_none=False)(x=x, most_gain=MOST_GAIN))


def _measured(cases: dict[str, dict[str, Any]]) -> dict[str, float]:
    out: dict[str, float] = {}
    for name, case in cases.items():
        found = MEASURES[case["measure"]](**{k: v for k, v in case.items() if k != "measure"})
        out |= {k: float(v) for k, v in (found if isinstance(found, dict) else {name: found}).items()}
    return out


# --- measures -------------------------------------------------------------------------------------------------------

MEASURES: dict[str, Callable[..., float | dict[str, float]]] = {}


def _measure(of: Callable[..., Any]) -> Callable[..., Any]:
    """Register a measure under its name, without the underscore."""
    MEASURES[of.__name__[1:]] = of
    return of


@cache
def _scene(**groups: float) -> Scene:
    return Scene.load("level").variant(**groups) if groups else Scene.load("level")


@cache
def _reference(model: str, **groups: float) -> Response:
    """Path right to 2e-4 (level) in a second."""
    return run(_scene(**groups), "following-p2", model=model, elements=20, steps=1500)


def _run(method: str, **how: Any) -> Response:
    return run(_scene(), specimens.PLANTED.get(method, method), **how)


@_measure
def _path(method: str, *, model: str = "full", scene: dict[str, float] | None = None, **how: Any) -> float:
    """Largest path error in s_o/l 0.02 to 0.80, over the largest deflection; infinite for a run that broke before."""
    groups = scene or {}
    r = run(_scene(**groups), specimens.PLANTED.get(method, method), model=model, law="elastic", **how)
    if r.reached < measures.WINDOW[1]:
        return float("inf")
    return measures.path_gap(r, _reference(model, **groups), measures.WINDOW)[0]


@_measure
def _energy(method: str, **how: Any) -> float:
    """Energy gained without being given, over weight times deflection."""
    return _gain(_run(method, **how))


def _gain(r: Response) -> float:
    return float("inf") if r.energy_gain is None else r.energy_gain


@_measure
def _ripple(method: str, **how: Any) -> float:
    return measures.oscillation(_run(method, law="elastic", **how), measures.WINDOW)


@_measure
def _vibration(scheme: str) -> dict[str, float]:
    """Energy of a free cable let go from a hundredth of its length, over the one given."""
    energy = specimens.free_vibration(
        _scene().groups, newmark.scheme(scheme), dt=0.03, steps=200, elements=12, amplitude=0.01, mode=2
    )
    off = np.abs(energy - 1.0).max()
    return {"energy at most": energy.max(), "energy off by": off, "steps": energy.size - 1}


@_measure
def _left(scheme: str, **how: Any) -> float:
    """Part of the energy that is left of a vibration small enough to be linear; second mode: no axial stretching."""
    energy = specimens.free_vibration(
        _scene().groups, newmark.scheme(scheme, **how), dt=0.05, steps=600, elements=16, amplitude=1e-4, mode=2
    )
    return energy[-1] / energy[100]  # the first 100 steps are left to the axial waves that the start sets off


@_measure
def _frequency(level: int, reading: Literal["literal", "scaling"]) -> float:
    """Error of the first frequency; exact: the linearised catenary, by collocation to 11 digits."""
    basis = Daubechies(order=4, level=level, reading=reading)
    return abs(float(bare_frequencies(_scene().groups, basis, n=1)[0]) / 5.3454766022 - 1.0)


@_measure
@cache
def _end() -> dict[str, float]:
    """Where refinement ceases to help towards the far support."""
    runs = [_run("fourier-kink", terms=n, steps=40 * n) for n in (8, 16, 32)]
    beyond = post_slack_spread(runs[1:], stop=min(r.reached for r in runs))
    assert beyond is not None
    before = measures.path_gap(runs[1], runs[2], measures.WINDOW)[0]
    limit = convergence_limit(runs)
    return {"reached": runs[-1].reached, "gap of the finest two": beyond, "to 0.80": before, "limit": limit}


@_measure
def _start(graded: bool) -> float:
    """Path error of a light mass just after the entry."""
    scene = _scene(mu=0.01)
    finer: dict[str, Any] = {"grading": 30.0, "entry": 0.08} if graded else {}  # elements of mu, a first step of mu/20
    r = run(scene, "following-p2", elements=8, steps=400, **finer)
    fine = run(scene, "following-p2", elements=40, steps=3000, grading=30.0, entry=0.01)
    gap = np.interp([0.02, 0.05], r.s_o / r.length, r.v) - np.interp([0.02, 0.05], fine.s_o / fine.length, fine.v)
    return float(np.abs(gap).max() / fine.max_deflection)


@_measure
def _slack(law: str) -> dict[str, float]:
    """How far two resolutions come on the slack cable, and how far apart their paths are there (to 0.95 at most)."""
    runs = [_run("following-p2", law=law, elements=n, steps=steps) for n, steps in ((10, 800), (15, 1200))]
    reached = min(r.reached for r in runs)
    spread = post_slack_spread(runs, stop=min(reached, 0.95))
    return {"reached": reached, "spread after the onset": float("nan") if spread is None else spread}


@_measure
def _negative(method: str, **how: Any) -> float:
    """Place of the mass at which the strain of some point is first of compression; infinite where none ever is."""
    r = _run(method, law="elastic", **how)
    pressed = r.fields.s_o[r.fields.T_pointwise.min(axis=1) < 0.0]
    return float(pressed[0] / r.length) if pressed.size else float("inf")


@_measure
def _front(**how: Any) -> float:
    """Path error of a mass of a hundredth where its own front meets it, come back from the far support."""
    scene, window = _scene(mu=0.01), (0.5, 0.65)
    how, fine = ({"elements": 40, "until": window[1]} | x for x in (how, {"steps": 1000, "scheme": "radau"}))
    return measures.path_gap(run(scene, "following-p4", **how), run(scene, "following-p4", **fine), window)[0]


@_measure
def _onset(method: str, *, scene: dict[str, float] | None = None, **how: Any) -> float:
    """Place s_o/l of the mass where a run says that the cable goes slack."""
    onset = run(_scene(**(scene or {})), method, **how).slack_onset
    return float("nan") if onset is None else onset


@_measure
@cache
def _noise(model: str) -> dict[str, float]:
    """Gaps of two resolutions of a stiff cable, before the slack; and of the path to that of the full model."""
    scene = _scene(alpha=1e6)
    a, b = (run(scene, "following-p2", model=model, elements=n, steps=50 * n) for n in (8, 16))
    window = (0.02, min(0.2, a.reached, b.reached))
    c, d = (replace(r, fields=replace(r.fields, T=r.fields.T_pointwise)) for r in (a, b))
    found = {
        "tension": measures.tension_gap(a, b, window), "pointwise": measures.tension_gap(c, d, window),
        "path": measures.path_gap(a, b, window)[0],
    }  # fmt: skip
    if model != "full":
        full = run(scene, "following-p2", elements=16, steps=800)
        found["path of both models"] = measures.path_gap(b, full, (0.02, 0.2))[0]
    return found


@_measure
def _frozen(terms: int) -> float:
    system = GalerkinSystem(_scene().groups, Fourier(terms))
    end = system.phases[-1][1]
    return float(np.exp(end * max(specimens.frozen_growth(system, x * end) for x in (0.1, 0.5, 0.9))))


@_measure
def _explicit(terms: int, factor: float) -> dict[str, float]:
    """Central differences with a step that is `factor` times the critical one of theory."""
    steps = specimens.critical_steps(_scene().groups, terms) / factor
    r = _run("fourier", terms=terms, steps=round(steps), scheme="central-difference")
    return {"step over critical": factor, "reached": r.reached, "energy": _gain(r)}
