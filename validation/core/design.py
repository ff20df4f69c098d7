"""The numbers a ropeway is built by: extremes of a response with the instant and the place where they stand."""

from __future__ import annotations

from typing import Any

import numpy as np

from cablefem.response import Array, Response


def design(r: Response) -> list[dict[str, Any]]:
    """Return rows {quantity, value, bar, unit, t, s_o, s} of what the response knows; SI, no bars yet (None)."""
    f = r.fields
    rows: list[dict[str, Any]] = []

    def row(quantity: str, unit: str, value: float, t: float, s_o: float, s: float | None) -> None:
        at = None if s is None else float(s)
        rows.append({"quantity": quantity, "value": float(value), "bar": None, "unit": unit, "t": float(t),
                     "s_o": float(s_o), "s": at})  # fmt: skip

    def extreme(quantity: str, unit: str, values: Array, sign: float, s: Array | float | None = None) -> None:
        """The largest of sign times the values, over the steps."""
        if np.all(np.isnan(values)):
            return
        i = int(np.nanargmax(sign * values))
        place = s[i] if isinstance(s, np.ndarray) else s
        row(quantity, unit, values[i], r.t[i], r.s_o[i], place)

    at_car = np.fmax(r.T_behind, r.T_ahead)
    i = int(np.nanargmax(at_car))
    most = (at_car[i], r.t[i], r.s_o[i], r.s_o[i])
    if f.T.size:
        k, m = np.unravel_index(int(np.argmax(f.T)), f.T.shape)
        most = max(most, (f.T[k, m], f.t[k], f.s_o[k], f.s[m]))
    row("tension_max", "N", *most)
    extreme("tension_min", "N", r.tension_min, -1.0, r.tension_min_at)
    extreme("reaction_left_max", "N", np.linalg.norm(r.reaction_left, axis=1), 1.0, 0.0)
    extreme("reaction_right_max", "N", np.linalg.norm(r.reaction_right, axis=1), 1.0, r.length)
    if f.T.size and not np.isnan(f.y).all():
        y = f.y + f.v
        k, m = np.unravel_index(int(np.argmax(y)), y.shape)
        row("deepest_point", "m", *max((y[k, m], f.t[k], f.s_o[k], f.s[m]), (r.y.max(), *_at(r, int(r.y.argmax())))))
    extreme("mass_deepest", "m", r.y, 1.0, r.s_o)
    extreme("contact_max", "N", r.F_contact, 1.0, r.s_o)
    extreme("contact_min", "N", r.F_contact, -1.0, r.s_o)
    extreme("haul_force_max", "N", r.F_haul, 1.0, r.s_o)
    extreme("speed_max", "m/s", r.speed, 1.0, r.s_o)
    return rows


def _at(r: Response, i: int) -> tuple[float, float, float]:
    return float(r.t[i]), float(r.s_o[i]), float(r.s_o[i])
