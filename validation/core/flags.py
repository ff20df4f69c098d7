"""Signs of error: energy gain, hidden compression, waves slower than the mass."""

import math
from dataclasses import replace
from functools import partial

import numpy as np

from cablefem.response import Flag, Response
from cablefem.scene import Scene
from validation.core import measures, store
from validation.core.measures import SLACK_END
from validation.core.methods import Method

MAX_GAIN = 0.2  # of the energy's range; right runs gain 0.12, wrong ones 0.6
TEXTS = store.read_packaged_toml(__package__, "flags.toml")


def make_flag(kind: str, **numbers: float | str) -> Flag:
    """A flag of a kind in flags.toml with its numbers; KeyError if one is missing."""
    made = Flag(kind, TEXTS[kind], numbers)
    str(made)  # raises if a number is missing
    return made


def with_flag(r: Response, kind: str, **numbers: float | str) -> Response:
    """The response with one more flag; see `make_flag`."""
    return replace(r, flags=[*r.flags, make_flag(kind, **numbers)])


def with_energy_gain_flags_and_cause(r: Response, scene: Scene, method: Method) -> Response:
    """The response with its energy gain before slack, and its flags; both are computed when they are looked at."""
    r = r.with_lazy_fields(
        energy_gain=partial(_energy_gain_while_taut, scene), flags=partial(_error_flags, scene, method)
    )
    if r.cause is None:
        return r
    energy = next((flag for flag in r.flags if flag.kind == "energy"), None)
    if energy is None:
        return r
    return replace(r, cause="unstable", reason=f"{energy}; it broke at s_o/l = {r.reached:.3f}")


def _taut_position_window(r: Response) -> measures.Window | None:
    """The part of the run, s_o/l, in which it is taut and comparable; None if nothing can be said of it."""
    reached = math.inf if r.drive == "free" else r.reached  # a ride may roll back
    switched = math.inf if r.switched is None else r.switched
    window = 0.0, min(measures.WINDOW[1], reached, switched)
    enough = r.t.size >= 3 and r.max_deflection > 0.0 and measures.steps_in_window(r, window).any()
    return window if enough else None


def _energy_gain_while_taut(scene: Scene, r: Response) -> float | None:
    """Relative, see `measures.max_relative_energy_gain`; None if nothing can be said."""
    taut = _taut_position_window(r)
    if taut is None:
        return None
    assert scene.mass is not None
    return measures.max_relative_energy_gain(r, scene.mass.mass * scene.gravity, taut)


def _error_flags(scene: Scene, method: Method, r: Response) -> list[Flag]:
    taut = _taut_position_window(r)
    if taut is None:
        return []
    assert scene.mass is not None
    assert r.energy_gain is not None
    weight = scene.mass.mass * scene.gravity
    energy = r.energy[measures.steps_in_window(r, taut)]
    energy_range = max(1.0, float(np.ptp(energy)) / (weight * r.max_deflection))
    flags = _slow_wave_and_compression_flags(r, scene, method)
    if scene.speed_ratio is not None and scene.speed_ratio >= 1.0:
        # V/c = 1.1: half the true error; 1.5: no convergence
        flags.insert(0, make_flag("fast", speed_ratio=scene.speed_ratio))
    if not r.energy_gain <= MAX_GAIN * energy_range:
        return [*flags, make_flag("energy", gain=r.energy_gain / energy_range, allowed=MAX_GAIN)]
    return flags + _slack_energy_flags(r, weight, energy_range)


def _slack_energy_flags(r: Response, weight: float, energy_range: float) -> list[Flag]:
    """A flag if energy is gained past the slack onset;  energy_range : over weight times deflection."""
    if r.switched is None:
        return []
    slack = r.switched, SLACK_END
    if not measures.steps_in_window(r, slack).any():
        return []
    gain = measures.max_relative_energy_gain(r, weight, slack) / energy_range
    largest = 2.0  # the same after the onset; runs that agree 1.4, others from 9
    return [] if gain <= largest else [make_flag("slack energy", gain=gain, since=r.switched)]


def _slow_wave_and_compression_flags(r: Response, scene: Scene, method: Method) -> list[Flag]:
    """Flag waves, of speed sqrt(N/rho), slower than the mass, and compression in part of an element."""
    if not method.tells_waves_from_ripples:
        return []
    before_slack = 0.03  # s_o/l from compression at a point to slack of an element; right runs 0.01
    end = min(measures.WINDOW[1], r.reached, r.slack_onset_position_or_inf - before_slack)
    within = measures.steps_in_window(r, (measures.WINDOW[0], end))
    N = r.tension_min
    margins = {}  # (n,), negative at fault
    if scene.speed_ratio is not None and scene.speed_ratio < 1.0:
        margins["slow waves"] = N - scene.rho * np.gradient(r.s_o, r.t) ** 2
    margins["hidden slack"] = N
    flags = []
    for kind, margin in margins.items():
        steps = np.flatnonzero(within & (margin < 0.0))
        if steps.size == 0:
            continue
        worst = steps[margin[steps].argmin()]
        first = steps[0]
        least = float(N[worst] / r.horizontal_tension)
        since = float(r.s_o[first] / r.length)
        flags.append(make_flag(kind, least=least, since=since, at=float(r.tension_min_at[first] / r.length)))
    return flags
