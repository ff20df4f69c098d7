"""How a ride ends, what clears what, where the rope hangs.  Depths are in metres below the left support."""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cablefem.response import Array, Response, write_csv, write_json
from cablefem.scene import Scene
from cablefem.scene.surroundings import GROUND

PLACES = 201  # stations in tension.csv


class Outcome(NamedTuple):
    kind: str  # arrives, stopped_by_brake, stuck, rolls_back, rolling, crossed, stopped, incomplete
    sentence: str


def outcome(scene: Scene, r: Response) -> Outcome:
    """How a run ends, and what rope or car would hit."""
    kind, sentence = _end(scene, r)
    hit = hits(scene, r)
    return Outcome(kind, sentence + (f"; would hit {' and '.join(hit)}" if hit else ""))


def hits(scene: Scene, r: Response) -> list[str]:
    rooms = clearances(scene, r).items()
    return list(dict.fromkeys(name for (_, name), room in rooms if np.nanmin(room.value, initial=np.inf) < 0.0))


def _end(scene: Scene, r: Response) -> tuple[str, str]:
    if r.status != "complete" and r.slack_onset is None:
        return "incomplete", f"the computation broke at {r.s_o[-1]:.1f} m after {r.t[-1]:.1f} s: {r.reason}"
    if r.drive == "free":
        return _ride(scene, r)
    # past the slack onset nothing is compared
    motion, lasts = scene.groups.motion, scene.arrival
    assert motion is not None
    assert lasts is not None
    end, last = (scene.length if r.drive == "grip" else scene.drive.end_place(scene.length)), motion.end * scene.length
    kind, said = "crossed", f"crosses the cable in {lasts:.1f} s"
    if last < 0.999 * end:
        kind, said = "stopped", f"stops at {last:.1f} m after {lasts:.1f} s"
    elif r.drive == "haul":
        said = f"is hauled from {r.s_o[0]:.1f} m to {last:.1f} m in {lasts:.1f} s"
    if r.slack_onset is not None:
        said += f"; the cable goes slack when the mass is at {r.slack_onset * r.length:.1f} m"
    return kind, said


def _ride(scene: Scene, r: Response) -> tuple[str, str]:
    events = {e["event"]: e for e in r.events}  # the last of each kind
    e = next((events[name] for name in ("arrival", "back", "stop") if name in events), None)
    if e is None:
        return "rolling", f"still rolls after {r.t[-1]:.1f} s, at {r.s_o[-1]:.1f} m with {3.6 * r.speed[-1]:.1f} km/h"
    place, first_brake = e["s_o"], min((brake.place for brake in scene.drive.brake), default=math.inf)
    at, after = f"at {place:.1f} m", f"after {e['t']:.1f} s"
    if e["event"] == "arrival":
        return "arrives", f"arrives {at} {after} with {3.6 * e['speed']:.1f} km/h"
    if e["event"] == "back":
        return "rolls_back", f"rolls back to the start {after}"
    if place >= first_brake:
        return "stopped_by_brake", f"stops in the brake {at}, {place - first_brake:.1f} m into it, {after}"
    if "brake" in events:
        return "stuck", f"reaches the brake and rolls back: comes to rest {at} {after}"
    if math.isfinite(first_brake):
        short = f"{first_brake - place:.1f} m before it"
        return "stuck", f"never reaches the brake: comes to rest {short}, {at}, {after}"
    return "stuck", f"gets stuck: comes to rest {at} {after}"


def shapes(r: Response) -> tuple[Array, Array, Array]:
    """x, y [m], tension [N] of the rope with the mass at each frame, (k, m + 1) each."""
    f = r.fields
    x, y = f.x + f.u, f.y + f.v
    mass = np.array([np.interp(f.s_o, f.s, f.x) + f.mass_u, np.interp(f.s_o, f.s, f.y) + f.mass_v])
    at_mass = np.fmax(f.T_behind, f.T_ahead)
    s = np.concatenate([np.broadcast_to(f.s, x.shape), f.s_o[:, None]], axis=1)
    order = np.argsort(s, axis=1, kind="stable")
    parts = (np.c_[x, mass[0]], np.c_[y, mass[1]], np.c_[f.T, at_mass])
    return tuple(np.take_along_axis(part, order, axis=1) for part in parts)  # type: ignore[return-value]


def profile(r: Response) -> dict[str, Array]:
    """Columns of profile.csv: the rope at rest, and the extremes of depth and tension over the run."""
    f = r.fields
    x = np.linspace(float(f.x[0]), float(f.x[-1]), PLACES)
    rest = np.interp(x, f.x, f.y)
    depth, pull = [rest], [np.interp(x, f.x, f.T_static)]
    for at, y, T in zip(*shapes(r), strict=True):
        depth.append(np.interp(x, at, y))
        pull.append(np.interp(x, at, T))
    lowest = np.max(depth, axis=0)
    for x_car, y_car in _ways(r):  # between frames the car is the lowest point nearby
        inside = (x >= x_car[0]) & (x <= x_car[-1])
        lowest[inside] = np.maximum(lowest[inside], np.interp(x[inside], x_car, y_car))
    return {
        "x": x, "y_rest": rest, "y_highest": np.min(depth, axis=0), "y_lowest": lowest,
        "tension_max": np.max(pull, axis=0), "tension_min": np.min(pull, axis=0),
    }  # fmt: skip


def write_answers(folder: Path, scene: Scene, r: Response) -> None:
    found = outcome(scene, r)
    write_json(folder / "summary.json", {"outcome": found.sentence, "outcome_kind": found.kind, **r.summary()})
    columns = profile(r)
    write_csv(folder / "profile.csv", ",".join(columns), np.stack(list(columns.values()), axis=1))


def _ways(r: Response) -> list[tuple[Array, Array]]:
    turns = np.flatnonzero(np.diff(np.sign(np.diff(r.x))) != 0) + 1
    pieces = zip(np.split(r.x, turns), np.split(r.y, turns), strict=True)
    return [(x, y) if x[-1] > x[0] else (x[::-1], y[::-1]) for x, y in pieces if x.size > 1]


class Track(NamedTuple):
    """A signal at one place, (n,), or along the cable, value (n, m) and s (m,)."""

    t: Array  # [s]
    value: Array
    s: Array  # [m] on the rope


def grounds(scene: Scene) -> dict[str, Array]:
    """What the ride must clear, each as points [x, depth], (n, 2)."""
    found = {o.name: np.array([[o.at, o.top]]) for o in scene.obstacle}
    return found | ({GROUND: np.array(scene.ground, float)} if scene.ground else {})


def clearances(scene: Scene, r: Response) -> dict[tuple[str, str], Track]:
    """Free heights [m] of "rope" and "car" above each obstacle and the ground; negative: it hits; nan: unknown.

    Empty where the car never passes.  An obstacle is a ground of one point.
    """
    below, rooms = 0.0 if scene.mass is None else scene.mass.below, {}
    for name, ground in grounds(scene).items():
        at_car = _under_car(r, ground)
        rooms["rope", name] = _ordered(at_car, _under_rope(r, ground))
        rooms["car", name] = at_car._replace(value=at_car.value - below)
    return rooms


def _ordered(*parts: tuple[Array, ...]) -> Track:
    """Join (times, heights, places) in order of time."""
    t, height, s = (np.concatenate(x) for x in zip(*parts, strict=True))
    order = np.argsort(t, kind="stable")
    return Track(t[order], height[order], s[order])


def _under_car(r: Response, ground: Array) -> Track:
    """Height of the rope at the car over the ground (n, 2) [x, depth], at steps and at the ground's points."""
    over = (r.x > ground[0, 0]) & (r.x < ground[-1, 0])
    parts = [(r.t[over], np.interp(r.x[over], *ground.T) - r.y[over], r.s_o[over])]
    for x, depth in ground:
        i = np.flatnonzero((r.x[:-1] < x) != (r.x[1:] < x))
        w = (x - r.x[i]) / (r.x[i + 1] - r.x[i])
        t, y, s_o = (of[i] + w * (of[i + 1] - of[i]) for of in (r.t, r.y, r.s_o))
        parts.append((t, depth - y, s_o))
    return _ordered(*parts)


def _under_rope(r: Response, ground: Array) -> Track:
    """Least height of the rope over the ground at each frame; nan outside."""
    at, y, _ = shapes(r)
    heights, s = np.full(len(at), np.nan), np.full(len(at), np.nan)
    for k, (a, b) in enumerate(zip(at, y, strict=True)):
        x = np.union1d(a, ground[:, 0])
        x = x[(x >= max(a[0], ground[0, 0])) & (x <= min(a[-1], ground[-1, 0]))]
        if x.size:
            free = np.interp(x, *ground.T) - np.interp(x, a, b)
            heights[k], s[k] = free.min(), np.interp(x[free.argmin()], r.fields.x, r.fields.s)
    return Track(r.fields.t, heights, s)
