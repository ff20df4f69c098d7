"""Second computation of design numbers, within their bars."""

import math
from collections.abc import Iterator

import numpy as np
from scipy.interpolate import make_interp_spline

from cablefem.response import Array, Response
from validation.core.agreement import Agreement, Bound, Part
from validation.core.evidence import ROUNDING, Given, cross
from validation.core.measures import extremes_within


def _row(r: Response, quantity: str, law: str, gap: float, allowed: float, where: float | None = None) -> Agreement:
    """Gap of a printed to a recomputed value, over its largest size; where : s_o/l."""
    return Agreement(
        quantity, gap, Bound("law", (Part(r.method, allowed, "printed bar and sampling"),)), where, law=law
    )


def rows(r: Response, twin: Response | None = None) -> Iterator[Agreement]:
    yield from design(r, twin)


def design(r: Response, twin: Response | None = None) -> Iterator[Agreement]:
    """Check design numbers against the extremes of their signals, in the range of both runs."""
    span, known = extremes_within(r, twin), _signals(r)
    for row in r.design:
        quantity = row["quantity"]
        signals = known.get(quantity) or known.get(quantity.removesuffix("_max").removesuffix("_min"))
        if signals is None:
            continue
        uphill = quantity.startswith("angle") and signals[0][1][0] < 0.0  # at first
        least = quantity.endswith("_min") or uphill
        where = None if row["s_o"] is None else row["s_o"] / r.length
        means = Given(r.scene_toml, r.length).round_trip if row["unit"] in ("N", "deg") else 0.0
        for name, bar, law, over in (("value", "bar", "", means), ("peak", "bar_peak", " peak", 0.0)):
            if row.get(name) is not None:
                found = np.concatenate([_means(t, v, span, over).ravel() for t, v in signals if t.size])
                right = float(found.min(initial=math.inf) if least else found.max(initial=-math.inf))
                size = abs(right) or 1.0
                gap, allowed = abs(row[name] - right) / size, (row[bar] or 0.0) / size + ROUNDING
                yield _row(r, "design", quantity + law, gap, allowed, where)


Signals = list[tuple[Array, Array]]  # times (n,), values (n,) or (n, m)


def _signals(r: Response) -> dict[str, Signals]:
    f, given = r.fields, Given(r.scene_toml, r.length)
    tilt = math.degrees(math.atan(given.blown(2) / (given.rho * given.gravity)))
    known: dict[str, Signals] = {
        "wind_tilt": [(r.t, np.full(r.t.shape, tilt))],
        "tension": [(r.t, r.T_behind), (r.t, r.T_ahead), (f.t, f.T)],
    }
    for side, force in (("left", r.reaction_left), ("right", r.reaction_right)):
        horizontal, vertical = np.abs(force.T)
        size = np.sqrt(horizontal**2 + vertical**2)
        parts = {"": size, "_horizontal": horizontal, "_vertical": vertical}
        known |= {f"reaction_{side}{part}": [(r.t, x)] for part, x in parts.items()}
        known["tension"].append((r.t, size))
        downhill = force[:, 1] * np.sign(force[:, 0])  # the rope pulls away from its support
        known[f"angle_{side}"] = [(r.t, np.degrees(np.arcsin(downhill / size)))]
    at_mass = {
        "contact": _press(r), "haul_force": np.abs(r.F_haul), "haul_force_min": r.F_haul, "mass_deflection": r.v,
        "speed": np.sqrt(np.sum(r.velocity**2, axis=1)),
    }  # fmt: skip
    known |= {name: [(r.t, x)] for name, x in at_mass.items()}
    deep: Signals = [(r.t, r.y), (f.t, f.y + f.v)]
    return known | {"mass_deepest": deep[:1], "deepest_point": deep}


def _press(r: Response) -> Array:
    """Force of the mass on the cable across the mean tangent (n,), positive down."""
    tangent = r.slope_behind + r.slope_ahead
    return cross(tangent, r.contact) / np.sqrt(np.sum(tangent**2, axis=1))


def _means(t: Array, v: Array, span: tuple[float, float], period: float) -> Array:
    rows = (t >= span[0] * (1.0 - ROUNDING)) & (t <= span[1] * (1.0 + ROUNDING))
    rows &= np.isfinite(v.reshape(t.size, -1)).all(axis=1)
    t, v = t[rows], v[rows]
    if not period or t.size < 3:
        return v
    if v.ndim == 2:  # frames: at least one on either side
        k = np.arange(t.size)
        near = (np.abs(t[:, None] - t) <= 0.5 * period) | (np.abs(k[:, None] - k) <= 1)
        return np.asarray(near @ v / near.sum(axis=1)[:, None])
    total = make_interp_spline(t, v, k=1).antiderivative()
    low, high = np.clip(t - 0.5 * period, t[0], t[-1]), np.clip(t + 0.5 * period, t[0], t[-1])
    return np.asarray((total(high) - total(low)) / (high - low))
