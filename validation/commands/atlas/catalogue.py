"""The ways methods fail, each as data with a case that shows the failure and the same case with the remedy.

The rows are those of the formulations' list of failures and a few met since.  A failure or a remedy is a function that
returns the number it is judged by and whether it showed; `run_row` runs one row, `tests/validation` all of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Literal

import numpy as np

from cablefem import newmark
from cablefem.response import Response
from cablefem.scene import Scene
from validation.commands.atlas import specimens
from validation.core import measures
from validation.core.methods import Method
from validation.core.running import run
from validation.core.trust import convergence_limit, post_slack_spread, recommended
from validation.core.watch import MOST_GAIN


@dataclass(frozen=True, slots=True)
class Seen:
    """What a case showed: numbers by name, and whether it is what the row says."""

    values: dict[str, float]
    shown: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One way to fail."""

    name: str
    scene: str
    method: str  # and settings, in words
    symptom: str
    cause: str
    remedy: str
    failure: Callable[[], Seen]
    cure: Callable[[], Seen]


def run_row(row: Row) -> dict[str, Any]:
    """Run one row and return it as data: what it says, what was measured, and whether both showed."""
    failed, cured = row.failure(), row.cure()
    return {
        "name": row.name, "scene": row.scene, "method": row.method, "symptom": row.symptom, "cause": row.cause,
        "remedy": row.remedy, "failure": {k: float(x) for k, x in failed.values.items()},
        "cure": {k: float(x) for k, x in cured.values.items()},
        "failure_shown": bool(failed.shown), "remedy_works": bool(cured.shown),
    }  # fmt: skip


# --- cases ----------------------------------------------------------------------------------------------------------


@cache
def _scene(**groups: float) -> Scene:
    return Scene.load("level").variant(**groups) if groups else Scene.load("level")


@cache
def _reference(model: str = "full", **groups: float) -> Response:
    """Path right to 2e-4 (level) in a second."""
    return run(_scene(**groups), "following-p2", model=model, elements=20, steps=1500)


def _path_error(
    method: str | Method, *, model: str = "full", groups: dict[str, float] | None = None, **how: Any
) -> float:
    """Largest path error in s_o/l 0.02 to 0.80, over the largest deflection; infinite for a run that broke before."""
    reference = _reference(model, **(groups or {}))
    r = run(_scene(**(groups or {})), method, model=model, law="elastic", **how)
    if r.reached < measures.WINDOW[1]:
        return float("inf")
    return measures.path_gap(r, reference, measures.WINDOW)[0]


def _gain(method: str | Method, **how: Any) -> float:
    """Energy gained without being given, over weight times deflection."""
    gain = run(_scene(), method, **how).energy_gain
    return float("inf") if gain is None else gain


def _naive() -> Seen:
    errors = {str(n): _path_error("fixed-p1-naive", elements=n) for n in (20, 40, 80)}
    return Seen(errors, errors["80"] > 0.5 and errors["80"] > 0.9 * errors["20"])


def _not_naive() -> Seen:
    values = {
        "fixed-p2-path": _path_error("fixed-p2-path"), "fixed-hermite": _path_error("fixed-hermite"),
        "following-p1": _path_error("following-p1"),
    }  # fmt: skip
    return Seen(values, max(values.values()) < 0.06)


def _dropped() -> Seen:
    values = {
        "no Coriolis, path": _path_error(specimens.NO_CORIOLIS, terms=20, steps=600),
        "no Coriolis, energy": _gain(specimens.NO_CORIOLIS, terms=20, steps=600),
        "no convection, path": _path_error(specimens.NO_CONVECTION, terms=20, steps=600),
    }
    return Seen(values, min(values.values()) > 1.0)


def _not_dropped() -> Seen:
    values = {"path": _path_error("fourier", terms=20, steps=600), "energy": _gain("fourier", terms=20, steps=600)}
    return Seen(values, values["path"] < 0.1 and values["energy"] < MOST_GAIN)


def _constraint(**how: Any) -> float:
    return _gain("fixed-p1-path", law="elastic", **how)


def _undamped_constraint() -> Seen:
    values = {str(n): _constraint(elements=n, scheme="trapezoidal") for n in (20, 40)}
    return Seen(values, min(values.values()) > 1e3)


def _damped_constraint() -> Seen:
    values = {
        "newmark": _constraint(elements=40, steps=1000),
        "path": _path_error("fixed-p1-path", elements=40, steps=1000),
    }
    return Seen(values, values["newmark"] < MOST_GAIN and values["path"] < 0.06)


FREE = {"elements": 12, "amplitude": 0.01, "mode": 2}  # let go from one hundredth of the length


def _vibration(scheme: str, steps: int = 1000, **how: Any) -> np.ndarray:
    return specimens.free_vibration(_scene().groups, newmark.scheme(scheme, **how), dt=0.03, steps=steps, **FREE)


def _gaining() -> Seen:
    energy = _vibration("trapezoidal")
    return Seen({"energy at most": float(energy.max())}, bool(energy.max() > 10.0))


def _kept() -> Seen:
    energy = _vibration("energy")
    off = float(np.abs(energy - 1.0).max())
    return Seen({"energy off by": off, "steps": energy.size - 1}, off < 1e-9 and energy.size == 1001)


SMALL = {"elements": 16, "amplitude": 1e-4, "mode": 2}  # small enough to be linear; second mode: no axial stretching


def _slow(scheme: str, **how: Any) -> float:
    energy = specimens.free_vibration(_scene().groups, newmark.scheme(scheme, **how), dt=0.05, steps=600, **SMALL)
    # the first 100 steps are left to the axial waves that the start sets off
    return float(energy[-1] / energy[100])


def _dying() -> Seen:
    left = _slow("newmark", newmark_gamma=0.6)
    return Seen({"energy left": left}, left < 0.02)


def _living() -> Seen:
    left = _slow("generalized-alpha", rho_inf=0.9)
    return Seen({"energy left": left}, left > 0.5)


def _ripple(method: str, terms: int) -> float:
    return measures.oscillation(run(_scene(), method, law="elastic", terms=terms, steps=600), measures.WINDOW)


def _gibbs() -> Seen:
    values = {str(n): _ripple("fourier", n) for n in (30, 60)}
    return Seen(values, values["60"] > 0.08)


def _no_gibbs() -> Seen:
    values = {"kink, 60": _ripple("fourier-kink", 60), "elements": _ripple_elements()}
    return Seen(values, max(values.values()) < 0.05)


def _ripple_elements() -> float:
    return measures.oscillation(run(_scene(), "following-p2", law="elastic", elements=15), measures.WINDOW)


def _omega(level: int, reading: Literal["literal", "scaling"]) -> float:
    from galerkin.bases.daubechies import Daubechies
    from galerkin.modes import bare_frequencies

    return float(bare_frequencies(_scene().groups, Daubechies(order=4, level=level, reading=reading), n=1)[0])


EXACT = 5.3454766022  # first frequency of the linearised catenary, by collocation to 11 digits


def _misread() -> Seen:
    values = {f"level {j}": abs(_omega(j, "scaling") / EXACT - 1.0) for j in (0, 1, 2)}
    return Seen(values, values["level 2"] > 0.5 * values["level 1"] and values["level 2"] > 1e-3)


def _read() -> Seen:
    values = {f"level {j}": abs(_omega(j, "literal") / EXACT - 1.0) for j in (0, 1, 2)}
    return Seen(values, values["level 2"] < 1e-5)


CRITICAL = {"speed_ratio": 0.99}


def _critical() -> Seen:
    values = {str(n): _path_error("fourier", model="string", groups=CRITICAL, terms=n, steps=800) for n in (8, 64)}
    return Seen(values, values["64"] > 0.09)


def _subcritical() -> Seen:
    error = _path_error("following-p2", model="string", groups=CRITICAL, elements=10, steps=800)
    return Seen({"following-p2": error}, error < 1e-3)


@cache
def _towards_the_end() -> tuple[Response, ...]:
    return tuple(run(_scene(), "fourier-kink", terms=n, steps=40 * n) for n in (8, 16, 32))


def _far_support() -> Seen:
    runs = _towards_the_end()
    beyond = post_slack_spread(runs[1:], stop=min(r.reached for r in runs))
    assert beyond is not None
    before = measures.path_gap(runs[1], runs[2], measures.WINDOW)[0]
    return Seen(
        {"reached": runs[-1].reached, "gap of the finest two": beyond, "to 0.80": before}, beyond > 5.0 * before
    )


def _said() -> Seen:
    runs = _towards_the_end()
    limit = convergence_limit(runs)
    return Seen({"limit": limit}, measures.WINDOW[1] < limit < runs[-1].reached)


LIGHT = {"mu": 0.01}


@cache
def _light_reference() -> Response:
    return run(_scene(**LIGHT), "following-p2", elements=40, steps=3000, grading=30.0, entry=0.01)


def _start_error(r: Response) -> float:
    fine = _light_reference()
    gap = np.interp([0.02, 0.05], r.s_o / r.length, r.v) - np.interp([0.02, 0.05], fine.s_o / fine.length, fine.v)
    return float(np.abs(gap).max() / fine.max_deflection)


def _light() -> Seen:
    error = _start_error(run(_scene(**LIGHT), "following-p2", elements=8, steps=400))
    return Seen({"path at s_o/l = 0.02, 0.05": error}, error > 1.5e-3)


def _graded() -> Seen:
    settings = recommended(_scene(**LIGHT), "following-p2", elements=8, steps=400)
    error = _start_error(run(_scene(**LIGHT), "following-p2", **settings))
    return Seen({"path at s_o/l = 0.02, 0.05": error}, error < 1e-3)


def _resting() -> Seen:
    values = {str(n): _path_error(specimens.RESTING_START, terms=n, steps=1000) for n in (15, 30)}
    return Seen(values, values["30"] > 1.5 * _path_error("fourier-kink", terms=30, steps=1000))


def _limit_start() -> Seen:
    values = {"30": _path_error("fourier-kink", terms=30, steps=1000)}
    return Seen(values, values["30"] < 9e-4)


@cache
def _slack_runs(law: str) -> tuple[Response, ...]:
    return tuple(
        run(_scene(), "following-p2", law=law, elements=n, steps=steps) for n, steps in ((10, 800), (15, 1200))
    )


def _compressed() -> Seen:
    runs = _slack_runs("elastic")
    spread = post_slack_spread(runs, stop=min(r.reached for r in runs))
    values = {"reached": min(r.reached for r in runs), "spread after the onset": spread or 0.0}
    return Seen(values, values["reached"] < 0.99 or values["spread after the onset"] > 0.1)


def _tension_only() -> Seen:
    runs = _slack_runs("auto")
    spread = post_slack_spread(runs)
    values = {"reached": min(r.reached for r in runs), "spread up to 0.95": float("nan") if spread is None else spread}
    return Seen(values, values["reached"] > 0.995 and values["spread up to 0.95"] < 0.02)


def _phantom() -> Seen:
    r = run(_scene(), "wavelet", law="elastic", level=1, steps=600)
    first = float(r.s_o[np.argmax(r.tension_min < 0.0)] / r.length)
    return Seen({"first negative point": first}, first < 0.3)


def _means() -> Seen:
    onsets = {
        "wavelet": run(_scene(), "wavelet", level=1, steps=600).slack_onset,
        "fourier-kink": run(_scene(), "fourier-kink", terms=20, steps=1000).slack_onset,
        "following-p2": run(_scene(), "following-p2").slack_onset,
    }
    values = {name: float("nan") if x is None else x for name, x in onsets.items()}
    return Seen(values, values["wavelet"] > 0.82 and abs(values["following-p2"] - 0.831) < 0.003)


STIFF = {"alpha": 1e6}


def _tension_noise(model: str) -> dict[str, float]:
    a, b = (run(_scene(**STIFF), "following-p2", model=model, elements=n, steps=50 * n) for n in (8, 16))
    window = (0.02, min(0.2, a.reached, b.reached))
    return {"tension": measures.tension_gap(a, b, window), "path": measures.path_gap(a, b, window)[0]}


def _stiff() -> Seen:
    values = _tension_noise("full")
    return Seen(values, values["tension"] > 1.0 and values["path"] < 0.02)


def _quiet() -> Seen:
    values = _tension_noise("stretching")
    full, chord = (
        run(_scene(**STIFF), "following-p2", model=m, elements=16, steps=800) for m in ("full", "stretching")
    )
    values["path of both models"] = measures.path_gap(chord, full, (0.02, 0.2))[0]
    return Seen(values, values["tension"] < 0.1 * _tension_noise("full")["tension"])


def _frozen() -> Seen:
    from galerkin.bases.fourier import Fourier
    from galerkin.equations import GalerkinSystem

    system = GalerkinSystem(_scene().groups, Fourier(12))
    end = system.phases[-1][1]
    growth = max(specimens.frozen_growth(system, x * end) for x in (0.1, 0.5, 0.9))
    return Seen({"predicted growth over the crossing": float(np.exp(growth * end))}, growth * end > np.log(1e3))


def _thawed() -> Seen:
    values = {"energy": _gain("fourier", terms=12, steps=600), "path": _path_error("fourier", terms=12, steps=600)}
    return Seen(values, values["energy"] < MOST_GAIN and values["path"] < 0.12)


def _explicit(factor: float) -> Seen:
    """Central differences with a step that is `factor` times the critical one of theory."""
    from galerkin.bases.fourier import Fourier
    from galerkin.equations import GalerkinSystem

    system = GalerkinSystem(_scene().groups, Fourier(12))
    end = system.phases[-1][1]
    critical = 2.0 / specimens.largest_frequency(system, 0.5 * end)
    r = run(_scene(), "fourier", terms=12, steps=round(end / (factor * critical)), scheme="central-difference")
    gain = float("inf") if r.energy_gain is None else r.energy_gain
    return Seen({"step over critical": factor, "reached": r.reached, "energy": gain}, True)


def _too_long() -> Seen:
    seen = _explicit(1.15)
    return replace(seen, shown=seen.values["reached"] < 0.5 and seen.values["energy"] > 1.0)


def _short_enough() -> Seen:
    seen = _explicit(0.8)
    return replace(seen, shown=seen.values["reached"] > 0.8 and seen.values["energy"] < MOST_GAIN)


CATALOGUE: tuple[Row, ...] = (
    Row(
        name="chain rule inside fixed P1 or P2 elements", scene="level", method="fixed-p1-naive, 20 to 80 elements",
        symptom="converges to a wrong limit: path error 0.8 that does not fall",
        cause="ds_o^2 w'' lives in the jumps of slope between elements, which N'' inside an element does not see",
        remedy="the mass as a constrained particle, C1 elements, or a mesh that follows the mass",
        failure=_naive, cure=_not_naive,
    ),
    Row(
        name="Coriolis or convective terms dropped", scene="level", method="fourier, 20 terms, with the fault planted",
        symptom="the energy grows without being given any, the path is off by its own size or more",
        cause="the acceleration of the mass is not the second derivative of its place any more",
        remedy="the full material derivative (21)-(23)", failure=_dropped, cure=_not_dropped,
    ),
    Row(
        name="constraint and average acceleration", scene="level", method="fixed-p1-path, scheme = trapezoidal",
        symptom="energy grows by many orders",
        cause="a constraint on positions has index 3; nothing damps its oscillation",
        remedy="newmark_gamma = 0.6 or generalized-alpha, about 25 steps per element",
        failure=_undamped_constraint, cure=_damped_constraint,
    ),
    Row(
        name="trapezoidal rule on a nonlinear cable", scene="level, bare",
        method="free vibration, 12 P1 elements, dt = 0.03",
        symptom="the energy of a free cable grows by orders",
        cause="A-stability is a linear notion; axial modes, 29 times faster, are not resolved",
        remedy="the energy rule (average vector field): kept to 1e-9; or smaller steps, generalized-alpha",
        failure=_gaining, cure=_kept,
    ),
    Row(
        name="newmark_gamma = 0.6", scene="level, bare", method="small free vibration, 600 steps of 0.05",
        symptom="a free vibration has lost 99 percent of its energy after 25 periods",
        cause="first order, it damps the motion one wants",
        remedy="generalized-alpha, rho_inf 0.8 to 0.9", failure=_dying, cure=_living,
    ),
    Row(
        name="Gibbs oscillations of the tension", scene="level", method="fourier, 30 and 60 terms",
        symptom="the tension oscillates along the whole cable, a tenth of H with 60 terms still",
        cause="the kink at the mass, amplified by alpha", remedy="a travelling kink, or a following mesh",
        failure=_gibbs, cure=_no_gibbs,
    ),
    Row(
        name="wavelet set misread", scene="level, bare", method="wavelet, reading = scaling",
        symptom="omega_1 stalls 1.4 percent too high",
        cause="scaling functions for j = -1 leave three functions out at the right support",
        remedy="the printed set literally: wavelets dilated by two", failure=_misread, cure=_read,
    ),
    Row(
        name="critical speed", scene="level, V/c = 0.99", method="fourier, string model, 8 and 64 terms",
        symptom="13 percent path error left after 8 times more terms",
        cause="the kink grows like 1/(1 - V^2), a layer in front of the mass that global functions do not resolve",
        remedy="local resolution: the following mesh", failure=_critical, cure=_subcritical,
    ),
    Row(
        name="far support", scene="level", method="fourier-kink, 8 to 32 terms",
        symptom="past some place refinement does not bring paths together",
        cause="the contact force grows like 1/distance", remedy="say where the answer ends: convergence_limit",
        failure=_far_support, cure=_said,
    ),
    Row(
        name="start-up of a light mass", scene="level, mu = 0.01", method="following-p2, 8 elements, 400 steps",
        symptom="the first percent of the path is off by more than 1e-3",
        cause="a layer of duration and width about mu", remedy="graded steps and elements: recommended(scene, method)",
        failure=_light, cure=_graded,
    ),
    Row(
        name="inconsistent start", scene="level", method="fourier-kink, sines at rest while the hat accelerates",
        symptom="an order in time is lost", cause="a(0) is the limit t -> 0+ of M a = F - R, for all unknowns at once",
        remedy="solve for the limit", failure=_resting, cure=_limit_start,
    ),
    Row(
        name="slack cable with an elastic law", scene="level", method="following-p2, law = elastic",
        symptom="every resolution dies at another place or returns noise",
        cause="a cable that carries compression is ill-posed: its transverse stiffness is negative",
        remedy="law = auto: tension-only from the onset on, with damping", failure=_compressed, cure=_tension_only,
    ),
    Row(
        name="slack that is Gibbs", scene="level", method="wavelet, level 1, tension point by point",
        symptom="negative tension from s_o/l = 0.12 on", cause="ripples of the basis, not compression",
        remedy="judge by the mean over the shortest wave or element", failure=_phantom, cure=_means,
    ),
    Row(
        name="stiff cable", scene="level, alpha = 1e6", method="following-p2, trapezoidal",
        symptom="the path is right, the tension is noise", cause="axial waves 1000 times faster than the crossing",
        remedy="one quasi-static tension for the whole cable (stretching model): path off by 9 percent",
        failure=_stiff, cure=_quiet,
    ),
    Row(
        name="frozen-coefficient eigenvalues", scene="level", method="fourier, 12 terms, M, C, K frozen at one instant",
        symptom="growth by orders over the crossing is predicted",
        cause="the time dependence of M, C and K is essential", remedy="never a verdict: run it and watch the energy",
        failure=_frozen, cure=_thawed,
    ),
    Row(
        name="explicit steps too long", scene="level",
        method="fourier, 12 terms, central-difference at 1.15 of the limit",
        symptom="blows up at once", cause="dt > 2/omega_max, omega_max of the axial modes",
        remedy="dt < 2/omega_max, or an implicit scheme", failure=_too_long, cure=_short_enough,
    ),
)  # fmt: skip
