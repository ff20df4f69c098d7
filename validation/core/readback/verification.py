"""The verification table from the comparison of both solvers and three resolutions."""

import math
from collections.abc import Sequence

from validation.core.readback.stored import Faults, Row, StoredResults
from validation.core.scene_data import ROUNDING

SAFETY = 1.25
ORDERS = (0.5, 12.0)  # that are observed
CREDITED = 2.0  # most


def verification_faults(stored: StoredResults) -> Faults:
    """Faults of each row from the comparison of both solvers and from the values of three resolutions."""
    gaps = {x["law"]: x for x in stored.rows if x["quantity"] == "design gap"}
    for row in stored.agreement.get("verification", []):
        for fault in _verification_row_faults(stored, row, gaps[row["quantity"]]):
            yield f"{row['quantity']}: {fault}"


def _verification_row_faults(stored: StoredResults, row: Row, gap: Row) -> Faults:
    size = max(abs(row["value"]), abs(row["other"])) or 1.0
    expected = _expected_verification_numbers(stored, row, gap, size)
    smallest = 0.0
    for direction in ("space", "time"):
        levels = row[f"levels_{direction}"]
        ratios = row[f"ratios_{direction}"]
        order = row[f"order_{direction}"]
        finest, half = levels[:2]
        if not _is_observed_order(order, levels, ratios):
            yield f"order in {direction} {order} does not follow"
        if finest != row["value"]:
            yield f"{finest} is not the value"
        credited = min(order or ORDERS[0], CREDITED)
        smallest += SAFETY * abs(finest - half) / (ratios[0] ** credited - 1.0)
    if smallest > row["bar"] * (1.0 + ROUNDING):
        yield f"the bar {row['bar']} is smaller than {smallest} from the last changes"
    for key, value in expected.items():
        if abs(row[key] - value) > 1e-5 * abs(value) + ROUNDING * size:
            yield f"{key} {row[key]} where {value} follows"


def _expected_verification_numbers(stored: StoredResults, row: Row, gap: Row, size: float) -> dict[str, float]:
    """Values and bars of both solvers, their gap and its uncertainty; size : of the values."""
    i = stored.methods.index(row["method"])
    first, second = ("a", "b") if i == 0 else ("b", "a")
    return {
        "value": _stored_design_value(stored, i, row["quantity"]),
        "other": _stored_design_value(stored, 1 - i, row["quantity"]),
        "bar": size * gap[f"bar_{first}"],
        "bar_other": size * gap[f"bar_{second}"],
        "gap": abs(row["value"] - row["other"]),
        "uncertainty": math.hypot(row["bar"], row["bar_other"]),
    }


def _stored_design_value(stored: StoredResults, method: int, quantity: str) -> float:
    """A design number of a method."""
    design = stored.runs[method]["rest"]["design"]
    return float(next(x["value"] for x in design if x["quantity"] == quantity))


def _is_observed_order(order: float | None, levels: Sequence[float], ratios: Sequence[float]) -> bool:
    """Whether falling changes of three resolutions are of an order; None: of none in the range."""
    if len(levels) < 3 or levels[0] == levels[1]:
        return order is None
    fall = abs((levels[1] - levels[2]) / (levels[0] - levels[1]))
    r, coarser = ratios
    low, off, high = (r**p * (coarser**p - 1.0) / (r**p - 1.0) - fall for p in (ORDERS[0], order or 1.0, ORDERS[1]))
    if not low < 0.0 < high:
        return order is None
    return order is not None and abs(off) <= 1e-5 * fall
