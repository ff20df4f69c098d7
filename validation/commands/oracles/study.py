"""Every exact answer that a solver can be held against, with the order at which the solver comes closer to it.

A row agrees when the finest run lies within its own error bar (the gap to its coarser companion, as in `estimate`) of
the exact answer AND the errors fall with the order that the case has in theory.  Some rows must fail: a method that is
wrong on purpose, a limit that is another one, a law without one of its terms.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from cablefem import newmark
from cablefem.response import Array, States, write_json
from cablefem.scene import AccelerateCruiseBrake, ConstantAcceleration, ConstantSpeed, Groups, Scene
from cablefem.scene.motion import Motion, Piece
from validation.core import measures
from validation.core.estimate import CREDITED_SPACE_ORDER, SAFETY
from validation.core.methods import find
from validation.core.running import run
from validation.oracles import (
    ORACLES,
    accelerating_force,
    accelerating_mass,
    catenary_modes,
    inextensible,
    irvine,
    massless_string,
    moving_force,
    moving_mass,
    running_apart,
)

WINDOW = measures.WINDOW
# An order read off a ladder of three or four runs scatters by so much: fronts pass the mass at other places of the
# mesh in each of them.
ORDER_SCATTER = 0.3

# Rounding of frequencies: dense eigenvalue solvers lose the ratio of the stiffest axial to the lowest mode.
ROUNDING = 1e-10

# Oracles for which the solvers have no such load or cable; tests put each into its own differential equation.
UNREACHED = {
    "curved-cable": "a centrifugal force without inertia: the solvers' force is the weight alone",
    "harmonic-force": "the solvers' load is a weight, which does not oscillate",
    "foundation": "the solvers' cables hang free",
    "coupled-travel": "both solvers prescribe the travel",
}

Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class Row:
    """One oracle held against one method."""

    oracle: str
    case: str  # what is moving on what, in words
    method: str
    ladder: list[str]  # what was refined, coarse to fine
    refined: str  # "resolution", or the parameter of a limit
    sizes: Sequence[float]  # resolution, or one over the parameter: errors fall like sizes^-order
    errors: Sequence[float]  # relative rms
    error: float  # of the finest
    worst: float  # the largest error anywhere, of the finest
    observed_order: float  # nan where the errors do not fall
    expected_order: float | None
    because: str  # why that order
    allowed: float  # error that the finest run may have
    allowed_because: str
    verdict: str  # "agree" | "disagree"
    expected: str  # the verdict that this row must have


@dataclass(frozen=True, slots=True)
class Task:
    """A row still to be computed."""

    oracle: str
    case: str
    method: str
    compute: Callable[[], Row]

    @property
    def key(self) -> tuple[str, str, str]:
        return self.oracle, self.case, self.method


def oracle_table(out: Path, progress: Progress | None = None) -> dict[str, Any]:
    """Hold all solvers against all oracles and write oracles.json: rows, and the oracles that no solver can reach.

    A table that was interrupted goes on where it stopped; one that is complete is made anew.
    """
    out.mkdir(parents=True, exist_ok=True)
    todo, rows = tasks(), _stored(out / "oracles.json")
    for i, task in enumerate(todo):
        if progress is not None:
            progress("oracles", i / len(todo))
        if task.key not in rows:
            rows[task.key] = _json(task.compute())
            write_json(out / "oracles.json", _content([rows[t.key] for t in todo if t.key in rows], len(todo)))
    content = _content([rows[t.key] for t in todo], len(todo))
    write_json(out / "oracles.json", content)
    if progress is not None:
        progress("oracles", 1.0)
    return content


def tasks() -> list[Task]:
    """Return the rows of the table, in its order."""
    return [*_path_tasks(), *_limit_tasks(), *_frequency_tasks(), *_jump_tasks()]


def _content(rows: list[dict[str, Any]], total: int) -> dict[str, Any]:
    titles = {oracle.name: oracle.title for oracle in ORACLES}
    as_expected = all(row["verdict"] == row["expected"] for row in rows)
    return {
        "verdict": "not comparable" if len(rows) < total else "agree" if as_expected else "disagree",
        "rows": rows,
        "unreached": [
            {"oracle": name, "title": titles[name], "reason": f"no solver counterpart, {reason}: checked in its own "
             "equation"} for name, reason in UNREACHED.items()
        ],
    }  # fmt: skip


def _stored(file: Path) -> dict[tuple[str, str, str], dict[str, Any]]:
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        rows = content["rows"] if content["verdict"] == "not comparable" else []
        return {(row["oracle"], row["case"], row["method"]): row for row in rows if set(row) == _ROW}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


_ROW = set(Row.__dataclass_fields__)


def _json(row: Row) -> dict[str, Any]:
    """Return the row with null for every number that does not exist."""

    def finite(x: Any) -> Any:
        if isinstance(x, list):
            return [finite(y) for y in x]
        return None if isinstance(x, float) and not math.isfinite(x) else x

    return {k: finite(v) for k, v in asdict(row).items()}


# --- orders and verdicts --------------------------------------------------------------------------------------------


def order(sizes: Sequence[float], errors: Sequence[float]) -> float:
    """Return the slope of log(error) on log(1/size); nan if a run failed or the error does not fall over the ladder."""
    e = np.asarray(errors, float)
    if not (np.isfinite(e).all() and np.all(e > 0.0) and e[-1] < e[0] and e.size > 1):
        return math.nan
    return float(-np.polyfit(np.log(sizes), np.log(e), 1)[0])


def judge(error: float, allowed: float, observed: float, expected: float | None) -> str:
    """Return agree if the error is allowed and the order, where one is expected, is there."""
    if not (math.isfinite(error) and error <= allowed):
        return "disagree"
    return "agree" if expected is None or observed >= expected - ORDER_SCATTER else "disagree"


# --- paths ----------------------------------------------------------------------------------------------------------

Path_ = tuple[Array, Array, Array]  # t, s_o, v of the mass

# method -> setting that is refined, its values, and the steps that go with each: as many as keep the error of time
# below that of space, at the order of either
LADDERS: dict[str, tuple[str, tuple[int, ...], tuple[int, ...]]] = {
    "following-p1": ("elements", (10, 20, 40, 80), (400, 800, 1600, 3200)),
    "following-p2": ("elements", (4, 8, 16, 32), (200, 475, 1130, 2700)),
    "fourier": ("terms", (8, 16, 32, 64), (320, 640, 1280, 2560)),
    "fourier-kink": ("terms", (5, 10, 20, 40), (500, 1000, 2000, 4000)),
    "wavelet": ("level", (0, 1, 2, 3), (400, 680, 1240, 2360)),
    "wavelet-kink": ("level", (0, 1, 2), (1000, 1700, 3100)),
    "fixed-hermite": ("elements", (8, 16, 32), (800, 6400, 51200)),
    "fixed-p1-path": ("elements", (10, 20, 40, 80), (250, 500, 1000, 2000)),
    "fixed-p2-path": ("elements", (10, 20, 40, 80), (250, 500, 1000, 2000)),
    "fixed-p1-naive": ("elements", (10, 20, 40, 80), (250, 500, 1000, 2000)),
    "fixed-p2-naive": ("elements", (10, 20, 40, 80), (250, 500, 1000, 2000)),
}

# Orders of the rms error of the path of a mass, and why.
_INSIDE = "the kink under the mass lies inside an element or between the waves of the basis"
MASS_ORDERS: dict[str, tuple[float | None, str]] = {
    "following-p1": (1.9, "a node rides on the mass, so the kink costs nothing; what linear elements have"),
    "following-p2": (2.5, "as P1; a front with a jump of curvature runs through the elements, so not 3"),
    "fourier": (1.0, _INSIDE),
    "fourier-kink": (2.0, "the hat takes the kink away; the jump of curvature at the mass and at fronts is left"),
    "wavelet": (1.0, _INSIDE),
    "wavelet-kink": (2.0, "as sines with a hat"),
    "fixed-hermite": (1.0, _INSIDE + "; steps grow like elements³, because N'' jumps at nodes"),
    "fixed-p1-path": (1.0, _INSIDE),
    "fixed-p2-path": (1.0, _INSIDE),
    "fixed-p1-naive": (None, "none: the centrifugal force is lost at the nodes, it converges to something else"),
    "fixed-p2-naive": (None, "none: the centrifugal force is lost at the nodes, it converges to something else"),
}
_FRONT = "a force without inertia sends off a front with a jump of slope at once"
FORCE_ORDERS: dict[str, tuple[float | None, str]] = {
    "following-p1": (1.0, _FRONT),
    "following-p2": (1.2, _FRONT),
    "fourier": (1.0, _INSIDE),
    "fourier-kink": (1.5, _FRONT + ", which the hat at the force does not take away"),
}
SUDDEN_ORDERS: dict[str, tuple[float | None, str]] = dict.fromkeys(
    FORCE_ORDERS, (1.0, "the force begins inside the string: two fronts with a jump of slope")
)


@dataclass(frozen=True, slots=True)
class Crossing:
    """Something moving over a taut string, and its exact path."""

    oracle: str
    case: str
    groups: Groups
    exact: Callable[[Array], Array]  # v of the load at times t
    load: str = "mass"
    finer: int = 1  # a light mass moves in a layer as short as its mass ratio: ladders begin so much finer
    begins: float = 0.0  # s_o at t = 0; the string rests then, and no wave has come back before `until`
    until: float = WINDOW[1]

    @property
    def window(self) -> tuple[float, float]:
        return max(WINDOW[0], self.begins), self.until


def _groups(mu: float, sigma: float, motion: Motion, alpha: float = 323.0) -> Groups:
    return Groups(mu=mu, alpha=alpha, sigma=sigma, c=0.5 * sigma, chord_cos=1.0, chord_sin=0.0, motion=motion)


def _inside(s_o: float, V: float, a: float) -> Motion:
    """Return a travel that begins inside the string and ends at the far support."""
    d = 1.0 - s_o
    end = d / V if a == 0.0 else (math.sqrt(V * V + 2.0 * a * d) - V) / a
    return Motion(((0.0, end),), ((Piece(0.0, 0.0, s_o, V, 0.5 * a),),), 1.0)


@lru_cache
def crossings() -> dict[str, Crossing]:
    """Return the crossings; numbers differ from one and from each other so that no factor can hide."""
    MU, SIGMA = 0.7, 0.31
    P = MU * SIGMA
    found: dict[str, Crossing] = {}

    def mass(key: str, oracle_travel: moving_mass.Travel, motion: Motion, case: str, mu: float = MU) -> None:
        ride = moving_mass.solve(oracle_travel, mu=mu, sigma=SIGMA)
        finer = 3 if mu < 0.5 else 1
        found[key] = Crossing("moving-mass", case, _groups(mu, SIGMA, motion), ride.path, finer=finer)

    for key, mu, V in (("light", 0.2, 0.6), ("heavy", 5.0, 0.37), ("fast", MU, 0.9)):
        case = f"mass ratio {mu:g}, speed {V:g}"
        mass(key, moving_mass.constant_speed(V), ConstantSpeed(speed=V).motion(1.0), case, mu)
    a = 0.23
    rest = ConstantAcceleration(acceleration=a, initial_speed=0.0).motion(1.0)
    mass("rest", moving_mass.from_rest(a), rest, f"from rest, acceleration {a:g}")
    brake = AccelerateCruiseBrake(top_speed=0.55).motion(1.0)
    mass("brake", moving_mass.accelerate_cruise_brake(0.55), brake, "accelerate, cruise, brake")

    for V in (0.37, 0.95):
        case = f"speed {V:g}" + ("" if V < 0.9 else ", near the wave speed")

        def fryba(t: Array, V: float = V) -> Array:
            return moving_force.displacement(V * t, t, P=P, V=V)

        found[f"force {V:g}"] = Crossing(
            "moving-force", case, _groups(MU, SIGMA, ConstantSpeed(speed=V).motion(1.0)),
            fryba, "force",
        )  # fmt: skip
    V, begins = 0.55, 0.3
    found["one force"] = Crossing(
        "running-apart", "one of the two forces, until its waves come back",
        _groups(MU, SIGMA, _inside(begins, V, 0.0)),
        lambda t: running_apart.one_force(V * t, t, P=P, V=V), "force", begins=begins, until=0.6,
    )  # fmt: skip
    # the wave speed is passed at t = 1/a, s_o = begins + 1/(2 a); no wave is back before s_o = 0.8
    a, begins = 2.6, 0.2
    slow = begins + 0.8 / (2.0 * a)
    travel = _groups(MU, SIGMA, _inside(begins, 0.0, a))

    def force_path(t: Array) -> Array:
        return accelerating_force.displacement(0.5 * a * t * t, t, P=P, a=a)

    def mass_path(t: Array) -> Array:
        return accelerating_mass.path(t, mu=MU, sigma=SIGMA, a=a)

    for key, until, case in (
        ("below", slow, "up to 0.89 of the wave speed"),
        ("through", 0.8, "through the wave speed"),
    ):
        found[f"force {key}"] = Crossing("accelerating-force", case, travel, force_path, "force", 1, begins, until)
        found[f"mass {key}"] = Crossing("accelerating-mass", case, travel, mass_path, "mass", 1, begins, until)
    return found


def straight_path(crossing: Crossing, method: str, **settings: Any) -> Path_:
    """Return (t, s_o, v) of a load on a taut string without sag, as the oracles have it; nan where the run broke.

    The solvers' `string` adds the static curvature of the scene to the load of the mass; it is taken out here, where
    the weight stays.  `scene_path` leaves it in.
    """
    m = find(method)
    s = m.settings(settings)
    system: Any = m.build(crossing.groups, s, model="string", load=crossing.load, law="elastic")
    if m.wing == "galerkin":
        system.cable.curvature = 0.0
    else:
        system._cable[2] = 0.0
    scheme = newmark.scheme(s["scheme"], newmark_gamma=s["newmark_gamma"], rho_inf=s["rho_inf"])
    start = None
    if crossing.begins:
        rest = np.zeros(system.n_dof)
        start = newmark.consistent_acceleration(system, 0.0, rest, rest.copy(), 0)
    states: list[newmark.State] = []
    try:
        for x in newmark.integrate(system, scheme, newmark.step_times(system, s["steps"]), start=start):
            states.append(x)
            if system.motion.at(x.t, x.phase)[0] > crossing.until:
                break
    except newmark.NewtonStalled:  # numbers have outgrown the tolerance
        return np.zeros(1), np.full(1, crossing.until), np.full(1, math.nan)
    stacked = States(*(np.array([getattr(x, name) for x in states]) for name in ("t", "q", "v", "a", "phase")))
    seen = system.observe(stacked, np.zeros(0), np.zeros(0, np.intp))
    return stacked.t, system.motion.position(stacked.t), seen.path[:, 1]


def scene_path(scene: Scene, method: str, **settings: Any) -> Path_:
    """Return (t, s_o, v) of a scene's string model through `run`, units and sampling included; dimensionless again."""
    r = run(scene, method, model="string", until=WINDOW[1], **settings)
    return r.t / scene.time_scale, r.s_o / r.length, r.v / r.length


def path_errors(
    path: Path_, exact: Callable[[Array], Array], window: tuple[float, float], size: float
) -> tuple[float, float]:
    """Return (largest, rms) of |v - exact| over the window, relative to `size`."""
    t, s_o, v = path
    inside = (s_o >= window[0]) & (s_o <= window[1])
    error = (v[inside] - exact(t[inside])) / size
    return float(np.abs(error).max()), float(np.sqrt(np.mean(error**2)))


def path_row(
    crossing: Crossing, method: str, orders: dict[str, tuple[float | None, str]],
    solve: Callable[..., Path_], expected: str = "agree",
) -> Row:  # fmt: skip
    """Climb a method's ladder and hold every rung against the exact path."""
    knob, values, steps = LADDERS[method]
    if crossing.finer > 1:
        values, steps = tuple(crossing.finer * x for x in values[:3]), tuple(crossing.finer * n for n in steps[:3])
    settings = [{knob: x, "steps": n} for x, n in zip(values, steps, strict=True)]
    sizes = [float(7 * 2**x + 3) if knob == "level" else float(x) for x in values]  # db4 has 2^J (2p - 1) + p - 1
    paths = [solve(method, **s) for s in settings]
    t = np.linspace(0.0, crossing.groups.motion.phases[-1][1], 2001)  # type: ignore[union-attr]
    s_o = crossing.groups.motion.position(t)  # type: ignore[union-attr]
    size = float(np.abs(crossing.exact(t[s_o <= crossing.window[1]])).max())
    with np.errstate(invalid="ignore"):
        errors = [path_errors(p, crossing.exact, crossing.window, size) for p in paths]
    p, because = orders[method]
    allowed, allowed_because = _path_bar(paths, sizes, crossing.window, size, p)
    observed = order(sizes, [e for _, e in errors])
    return Row(
        crossing.oracle, crossing.case, method, [_told(s) for s in settings], "resolution", sizes,
        [e for _, e in errors], errors[-1][1], errors[-1][0], observed, p, because, allowed, allowed_because,
        judge(errors[-1][1], allowed, observed, p), expected,
    )  # fmt: skip


def _path_bar(
    paths: list[Path_], sizes: list[float], window: tuple[float, float], size: float, p: float | None
) -> tuple[float, str]:
    """Return the error bar of the finest run, from its gap to the one before; the exact answer is not asked."""
    (t, _, v), coarse = paths[-1], paths[-2]
    if not (np.isfinite(v).all() and np.isfinite(coarse[2]).all()) or t.size < 5:
        return math.nan, "the run broke"
    credited = 1.0 if p is None else min(p, CREDITED_SPACE_ORDER)
    gap = path_errors(coarse, CubicSpline(t, v), window, size)[1]
    bar = SAFETY * gap / ((sizes[-1] / sizes[-2]) ** credited - 1.0)
    return bar, f"own error bar: {SAFETY} x gap to the run before / (ratio to the {credited:g} - 1)"


def _told(settings: dict[str, Any]) -> str:
    return ", ".join(f"{k} {v}" for k, v in settings.items())


def _path_tasks() -> list[Task]:
    found = []

    def add(
        key: str, methods: Sequence[str], orders: dict[str, tuple[float | None, str]], expected: str = "agree"
    ) -> None:
        for method in methods:

            def compute(method: str = method) -> Row:
                crossing = crossings()[key]
                return path_row(crossing, method, orders, partial(straight_path, crossing), expected)

            found.append(Task(crossings()[key].oracle, crossings()[key].case, method, compute))

    every, best = tuple(FORCE_ORDERS), ("following-p2", "fourier-kink")
    add("force 0.37", every, FORCE_ORDERS)
    add("force 0.95", every, FORCE_ORDERS)
    scene_case = "the paper's mass and speed, g (1 + V²)"
    for method in LADDERS:

        def through_scene(method: str = method) -> Row:
            scene = Scene.load("level")
            crossing = replace(paper_mass(), case=scene_case)
            wrong = find(method).wrong
            return path_row(crossing, method, MASS_ORDERS, partial(scene_path, scene), "disagree" if wrong else "agree")

        found.append(Task("moving-mass", scene_case, method, through_scene))
    for key in ("light", "heavy", "fast", "rest", "brake"):
        add(key, best, MASS_ORDERS)
    add("one force", every, SUDDEN_ORDERS)
    add("force below", ("fourier", "following-p2"), SUDDEN_ORDERS)
    # the passage leaves a front with a vertical tangent: half an order is lost where it passes
    passage = (0.7, "the front left behind at the wave speed has a vertical tangent")
    add("force through", ("fourier",), {"fourier": passage})
    unstable = (1.0, "none: faster than its waves, what rides with the load is unstable, the more the finer")
    add("force through", best, dict.fromkeys(best, unstable), "disagree")
    add("mass below", ("following-p2", "fourier"), MASS_ORDERS)
    blow = (1.0, "none to speak of: the blow at the wave speed sends off two jumps of the string itself")
    add("mass through", ("fourier",), {"fourier": blow}, "disagree")
    return found


@lru_cache
def paper_mass() -> Crossing:
    """Return the level scene's crossing of a taut string; its mass follows the parabola, so g becomes g (1 + V^2)."""
    g = Scene.load("level").groups
    assert g.motion is not None
    V = g.motion.at(0.0, 0)[1]
    ride = moving_mass.solve(moving_mass.constant_speed(V), mu=g.mu, sigma=g.sigma * (1.0 + V * V))
    return Crossing("moving-mass", "", g, ride.path)


# --- limits ---------------------------------------------------------------------------------------------------------


def _limit_row(
    oracle: str, case: str, method: str, parameter: str, ladder: list[str], sizes: list[float],
    errors: list[tuple[float, float]], p: float, because: str, expected: str = "agree",
) -> Row:  # fmt: skip
    """Return a row for a limit: the deviation from it must fall with the parameter as predicted."""
    observed = order(sizes, [e for _, e in errors])
    allowed = SAFETY * errors[-2][1] * (sizes[-2] / sizes[-1]) ** p
    told = f"{SAFETY} x the deviation before, fallen with order {p:g}"
    return Row(
        oracle, case, method, ladder, parameter, sizes, [e for _, e in errors], errors[-1][1], errors[-1][0],
        observed, p, because, allowed, told, judge(errors[-1][1], allowed, observed, p), expected,
    )  # fmt: skip


def massless_row(method: str) -> Row:
    """Hold a heavy slow mass against the string without inertia, at the same T l/(2 M V^2)."""
    a, sigma, ratios = 0.7, 0.31, (5.0, 20.0, 80.0)
    errors = []
    for mu in ratios:
        V = 1.0 / math.sqrt(2.0 * mu * a)

        def exact(t: Array, mu: float = mu, V: float = V) -> Array:
            return 0.25 * mu * sigma * massless_string.path(V * t, a=a)

        crossing = Crossing("", "", _groups(mu, sigma, ConstantSpeed(speed=V).motion(1.0)), exact)
        fine: dict[str, Any] = {"elements": 16} if method == "following-p2" else {"terms": 20}
        path = straight_path(crossing, method, **fine, steps=round(150.0 / V))
        size = 0.25 * mu * sigma * float(massless_string.path(np.linspace(0.0, 0.8, 201), a=a).max())
        errors.append(path_errors(path, exact, WINDOW, size))
    return _limit_row(
        "massless-string", _MASSLESS, method, "mass ratio", [f"mass ratio {mu:g}" for mu in ratios], list(ratios),
        errors, 1.0, "the string's own inertia is 1/(mass ratio) of the moving one",
    )  # fmt: skip


_MASSLESS = "limit of a heavy slow mass"


def small_sag_row(model: str, method: str, *, heavier: bool) -> Row:
    """Hold a model against the taut string as its sag vanishes at fixed speed, mass ratio and stiffness."""
    mu, alpha, V, sags = 0.7, 323.0, 0.45, (0.02, 0.01, 0.005)
    errors = []
    for sigma in sags:
        g = sigma * (1.0 + V * V) if heavier else sigma
        ride = moving_mass.solve(moving_mass.constant_speed(V), mu=mu, sigma=g)
        groups = _groups(mu, sigma, ConstantSpeed(speed=V).motion(1.0), alpha)
        size = float(ride.path(np.linspace(0.0, WINDOW[1] / V, 501)).max())
        path = _model_path(groups, model, method)
        errors.append(path_errors(path, ride.path, WINDOW, size))
    return _limit_row(
        "moving-mass", _sag_case(model, heavier), method, "sag", [f"sigma {x:g}" for x in sags],
        [1.0 / x for x in sags], errors, 2.0, "the tension that the sag adds goes like alpha sigma²",
        "agree" if heavier else "disagree",
    )  # fmt: skip


def _sag_case(model: str, heavier: bool) -> str:
    return f"limit of small sag, model {model}, " + ("g (1 + V²)" if heavier else "plain g instead of g (1 + V²)")


def _model_path(groups: Groups, model: str, method: str) -> Path_:
    fine: dict[str, Any] = {"elements": 12, "steps": 800} if method == "following-p2" else {"terms": 20, "steps": 1000}
    m = find(method)
    system: Any = m.build(groups, m.settings(fine), model=model, load="mass", law="elastic")
    states = []
    for x in newmark.integrate(system, newmark.scheme("trapezoidal"), newmark.step_times(system, fine["steps"])):
        states.append(x)
        if system.motion.at(x.t, x.phase)[0] > WINDOW[1]:
            break
    stacked = States(*(np.array([getattr(x, name) for x in states]) for name in ("t", "q", "v", "a", "phase")))
    seen = system.observe(stacked, np.zeros(0), np.zeros(0, np.intp))
    return stacked.t, system.motion.position(stacked.t), seen.path[:, 1]


def _limit_tasks() -> list[Task]:
    best = ("following-p2", "fourier-kink")
    found = [Task("massless-string", _MASSLESS, m, partial(massless_row, m)) for m in best]
    for model in ("sagged", "stretching", "full"):
        for method in best:
            compute = partial(small_sag_row, model, method, heavier=True)
            found.append(Task("moving-mass", _sag_case(model, True), method, compute))
    twin = partial(small_sag_row, "stretching", "following-p2", heavier=False)
    found.append(Task("moving-mass", _sag_case("stretching", False), "following-p2", twin))
    return found


# --- frequencies ----------------------------------------------------------------------------------------------------

_PAPER = Groups(mu=0.0, alpha=844.416, sigma=0.1688832, c=0.0844416, chord_cos=1.0, chord_sin=0.0, motion=None)
COUNT = 4
_MODES: dict[str, tuple[tuple[int, ...], float, str]] = {
    "P2 elements": ((10, 20, 40), 4.0, "twice the degree: frequencies are stationary values"),
    "sines": ((10, 20, 40), 3.0, "coefficients of symmetric modes fall like 1/n³ against sines' own ends"),
    "wavelets": ((0, 1, 2), 3.0, "db4 reproduces cubics: three orders at least"),
}


def frequencies(basis: str, n: int, model: str, groups: Groups = _PAPER) -> Array:
    """Return the first frequencies of a solver: n elements, sines, or levels of wavelets."""
    if basis == "P2 elements":
        from cablefem.elements.modes import bare_frequencies as of_elements

        return of_elements(groups, elements=n, degree=2, model=model, n=COUNT)
    from galerkin.bases import Daubechies, Fourier
    from galerkin.modes import bare_frequencies

    chosen: Any = Fourier(n) if basis == "sines" else Daubechies(order=4, level=n, reading="literal")
    return bare_frequencies(groups, chosen, model=model, n=COUNT)


def frequency_row(oracle: str, case: str, basis: str, model: str, exact: Array) -> Row:
    """Climb a basis's ladder and hold the first frequencies against the exact ones."""
    values, p, because = _MODES[basis]
    omega = [frequencies(basis, n, model) for n in values]
    sizes = [float(7 * 2**n + 3) if basis == "wavelets" else float(n) for n in values]
    errors = [float(np.abs(w / exact - 1.0).max()) for w in omega]
    credited = min(p, CREDITED_SPACE_ORDER)
    gap = float(np.abs(omega[-2] / omega[-1] - 1.0).max())
    allowed = SAFETY * gap / ((sizes[-1] / sizes[-2]) ** credited - 1.0) + ROUNDING
    observed = order(sizes, errors)
    told = f"own error bar: {SAFETY} x gap to the one before / (ratio to the {credited:g} - 1), and rounding"
    word = "level" if basis == "wavelets" else "terms" if basis == "sines" else "elements"
    return Row(
        oracle, case, basis, [f"{word} {n}" for n in values], "resolution", sizes, errors, errors[-1], errors[-1],
        observed, p, because, allowed, told, judge(errors[-1], allowed, observed, p), "agree",
    )  # fmt: skip


def inextensible_row(basis: str) -> Row:
    """Hold ever stiffer cables against the one that cannot stretch."""
    exact, stiff = inextensible.frequencies(COUNT), (1.6e5, 6.4e5, 2.56e6)
    errors = []
    for alpha in stiff:
        omega = frequencies(basis, 120, "sagged", replace(_PAPER, alpha=alpha))
        error = float(np.abs(omega / exact - 1.0).max())
        errors.append((error, error))
    return _limit_row(
        "inextensible", _STIFF, basis, "stiffness", [f"alpha {x:g}" for x in stiff], list(stiff), errors, 1.0,
        "the stretching that is left is 1/L²",
    )  # fmt: skip


_STIFF = "limit of a stiff cable, model sagged"


def _frequency_tasks() -> list[Task]:
    found = []
    for basis in _MODES:
        flat = irvine.frequencies(irvine.parameter(_PAPER.sigma, _PAPER.alpha), COUNT)
        case = "first four, model sagged"
        found.append(Task("irvine", case, basis, partial(frequency_row, "irvine", case, basis, "sagged", flat)))
    for basis in ("P2 elements", "sines"):
        found.append(Task("inextensible", _STIFF, basis, partial(inextensible_row, basis)))
    for basis in _MODES:
        case = "first four, model full"
        exact = catenary_modes.solve(_PAPER.sigma, _PAPER.alpha, _PAPER.c, count=COUNT).omega
        found.append(
            Task("catenary-modes", case, basis, partial(frequency_row, "catenary-modes", case, basis, "full", exact))
        )
    return found


# --- the jump at the mass -------------------------------------------------------------------------------------------

_JUMPS: dict[str, tuple[str, tuple[int, ...], tuple[int, ...]]] = {
    "following-p1": ("elements", (10, 20, 40), (400, 800, 1600)),
    "following-p2": ("elements", (10, 20, 40), (500, 1000, 2000)),
    "fourier-kink": ("terms", (8, 16, 32), (400, 800, 1600)),
}


def jump_row(method: str, *, flux: bool) -> Row:
    """Hold runs of the full model against the jump of force at the mass; without the cable's momentum flux it fails."""
    scene = Scene.load("level")
    assert scene.mass is not None
    knob, values, steps = _JUMPS[method]
    errors = []
    for x, n in zip(values, steps, strict=True):
        settings: dict[str, Any] = {knob: x, "steps": n}
        r = run(scene, method, until=WINDOW[1], **settings)
        rho = scene.cable.mass_per_length if flux else 0.0
        defect = measures.jump_defect(r, scene.mass.mass, rho, scene.gravity)[measures.inside(r, WINDOW)]
        size = np.hypot(defect[:, 0], defect[:, 1]) / (scene.mass.mass * scene.gravity)
        errors.append((float(size.max()), float(np.sqrt(np.mean(size**2)))))
    ladder = [_told({knob: x, "steps": n}) for x, n in zip(values, steps, strict=True)]
    return _limit_row(
        "jump-law", _jump_case(flux), method, "resolution", ladder, [float(x) for x in values], errors, 1.0,
        "slopes at the mass, and with them tensions, are worth one order", "agree" if flux else "disagree",
    )  # fmt: skip


def _jump_case(flux: bool) -> str:
    return "force and momentum at the mass, model full" + ("" if flux else ", without the cable's momentum flux")


def _jump_tasks() -> list[Task]:
    found = [Task("jump-law", _jump_case(True), m, partial(jump_row, m, flux=True)) for m in _JUMPS]
    twin = partial(jump_row, "following-p2", flux=False)
    return [*found, Task("jump-law", _jump_case(False), "following-p2", twin)]
