"""The Pareto fronts of a chart, and the fastest row for an error."""

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
    best = pareto_rows(rows, quantity)
    if not best or best[-1][f"{quantity}_error"] > error:
        return None
    seconds, errors = (np.log([r[name] for r in best]) for name in ("seconds", f"{quantity}_error"))
    return float(np.exp(np.interp(-np.log(error), -errors, seconds)))


def fastest_methods_at_error(rows: list[Row], error: float) -> Row:
    """The fastest method for an error of path and of tension, and each peer's time (path)."""
    by_series: dict[str, list[Row]] = {}
    for row in rows:
        by_series.setdefault(row["series"], []).append(row)
    ours = {name: x for name, x in by_series.items() if x[0]["kind"] in OURS}
    others = {name: x for name, x in by_series.items() if x[0]["kind"] == "peer"}

    def fastest_series(quantity: str) -> Row:
        seconds = {name: seconds_at_error(x, error, quantity) for name, x in ours.items()}
        reached = {name: t for name, t in seconds.items() if t is not None}
        name = min(reached, key=reached.__getitem__, default="")
        return {"series": name or None, "seconds": reached.get(name), "cut": any(map(cut_by_budget, ours.values()))}

    path = fastest_series("path")
    peers = {name: _peer_seconds_row(x, error, path["seconds"]) for name, x in others.items()}
    return {"error": error, **path, "tension": fastest_series("tension"), "peers": peers}


def cut_by_budget(rows: list[Row]) -> bool:
    """Whether the budget ended before the ladder of settings did."""
    return any(r["status"] == "not run" for r in rows)


def _peer_seconds_row(rows: list[Row], error: float, ours: float | None) -> Row:
    """Seconds of another code at an error, over ours, or why there are none."""
    at = seconds_at_error(rows, error)
    reason = None
    if at is None:
        errors = [r["path_error"] for r in rows if r["path_error"] is not None]
        how = "within the time it was given" if cut_by_budget(rows) else "at best"
        reason = f"comes to {100.0 * min(errors):.2g} % {how}" if errors else f"not measured: {rows[0]['reason']}"
    return {"seconds": at, "ratio": None if at is None or ours is None else at / ours, "reason": reason}
