"""The rows of a chart that no other one beats."""

from collections.abc import Sequence
from typing import Any

Row = dict[str, Any]


def best_of(rows: Sequence[Row], quantity: str, work: str = "seconds") -> list[Row]:
    """Return the rows that no other one beats in both work and error, from quick to exact."""
    out: list[Row] = []
    for row in sorted(rows, key=lambda r: (r[work], r[f"{quantity}_error"])):
        if not out or row[f"{quantity}_error"] < out[-1][f"{quantity}_error"]:
            out.append(row)
    return out
