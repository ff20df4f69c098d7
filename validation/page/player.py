"""The cable in motion: a player that carries its data with it, a few hundred kilobytes at most."""

import base64
import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from cablefem.response import Array, Response
from cablefem.scene import Scene
from validation.page.page import rendered
from validation.page.plot import BLUE, FIELD, VERMILLION, colors

SCRIPT = "player.js"
STATIONS = 101  # at most; the mass is a point of its own, so that its kink stays sharp


def player(
    scene: Scene, runs: Sequence[Response], *, window: tuple[float, float], range_T: tuple[float, float]
) -> Markup:
    """Return the player of one or two runs; its section must name SCRIPT among its scripts.

    window : s_o/l between which the runs are compared.  range_T : tensions [N] at the ends of the colour scale.
    """
    X, T_rest = scene.catenary, scene.catenary.tension
    every = max(1, -(-(runs[0].fields.s.size - 1) // (STATIONS - 1)))
    slope = scene.supports.drop / scene.supports.span
    low = high = 0.0  # depths below the chord, of all frames and of those that are compared
    inner = [0.0, 0.0]
    top = range_T[1]
    unit, name = (1e3, "kN") if range_T[1] >= 2e3 else (1.0, "N")
    cables = []
    for r, color in zip(runs, (BLUE, VERMILLION), strict=False):
        f = r.fields
        s = f.s[::every]
        # frames begin a little after the start: a gripped mass enters a cable at rest, others hang on it already
        u, v, T, s_o, mass_u, mass_v, behind, ahead = (
            np.concatenate([part[:1] if r.drive != "grip" else first, part] if f.t[0] > 0.0 else [part])
            for part, first in (
                (f.u[:, ::every], np.zeros((1, s.size))), (f.v[:, ::every], np.zeros((1, s.size))),
                (f.T[:, ::every], T_rest(s)[None]), (f.s_o, np.zeros(1)), (f.mass_u, np.zeros(1)),
                (f.mass_v, np.zeros(1)), (f.T_behind, T_rest(np.zeros(1))), (f.T_ahead, T_rest(np.zeros(1))),
            )
        )  # fmt: skip
        t = np.append(0.0, f.t) if f.t[0] > 0.0 else f.t
        behind, ahead = np.where(np.isnan(behind), ahead, behind), np.where(np.isnan(ahead), behind, ahead)
        x, y = X.x(s_o) + mass_u, X.y(s_o) + mass_v
        below, mass = X.y(s) + v - slope * (X.x(s) + u), y - slope * x
        low, high = min(low, below.min(), mass.min()), max(high, below.max(), mass.max())
        compared = below[s_o <= window[1] * r.length] if r.drive != "free" else below
        inner = [min(inner[0], compared.min()), max(inner[1], compared.max())]
        top = max(top, float(T.max()), float(behind.max()), float(ahead.max()))
        cables.append({
            "name": r.method, "color": color, "t": _packed(t), "s_o": _packed(s_o / r.length), "u": _packed(u),
            "v": _packed(v), "T": _packed(T), "mass_x": _packed(x),
            "mass_y": _packed(y), "mass_v": _packed(mass_v),
            "behind": _packed(behind),
            "ahead": _packed(ahead),
            "told": [
                {"name": name, "digits": digits, "data": _packed(factor * np.interp(t, r.t, values))}
                for name, digits, factor, values in (
                    ("speed [km/h]", 1, 3.6, r.speed), (f"force across [{name}]", 2, 1.0 / unit, r.F_contact),
                    (f"force along [{name}]", 2, 1.0 / unit, r.F_haul),
                ) if np.isfinite(values).all()
            ],
            "slack": r.slack_onset, "reached": r.reached, "complete": r.status == "complete",
        })  # fmt: skip
    s, room = runs[0].fields.s[::every], _ROOM * (inner[1] - inner[0])
    data = {
        "span": scene.supports.span, "drop": scene.supports.drop, "s": _short(s / scene.length), "x": _short(X.x(s)),
        "y": _short(X.y(s)), "below": [max(low, inner[0] - room), min(high, inner[1] + room)],
        "static": _short(X.tension(s)), "window": list(window), "T": list(range_T),
        "top": min(top, _TOP * range_T[1]), "unit": unit, "unitName": name, "cables": cables,
        "free": runs[0].drive == "free",
        "colors": [f"#{bytes(c).hex()}" for c in colors(FIELD, 48).round().astype(np.uint8)],
    }  # fmt: skip
    # "<" cannot end the script early
    packed = Markup(json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c"))
    return rendered("player.html", data=packed, names=" and ".join(r.method for r in runs))


_ROOM = 0.25  # of the depths that are compared: a slack cable that swings further leaves the frame
_TOP = 2.0  # tensions beyond so many times the scale's end are spikes of the slack cable: they leave the frame


def _packed(x: Array) -> dict[str, Any]:
    """Return an array as 16-bit steps between its extremes, in base64."""
    low, high = float(x.min()), float(x.max())
    steps = np.round((x - low) / ((high - low) or 1.0) * 65535.0).astype("<u2")
    return {"low": low, "high": high, "data": base64.b64encode(steps.tobytes()).decode("ascii")}


def _short(x: Array) -> list[float]:
    return [float(f"{value:.6g}") for value in x]
