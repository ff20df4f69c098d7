"""The numbers that claims.toml speaks of, by name, each with its bar where it has one."""

import math
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cablefem.response import Response, write_json
from galerkin.abscissa import PositionAbscissa
from galerkin.bases import Basis
from galerkin.bases.daubechies import Daubechies
from galerkin.bases.fourier import Fourier
from galerkin.equations import GalerkinSystem
from galerkin.modes import bare_frequencies
from validation.commands.paper import gibbs, vibration
from validation.commands.paper import measured as m
from validation.commands.paper.runs import SAID, Reference, Runs
from validation.commands.paper.verdicts import Value
from validation.core import measures, store
from validation.oracles import catenary_modes, irvine

MOVING = (0.1, 0.8)  # s_o/l over which tensions are looked at
PATH = measures.WINDOW
FAR = 0.2  # |s - s_o|/l from which on an oscillation is not "local"
END = 0.99  # s_o/l up to which the inclined cable's lowest point is looked for
STRAIGHT = store.shipped(__package__, "claims.toml")["meaning"]["straight"][0]


def stored(runs: Runs, file: Path) -> dict[str, Any]:
    """Return what the claims need beyond runs: figure 2, the overshoot beside the mass, energy in free vibration.

    file : where they are kept, and found again if scenes and settings are the same.
    """
    level, inclined = runs.scenes["level"], runs.scenes["inclined"]
    key = [level.to_toml(), inclined.to_toml(), SAID["overshoot"], SAID["vibration"]]
    coarse, fine = SAID["vibration"]["coarse_steps"], SAID["vibration"]["fine_steps"]
    if kept := store.stored(file, key=key):
        return dict(kept["numbers"])
    g = level.groups
    new = {
        "frequencies": figure_2(runs),
        "overshoot": {method: [asdict(x) for x in rows] for method, rows in gibbs.overshoots(inclined.groups).items()},
        "vibration": {
            "coarse": vibration.energy_ratio(g, coarse),
            "fine": vibration.energy_ratio(g, fine),
            "kept": vibration.energy_ratio(g, coarse, "energy"),
        },
    }  # fmt: skip
    write_json(file, {"key": key, "numbers": new})
    return new


def figure_2(runs: Runs) -> dict[str, Any]:
    """Return omega_1 against the number of terms in both bases, with the exact and the linear theory's value."""
    groups = runs.scenes["level"].groups
    exact = catenary_modes.solve(groups.sigma, groups.alpha, groups.c, count=10)
    wavelets = [Daubechies(order=4, level=level, reading="literal") for level in range(4)]
    sines = [Fourier(n) for n in (*range(1, 21), 24, 30, 40, 59)]
    bases: dict[str, list[Basis]] = {"fourier": [*sines], "wavelet": [*wavelets]}
    ten: dict[str, Basis] = {"fourier 30": Fourier(30), "wavelet 31": wavelets[2]}
    return {
        name: {"terms": [b.n for b in of], "omega_1": [float(bare_frequencies(groups, b, n=1)[0]) for b in of]}
        for name, of in bases.items()
    } | {
        "exact": float(exact.omega[0]), "linear_theory": linear_theory(groups.sigma, groups.alpha),
        "first_ten": {"exact": exact.omega.tolist()}
        | {name: bare_frequencies(groups, basis, n=10).tolist() for name, basis in ten.items()},
    }  # fmt: skip


def linear_theory(sigma: float, alpha: float) -> float:
    """Return Irvine and Caughey's first frequency of a level cable."""
    return float(irvine.frequencies(irvine.parameter(sigma, alpha), 1)[0])


def wu_and_chen(runs: Runs) -> list[dict[str, Any]]:
    """Return every turning point of the path at mu = 1 and 2, in both readings, with bars."""
    rows = []
    for scene, mu in (("level", 1), ("heavy", 2)):
        reference, paper = runs.reference[scene], runs[f"{scene}-fourier-30"]
        for reading in m.READINGS:
            for near, kind, _ in m.extrema(reference.run, reading):
                place = partial(m.place_of, reading=reading, near=near, kind=kind)
                value, bar = reference.measured(place)
                rows.append({
                    "mu": mu, "reading": reading, "kind": kind, "place": value, "uncertainty": bar,
                    "fourier_30": place(paper),
                })  # fmt: skip
    return rows


def numbers(runs: Runs, beyond: dict[str, Any]) -> dict[str, Any]:
    """Return every number of claims.toml by its name; beyond : of `stored`."""
    found: dict[str, Any] = {}
    for part in (
        _scenes(runs, beyond["frequencies"]), _level_path(runs), _level_tension(runs), _cruise(runs), _inclined(runs),
        _more_terms(runs, beyond["overshoot"]), _errata(runs), _time(runs, beyond["vibration"]),
    ):  # fmt: skip
        found |= part
    return found


# --- what most of them are ------------------------------------------------------------------------------------------

Number = Callable[[Response], float]


def _converged(reference: Reference, f: Number, paper: Response | None = None) -> Value:
    """Return a number of the true motion."""
    return Value(*reference.measured(f), None if paper is None else f(paper))


def _readings(reference: Reference, f: Callable[[Response, str], float], paper: Response) -> dict[str, Value]:
    """Return a number of the true path in both readings of "path"."""
    return {reading: _converged(reference, lambda r, x=reading: f(r, x), paper) for reading in m.READINGS}  # type: ignore[misc]


def _own(x: float, *others: float) -> Value:
    """Return a number of a basis of so many terms itself; others : with what the paper leaves open chosen otherwise."""
    return Value(x, max((abs(x - y) for y in others), default=0.0), x)


def _apart(a: Response, b: Response) -> float:
    return measures.path_gap(a, b, PATH)[0]


def _tension_error(reference: Reference, r: Response, window: tuple[float, float] = MOVING) -> float:
    """Return the rms error of the tension off the mass, over H."""
    return m.ripple(r, reference.run, measures.JUMP_WIDTH, 1.0, window)


# --- 7.1, figures 2 to 4 --------------------------------------------------------------------------------------------


def _scenes(runs: Runs, frequencies: dict[str, Any]) -> dict[str, Any]:
    level = runs.scenes["level"]
    g, exact = level.groups, frequencies["exact"]
    omega = {
        name: dict(zip(frequencies[name]["terms"], frequencies[name]["omega_1"], strict=True))
        for name in ("fourier", "wavelet")
    }
    ten = np.array(frequencies["first_ten"]["exact"])
    return {
        "alpha": g.alpha, "exact": exact, "linear": Value(linear_theory(g.sigma, g.alpha), 1e-9),
        "rounded_linear": Value(linear_theory(g.sigma, 844.0), 1e-9), "sigma": Value(g.sigma, 1e-9),
        "span_over_sag": Value(1.0 / level.sag_ratio), "top_speed": Value(runs.scenes["cruise"].speed_ratio or 0.0),
        "few_terms": {
            f"{name} N = {n}": Value(omega[name][n] / exact - 1.0)
            for name, n in (("fourier", 10), ("wavelet", 10), ("wavelet", 17))
        },
        "first_ten": {
            name: Value(float(np.abs(np.array(frequencies["first_ten"][name]) / ten - 1.0).max()))
            for name in ("fourier 30", "wavelet 31")
        },
    }  # fmt: skip


def _level_path(runs: Runs) -> dict[str, Any]:
    level, heavy = runs.reference["level"], runs.reference["heavy"]
    F, W, heavy_F = runs["level-fourier-30"], runs["level-wavelet-31"], runs["heavy-fourier-30"]
    V, mu = runs.scenes["level"].speed_ratio or math.nan, runs.scenes["level"].mu
    return {
        "upward_turn": _readings(level, lambda r, x: m.place_of(r, x, 0.655, "min"), F),
        "deepest": _readings(level, m.place_of_largest, F),
        "sines_error": Value(_apart(F, level.run), _apart(level.cross, level.run), _apart(F, level.run)),
        "heavy_turn": _readings(heavy, lambda r, x: m.place_of(r, x, 0.8), heavy_F),
        "light_turn": _readings(level, lambda r, x: m.place_of(r, x, 0.8), F),
        "light_upward": m.place_of(level.run, "y + v", 0.68, "min"),
        "heavy_slack": heavy.run.slack_onset or math.nan, "meeting": _converged(level, m.meeting, F),
        "static_meeting": 2.0 * V / (1.0 + V),
        # mass on a taut string, an incoming wave of frequency w as the moving mass feels it: mu G.. + 2 G. = 2 F.
        "transmitted": Value(1.0 / math.hypot(1.0, 0.5 * mu * (1.0 + V) * math.pi)),
        "bases_apart": _own(_apart(W, F)), "level_F_error": _apart(F, level.run), "level_W_error": _apart(W, level.run),
    }  # fmt: skip


def _level_tension(runs: Runs) -> dict[str, Any]:
    level, F, W = runs.reference["level"], runs["level-fourier-30"], runs["level-wavelet-31"]
    undamped, overdamped = runs["level-wavelet-31-undamped"], runs["level-wavelet-31-overdamped"]
    uneven = m.unevennesses(level.run, *MOVING)
    line = {
        name: m.unevenness(r, *MOVING, width=FAR)
        for name, r in {
            "wavelet": W, "undamped": undamped, "overdamped": overdamped, "sines": runs["level-fourier-30-overdamped"],
            "true": level.run,
        }.items()
    }  # fmt: skip
    wiggle = {
        name: m.wiggle(r, FAR, 1.0, MOVING)
        for name, r in {"sines": F, "wavelet": W, "undamped": undamped, "true": level.run, "cross": level.cross}.items()
    } | {"beside": m.wiggle(W, 0.02, 0.1, MOVING)}
    error = {
        name: _tension_error(level, r) for name, r in {"wavelet": W, "sines": F, "cross": level.cross}.items()
    }  # fmt: skip
    halves = [_tension_error(level, W, w) / _tension_error(level, F, w) for w in ((0.1, 0.45), (0.45, 0.8))]
    better, local = error["wavelet"] / error["sines"], wiggle["wavelet"] / wiggle["sines"]
    oscillate = wiggle["sines"] / wiggle["true"]

    onset = level.run.slack_onset or math.nan
    before_slack, met = math.floor(100.0 * onset) / 100.0, math.floor(100.0 * m.meeting(level.run)) / 100.0
    place, median = m.tension_level(level.run)

    def extreme(sign: float, low: float, high: float) -> tuple[float, float]:
        i = np.argmax(np.where((place >= low) & (place <= high), sign * median, -np.inf))
        return float(place[i]), float(median[i])

    def plateau(r: Response) -> float:
        return float(m.tension_level(r)[1][m.frames(r, 0.25, met)].mean())

    return {
        "far_line": line, "straight_lines": _own(line["wavelet"], line["undamped"], line["overdamped"]),
        "overdamped_error": _apart(overdamped, level.run), "wiggle": wiggle,
        "local_oscillation": _own(local, wiggle["undamped"] / wiggle["sines"]),
        "level_unevenness": _converged(level, lambda r: m.unevenness(r, *MOVING), W),
        "even_instants": float(np.mean(uneven <= STRAIGHT)), "most_uneven": float(uneven.max()),
        "sines_oscillate": Value(oscillate, 0.5 * abs(wiggle["cross"] / wiggle["true"] - 1.0), oscillate),
        "tension_error": error,
        "wavelets_over_sines": Value(
            better, max(0.5 * abs(halves[1] - halves[0]), error["cross"] / error["sines"]), better
        ),
        "highest": _converged(level, m.highest_tension, F), "highest_at": extreme(1.0, 0.0, 0.5)[0],
        "plateau": _converged(level, plateau, F), "plateau_ends": (0.25, met),
        "low": extreme(-1.0, 0.5, 0.7), "top": extreme(1.0, 0.6, 0.72), "slack": onset, "before_slack": before_slack,
        "tension_spread": _converged(level, lambda r: m.tension_spread(r, 0.5, before_slack), W),
    }  # fmt: skip


# --- figures 6 to 10 ------------------------------------------------------------------------------------------------


def _cruise(runs: Runs) -> dict[str, Any]:
    cruise, level = runs.reference["cruise"], runs.reference["level"]
    paper = runs["cruise-fourier-30"], runs["level-fourier-30"]

    def depth(reading: str) -> Value:
        a, b = (x.measured(lambda r: m.largest(r, reading)) for x in (cruise, level))
        ratio = a[0] / b[0]
        return Value(
            ratio, ratio * (a[1] / a[0] + b[1] / b[0]), m.largest(paper[0], reading) / m.largest(paper[1], reading)
        )

    return {
        "cruise_deepest": _readings(cruise, m.place_of_largest, paper[0]),
        "depths": {reading: depth(reading) for reading in m.READINGS},
    }


def _inclined(runs: Runs) -> dict[str, Any]:
    inclined, scene = runs.reference["inclined"], runs.scenes["inclined"]
    F, W, overdamped = (runs[f"inclined-{x}"] for x in ("fourier-10", "wavelet-10", "wavelet-10-overdamped"))
    static = float(
        np.ptp(scene.catenary.tension(np.linspace(0.0, scene.length, 201))) / scene.horizontal_tension
    )  # fmt: skip
    depth, gap = m.largest(inclined.run, "y + v", END), _apart(W, F)
    turns = [m.turns(F, MOVING) / m.turns(x, MOVING) for x in (W, overdamped)]
    larger = [_tension_error(inclined, F) / _tension_error(inclined, x) for x in (W, overdamped)]
    jump = _converged(inclined, lambda r: m.tension_jump(r, *MOVING))
    motion = scene.groups.motion
    assert motion is not None
    return {
        "lowest": _converged(inclined, lambda r: m.place_of_largest(r, "y + v", END), F),
        "static_variation": _own(static), "ten_apart": _own(gap), "inclined_depth": depth,
        "ten_apart_plotted": _own(gap * inclined.run.max_deflection / depth),
        "inclined_F_error": _apart(F, inclined.run), "inclined_W_error": _apart(W, inclined.run),
        "ten_turns": {"sines": m.turns(F, MOVING), "wavelet": m.turns(W, MOVING)},
        "sines_more": _own(*turns), "sines_larger": _own(*larger), "overdamped_ratios": (turns[1], larger[1]),
        "jump": jump, "jump_size": Value(abs(jump.value), jump.bar),
        "drive": scene.groups.mu * motion.at(0.0, 0)[2],
        "inclined_unevenness": _converged(inclined, lambda r: m.unevenness(r, *MOVING, sides=True)),
        "ten_uneven": {
            name: m.unevenness(r, *MOVING, sides=True) for name, r in (("sines", F), ("wavelet", W))
        },
    }  # fmt: skip


def _more_terms(runs: Runs, beside: dict[str, list[dict[str, float]]]) -> dict[str, Any]:
    def falls(method: str, to: int) -> tuple[float, float]:
        """Exponent with which the overshoot falls from N = 10 to the entry `to` of the ladder, and its bar."""
        first, last = beside[method][0], beside[method][to]
        steps = math.log(last["terms"] / first["terms"])
        bar = math.hypot(first["spread"] / first["size"], last["spread"] / last["size"]) / steps
        return math.log(first["size"] / last["size"]) / steps, bar

    inclined = runs.reference["inclined"]
    names = ("wavelet-10", "wavelet-17", "wavelet-17-coarser", "fourier-10", "fourier-17")
    error = {name: _tension_error(inclined, runs[f"inclined-{name}"]) for name in names}
    turns = {n: m.turns(runs[f"inclined-fourier-{n}"], MOVING) for n in (10, 17, 59)}
    return {
        "inclined_tension": error,
        "seventeen_over_ten": _own(*(error[f"wavelet-17{x}"] / error["wavelet-10"] for x in ("", "-coarser"))),
        "beside": {
            method: ", ".join(f"{x['size']:.3f} (N = {x['terms']})" for x in rows) for method, rows in beside.items()
        },
        **{f"{method}_rate": Value(*falls(method, -1), falls(method, 1)[0]) for method in ("wavelet", "fourier")},
        "turns": turns, "more_turns": Value(turns[59] / turns[10], 0.0, turns[17] / turns[10]),
    }  # fmt: skip


# --- formulas and time integration ----------------------------------------------------------------------------------


def _errata(runs: Runs) -> dict[str, Any]:
    R, p = 7, 4
    inclined, scene = runs.reference["inclined"], runs.scenes["inclined"]
    rising = [m.place_of_largest(runs[f"rising-following{x}"], "y + v", END) for x in ("", "-coarser")]

    def unaccounted(r: Response, whole: bool) -> float:
        """Energy that appears from nowhere, over weight times largest displacement, with and without M g y(s_o)."""
        assert scene.mass is not None
        weight = scene.mass.mass * scene.gravity
        defect = measures.energy_defect(r) + (0.0 if whole else weight * (r.y - r.v))
        return float(np.abs(defect[measures.inside(r, PATH)]).max() / (weight * r.max_deflection))

    return {
        "rising_lowest": Value(rising[0], abs(rising[0] - rising[1])),
        "counts": {level: Value(Daubechies(order=p, level=level, reading="literal").n) for level in (0, 1)},
        "printed_counts": {level: 2 ** (level + 1) * R + R - p for level in (0, 1)},
        "arrival_42": Value(float(R)), "lacking_energy": _converged(inclined, lambda r: unaccounted(r, False)),
        "whole_account": unaccounted(inclined.run, True),
    }  # fmt: skip


def _time(runs: Runs, swing: dict[str, float]) -> dict[str, Any]:
    starts = [_start_of_48(runs, d) for d in (1e-10, 1e-9)]

    def gap(a: str, b: str) -> float:
        return _apart(runs[f"inclined-{a}"], runs[f"inclined-{b}"])

    halves = {b: gap(f"{b}-17-coarser", f"{b}-17") for b in ("fourier", "wavelet")}
    return {
        "swing": swing | SAID["vibration"],
        "largest_energy": Value(swing["coarse"]), "later_start": _start_of_48(runs, 1e-7),
        "start_48": Value(starts[0], abs(starts[0] - starts[1])),
        "forms_apart": Value(gap("fourier-10-position", "fourier-10-fine"), halves["fourier"] / 3.0),
        "half_steps": {b: _own(x) for b, x in halves.items()},
        "any_steps": Value(gap("wavelet-17-any-step", "wavelet-17"), halves["wavelet"]),
    }  # fmt: skip


def _start_of_48(runs: Runs, d: float) -> float:
    """Return how far (48) is from the g'' that balances (45) at s_o = d, relative, for ten sines."""
    groups = runs.scenes["inclined"].groups
    system = GalerkinSystem(groups, Fourier(10))
    position = PositionAbscissa(system)
    assert groups.motion is not None
    a = groups.motion.at(0.0, 0)[2]
    _, xp, yp, _, _ = groups.static(np.zeros(1))
    slope = system.basis.basis.phi(np.zeros(1), 1)[0]
    pull = np.array([a * xp[0], a * yp[0] - groups.sigma])
    printed = np.linalg.solve(system.basis.basis.mass(), -groups.mu * np.outer(slope, pull)).T.ravel() / (3.0 * a)
    balanced = position.second_order(np.zeros(system.n_dof), d)
    return float(np.linalg.norm(balanced - printed) / np.linalg.norm(printed))
