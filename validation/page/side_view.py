"""The line from the side, to scale, with the rope in motion; data included."""

import base64
import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from cablefem.response import Array, Response
from cablefem.scene import Scene
from validation.core.answers import profile
from validation.page.page import rendered
from validation.page.plot import BLUE, VERMILLION, colors

SCRIPT = "side_view.js"
STATIONS = 101  # of the moving rope, at most, without the mass


def side_view(scene: Scene, runs: Sequence[Response], *, range_T: tuple[float, float], party: Any = None) -> Markup:
    """The side view of one or two runs; its section needs SCRIPT among its scripts.

    range_T : tensions [N] at the ends of the colour scale;  party : a third party's path.
    """
    r = runs[0]
    s = r.fields.s[:: _every(r)]
    X = scene.catenary
    ends: dict[str, Any] = {
        "span": scene.supports.span, "drop": scene.supports.drop, "s": short(s), "x": short(X.x(s)),
        "y": short(X.y(s)), "static": short(X.tension(s)), "T": list(range_T),
        "unit": 1e3 if range_T[1] >= 2e3 else 1.0, "unitName": "kN" if range_T[1] >= 2e3 else "N",
        "colors": [f"#{bytes(c).hex()}" for c in colors(48)],
    }  # fmt: skip
    both = zip(runs, (BLUE, VERMILLION), strict=False)
    cables = [_cable(scene, run, color, ends["unit"], ends["unitName"]) for run, color in both]
    data = {**ends, **_still(scene, r), "cables": cables, "party": None if party is None else _party(scene, party)}
    # "<" could end the script
    packed = Markup(json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c"))
    return rendered("side_view.html", data=packed, names=" and ".join(run.method for run in runs))


def _every(r: Response) -> int:
    return max(1, -(-(r.fields.s.size - 1) // (STATIONS - 1)))


def _still(scene: Scene, r: Response) -> dict[str, Any]:
    """The still parts: envelope, path of the car, brake, obstacles, ground, speeds at five places."""
    p = profile(r)
    at = some(r.t.size)
    ahead = np.flatnonzero(np.diff(np.maximum.accumulate(r.s_o), prepend=-1.0) > 0.0)  # first arrivals
    marks = np.linspace(0.0, 1.0, 7)[1:-1] * (r.s_o.max() - r.s_o[0]) + r.s_o[0]
    marks = np.interp(marks, r.s_o[ahead], r.t[ahead])
    speed = np.interp(marks, r.t, r.speed)
    X = scene.catenary
    return {
        "envelope": [short(p[name]) for name in ("x", "y_highest", "y_lowest")],
        "path": [short(r.x[at]), short(r.y[at])],
        "below": 0.0 if scene.mass is None else scene.mass.below,
        "speeds": [
            {"x": float(np.interp(t, r.t, r.x)), "y": float(np.interp(t, r.t, r.y)), "text": f"{3.6 * v:.0f} km/h"}
            for t, v in zip(marks, speed, strict=True)
        ],
        "brakes": [{"x": float(X.x(b.place)), "y": float(X.y(b.place))} for b in scene.drive.brake],
        "obstacles": [{"name": o.name, "x": o.at, "top": o.top} for o in scene.obstacle],
        "ground": [list(point) for point in scene.ground],
    }


def _party(scene: Scene, party: Any) -> dict[str, Any]:
    at = some(party.t.size)
    x = scene.catenary.x(party.s_o) if party.x is None else party.x
    return {"name": party.method, "x": short(x[at]), "y": short(party.y[at])}


def _cable(scene: Scene, r: Response, color: str, unit: float, name: str) -> dict[str, Any]:
    """Frames of one rope, from shortly after the start: a gripped mass enters a rope at rest."""
    f = r.fields
    every = _every(r)
    X = scene.catenary
    T = X.tension(r.s_o[:1])
    start = {"s_o": r.s_o[0], "T": X.tension(f.s[::every]), "T_behind": T, "T_ahead": T}  # the rest is zero
    late = f.t[0] > 0.0

    def frames(of: str) -> Array:
        values = getattr(f, of)
        values = values[:, ::every] if values.ndim == 2 else values
        first = np.broadcast_to(start.get(of, 0.0), values[:1].shape)
        return np.concatenate([first, values]) if late else values

    t = np.append(0.0, f.t) if late else f.t
    behind = frames("T_behind")
    ahead = frames("T_ahead")
    s_o = frames("s_o")
    told = [("speed [km/h]", 1, 3.6 * r.speed), (f"press on the rope [{name}]", 2, r.F_contact / unit)]
    told.append((f"haul or thrust [{name}]", 2, r.F_haul / unit))
    return {
        "name": r.method, "color": color, "t": _packed(t), "s_o": _packed(s_o), "u": _packed(frames("u")),
        "v": _packed(frames("v")), "T": _packed(frames("T")), "mass_x": _packed(X.x(s_o) + frames("mass_u")),
        "mass_y": _packed(X.y(s_o) + frames("mass_v")), "mass_v": _packed(frames("mass_v")),
        "behind": _packed(np.where(np.isnan(behind), ahead, behind)),
        "ahead": _packed(np.where(np.isnan(ahead), behind, ahead)),
        "told": [
            {"name": head, "digits": digits, "data": _packed(np.interp(t, r.t, values))}
            for head, digits, values in told if np.isfinite(values).all()
        ],
        "slack": None if r.slack_onset is None else r.slack_onset * r.length,
    }  # fmt: skip


def _packed(x: Array) -> dict[str, Any]:
    """An array as 16-bit integers between its extremes, in base64."""
    low = float(x.min())
    high = float(x.max())
    steps = np.round((x - low) / ((high - low) or 1.0) * 65535.0).astype("<u2")
    return {"low": low, "high": high, "data": base64.b64encode(steps.tobytes()).decode("ascii")}


def some(n: int) -> Any:
    """Indices of 300 of n points at most."""
    return np.unique(np.linspace(0, n - 1, 300).round().astype(int))


def short(x: Array) -> list[float]:
    """Values to six digits."""
    return [float(f"{value:.6g}") for value in x]
