"""The Pareto fronts of a chart, and the fastest row for an error."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

Row = dict[str, Any]
OURS = ("method", "integrator")  # full cable


def pareto_rows(rows: Sequence[Row], quantity: str, work: str = "seconds") -> list[Row]:
    """Rows that no other one beats in work and error."""
    error = f"{quantity}_error"
    out: list[Row] = []
    known = [r for r in rows if r["status"] == "ok" and r[error] is not None and r[work] is not None]
    for row in sorted(known, key=lambda r: (r[work], r[error])):
        if not out or row[error] < out[-1][error]:
            out.append(row)
    return out


def our_pareto_rows(rows: Sequence[Row], quantity: str, work: str = "seconds") -> list[Row]:
    """The same among our methods and schemes on the full cable."""
    return pareto_rows([r for r in rows if r["kind"] in OURS], quantity, work)


def seconds_at_error(rows: list[Row], error: float, quantity: str = "path") -> float | None:
    """Seconds at an error, between the best rows, log over log.

    None where no row reaches it; of a better coarsest row, its seconds.
    """
    error_key = f"{quantity}_error"
    best = pareto_rows(rows, quantity)
    if not best or best[-1][error_key] > error:
        return None
    seconds = np.log([r["seconds"] for r in best])
    errors = np.log([r[error_key] for r in best])
    return float(np.exp(np.interp(-np.log(error), -errors, seconds)))


def fastest_methods_at_error(rows: list[Row], error: float) -> Row:
    """The fastest method for an error of path and of tension, and each peer's time (path)."""
    ours: dict[str, list[Row]] = {}  # by series
    others: dict[str, list[Row]] = {}
    for row in rows:
        if row["kind"] in OURS:
            ours.setdefault(row["series"], []).append(row)
        elif row["kind"] == "peer":
            others.setdefault(row["series"], []).append(row)
    out = {"error": error, **_fastest_series_row(ours, error, "path")}
    out["tension"] = _fastest_series_row(ours, error, "tension")
    out["peers"] = {name: _peer_seconds_row(x, error, out["seconds"]) for name, x in others.items()}
    return out


def _fastest_series_row(rows_by_series: dict[str, list[Row]], error: float, quantity: str) -> Row:
    """The fastest series for an error and its seconds, None where no series reaches it."""
    out: Row = {"series": None, "seconds": None}
    for name, rows in rows_by_series.items():
        seconds = seconds_at_error(rows, error, quantity)
        if seconds is not None and seconds < (out["seconds"] or math.inf):
            out |= {"series": name, "seconds": seconds}
    return out | {"cut": any(map(was_cut_by_budget, rows_by_series.values()))}


def was_cut_by_budget(rows: list[Row]) -> bool:
    """Whether the budget ended before the ladder of settings did."""
    return any(r["status"] == "not run" for r in rows)


def _peer_seconds_row(rows: list[Row], error: float, ours: float | None) -> Row:
    """Seconds of another code at an error, over ours, or why there are none."""
    seconds = seconds_at_error(rows, error)
    if seconds is not None:
        return {"seconds": seconds, "ratio": None if ours is None else seconds / ours, "reason": None}
    errors = [r["path_error"] for r in rows if r["path_error"] is not None]
    if errors:
        how = "within the time it was given" if was_cut_by_budget(rows) else "at best"
        reason = f"comes to {100.0 * min(errors):.2g} % {how}"
    else:
        reason = f"not measured: {rows[0]['reason']}"
    return {"seconds": None, "ratio": None, "reason": reason}
