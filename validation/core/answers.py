"""How a run ends, and where the rope hangs.  Depths are in metres below the left support."""

import math
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cablefem.response import Array, Response, write_csv, write_json
from cablefem.scene import Scene
from validation.core import limits
from validation.core.clearances import rope_and_mass_at_frames
from validation.core.design import axial_round_trip_time, design_numbers
from validation.core.measures import (
    broke_in_compared_part,
    last_time_valid_in_all,
    relative_position_where_mass_outruns_waves,
    relative_slack_onset_before_far_support,
)

STATIONS = 201  # stations of profile.csv


def crosswind_load_factor(scene: Scene) -> float | None:
    """Load of the rope across and down over its weight, sqrt(q^2 + w^2)/q; None without wind across the line.

    q, w : weight of the rope and mean force of the wind on it [N/m].
    """
    q = scene.catenary.weight
    w = scene.crosswind_force_per_length
    return math.hypot(q, w) / q if w else None


def crosswind_scope_text(scene: Scene, model: str) -> str:
    """What the numbers of a run by a model hold of the wind across the line, and what not; "" without it."""
    factor = crosswind_load_factor(scene)
    if factor is None or scene.wind is None:
        return ""
    loads = f"with {scene.crosswind_force_per_length:.4g} N/m across and {scene.catenary.weight:.4g} N/m down"
    holds = "nothing of it" if model == "quasi-static" else "only how it damps the rope"
    left_out = f"Its force on rope and car is left out: {loads} the rope's load is {factor:.3f} times its weight"
    return f"wind of {scene.wind.across:.4g} m/s across the line: the numbers hold {holds}. {left_out}"


def averaging_time_sentence(r: Response) -> str:
    """Over what forces, angles and a free car's decelerations among the design numbers are means."""
    kinds = "forces, decelerations" if r.drive == "free" else "forces"
    round_trip = axial_round_trip_time(r.scene_toml, r.length)
    return f"{kinds} and angles of the rope are means over an axial round trip, {round_trip:.2g} s"


ONE_SPAN_OUTCOMES = (
    "breaks", "arrives", "stopped_by_brake", "stuck", "rolls_back", "rolling", "crossed", "stopped", "incomplete",
)  # fmt: skip
LINE_OUTCOMES = (
    "breaks", "collides", "carries", "ends", "arrives", "stopped_by_brake", "stuck", "rolls_back", "rolling",
    "incomplete",
)  # fmt: skip


class Outcome(NamedTuple):
    """How a run ends, in one word and in a sentence."""

    kind: str  # of ONE_SPAN_OUTCOMES or LINE_OUTCOMES
    sentence: str


def outcome_of_run(scene: Scene, r: Response) -> Outcome:
    """What becomes of a run, free or prescribed.

    First a rope that breaks, then what is hit, then how the car's motion ends.
    """
    needs_numbers = scene.cable.breaking_load or scene.obstacle or scene.ground
    numbers = {row["quantity"]: row for row in r.design or design_numbers(r)} if needs_numbers else {}
    end = _outcome_of_motion(scene, r)
    sentence = "; ".join([*_hit_or_too_close_sentences(numbers), end.sentence])
    load = scene.cable.breaking_load
    safety = numbers.get("safety_factor_min")
    if load is None or safety is None:
        return Outcome(end.kind, sentence)
    smallest, largest = _range_by_error_bar(safety)
    if smallest >= 1.0:
        return Outcome(end.kind, sentence)
    if largest >= 1.0:
        return Outcome(end.kind, f"too close to tell whether the rope breaks; {sentence}")
    tension = numbers["tension_max"]["value"] / 1e3
    broken = f"the rope breaks: {tension:.1f} kN, breaking load {load / 1e3:.1f} kN; if it held"
    return Outcome("breaks", f"{broken}: {sentence}")


def _range_by_error_bar(number: dict[str, Any]) -> tuple[float, float]:
    """Smallest and largest possible value of a design number, by its error bar."""
    bar = number["bar"] or 0.0
    return number["value"] - bar, number["value"] + bar


def _hit_or_too_close_sentences(numbers: dict[str, dict[str, Any]]) -> list[str]:
    """What rope or car would hit, and what is closer than its error bar."""
    ranges: dict[str, Any] = {}  # of each obstacle: smallest and largest possible clearance of rope and car
    for quantity, number in numbers.items():
        kind, _, name = quantity.partition(":")
        if kind.startswith("clearance_") and number["value"] is not None:
            ends = _range_by_error_bar(number)
            ranges[name] = np.minimum(ranges.get(name, ends), ends).tolist()
    hit = [name for name, (_, largest) in ranges.items() if largest < 0.0]
    near = [name for name, (smallest, largest) in ranges.items() if smallest < 0.0 <= largest]
    sentences = []
    if hit:
        sentences.append(f"would hit {' and '.join(hit)}")
    if near:
        sentences.append(f"too close to tell whether it clears {' and '.join(near)}")
    return sentences


def _outcome_of_motion(scene: Scene, r: Response) -> Outcome:
    """How the car's motion ends, free or prescribed."""
    if broke_in_compared_part(r):
        broke = f"the computation broke at {r.s_o[-1]:.1f} m after {r.t[-1]:.1f} s: {r.reason}"
        return Outcome("incomplete", broke)
    end = _outcome_of_free_ride(scene, r) if r.drive == "free" else _outcome_of_prescribed_travel(scene, r)
    first = next((event for event in r.events if event["event"] == "lift_off"), None)
    if first is None:
        return end
    lifts_off = f"the car lifts off at {first['s_o']:.1f} m after {first['t']:.1f} s"
    return Outcome(end.kind, f"{lifts_off}; if it were held down: {end.sentence}")


def _outcome_of_prescribed_travel(scene: Scene, r: Response) -> Outcome:
    """Whether the travel of the scene crosses, stops or is hauled, and from where on no answer is valid."""
    # past the slack onset nothing is compared
    motion = scene.groups.motion
    assert motion is not None
    duration = motion.time_at_position(motion.end_position) * scene.time_scale  # without the rest after it
    end = scene.length if r.drive == "grip" else scene.drive.end_position(scene.length)
    last = motion.end_position * scene.length
    kind = "crossed"
    sentence = f"crosses the cable in {duration:.1f} s"
    if last < 0.999 * end:
        kind = "stopped"
        sentence = f"stops at {last:.1f} m after {duration:.1f} s"
    elif r.drive == "haul":
        sentence = f"is hauled from {r.s_o[0]:.1f} m to {last:.1f} m in {duration:.1f} s"
    if r.status != "complete" and math.isinf(relative_slack_onset_before_far_support(r)):
        sentence += f"; the computation ends at {r.s_o[-1]:.1f} m, past what is compared"
    return Outcome(kind, sentence + _slack_or_slow_waves_clause(r))


def _slack_or_slow_waves_clause(r: Response) -> str:
    """From where the cable is slack, or waves are slower than the mass, to be added to a sentence; "": nowhere."""
    steep = relative_position_where_mass_outruns_waves(r)
    onset = relative_slack_onset_before_far_support(r)
    if math.isfinite(onset) and onset <= steep:
        return f"; the cable goes slack when the mass is at {onset * r.length:.1f} m"
    if math.isfinite(steep):
        return f"; waves get slower than the mass when it is at {steep * r.length:.1f} m, no bar holds there"
    return ""


def _outcome_of_free_ride(scene: Scene, r: Response) -> Outcome:
    """Where and when a free car arrives, stops, rolls back or is when the run ends."""
    events = {e["event"]: e for e in r.events}  # the last of each kind
    ends = [events[name] for name in ("arrival", "back", "stop") if name in events]
    if not ends:
        rolls = f"still rolls after {r.t[-1]:.1f} s, at {r.s_o[-1]:.1f} m with {3.6 * r.speed[-1]:.1f} km/h"
        return Outcome("rolling", rolls)
    end = ends[0]
    s_o = end["s_o"]
    first_brake = min((brake.position for brake in scene.drive.brake), default=math.inf)
    at = f"at {s_o:.1f} m"
    after = f"after {end['t']:.1f} s"
    if end["event"] == "arrival":
        return Outcome("arrives", f"arrives {at} {after} with {3.6 * end['speed']:.1f} km/h")
    farthest = f"the farthest point is {r.s_o.max():.1f} m"
    if end["event"] == "back":
        return Outcome("rolls_back", f"rolls back to the start {after}, {farthest}")
    if s_o >= first_brake:
        return Outcome("stopped_by_brake", f"stops in the brake {at}, {s_o - first_brake:.1f} m into it, {after}")
    if "brake" in events:
        return Outcome("stuck", f"reaches the brake and rolls back: comes to rest {at} {after}, {farthest}")
    if math.isfinite(first_brake):
        before = f"{first_brake - s_o:.1f} m before it"
        return Outcome("stuck", f"never reaches the brake: comes to rest {before}, {at}, {after}, {farthest}")
    return Outcome("stuck", f"gets stuck: comes to rest {at} {after}, {farthest}")


def profile_columns(r: Response) -> dict[str, Array]:
    """Columns of profile.csv: the rope at rest, and the extremes of depth and tension up to a slack onset."""
    f = r.fields
    end = last_time_valid_in_all(r)
    x = np.linspace(float(f.x[0]), float(f.x[-1]), STATIONS)
    rest = np.interp(x, f.x, f.y)
    depth = [rest]
    tension = [np.interp(x, f.x, f.T_static)]
    rope = rope_and_mass_at_frames(r)
    for k in range(np.searchsorted(f.t, end, side="right")):
        depth.append(np.interp(x, rope.x[k], rope.y[k]))
        tension.append(np.interp(x, rope.x[k], rope.tension[k]))
    lowest = np.max(depth, axis=0)
    for x_car, y_car in _path_pieces_sorted_in_x(r, end):  # between frames the car is the lowest point nearby
        inside = (x >= x_car[0]) & (x <= x_car[-1])
        y = np.interp(x[inside], x_car, y_car)
        lowest[inside] = np.maximum(lowest[inside], y)
    return {
        "x": x,
        "y_rest": rest,
        "y_highest": np.min(depth, axis=0),
        "y_lowest": lowest,
        "tension_max": np.max(tension, axis=0),
        "tension_min": np.min(tension, axis=0),
    }


def write_summary_and_profile(folder: Path, scene: Scene, r: Response) -> None:
    """Write summary.json and profile.csv."""
    end = outcome_of_run(scene, r)
    answer: dict[str, Any] = {"outcome": end.sentence, "outcome_kind": end.kind}
    judged = limits.limit_rows(scene, r.design, r.events)
    if judged:
        answer["limits"] = judged
    write_json(folder / "summary.json", answer | r.summary())
    write_csv(folder / "profile.csv", profile_columns(r))


def _path_pieces_sorted_in_x(r: Response, end_time: float) -> Iterator[tuple[Array, Array]]:
    """Points x, y of the car up to a time [s], in pieces between its turns, each in order of rising x."""
    x = r.x[r.t <= end_time]
    y = r.y[r.t <= end_time]
    directions = np.sign(np.diff(x))
    turns = np.flatnonzero(np.diff(directions) != 0) + 1
    for i, j in pairwise([0, *turns, x.size - 1]):  # both pieces have the turn
        x_piece, y_piece = x[i : j + 1], y[i : j + 1]
        rising = x_piece[-1] > x_piece[0]
        yield (x_piece, y_piece) if rising else (x_piece[::-1], y_piece[::-1])
