"""The table of a verification in the language of ASME V&V 20: the other solver's number is D."""

import math
from typing import Any

from validation.core.design import signals_over_common_time
from validation.core.ladder import Ladder
from validation.core.order import observed_order

Row = dict[str, Any]


def verification_rows(a: Ladder, b: Ladder) -> list[Row]:
    """One row for each design number with a bar of both solvers, of the one with the smaller bar; none for exact ones.

    a, b : with design numbers whose bars are their own.  Values are those of the run, of half and of a quarter.
    """
    numbers = [{row["quantity"]: row for row in x.finest.design if row["bar"]} for x in (a, b)]
    computed = [signals_over_common_time(a.finest, b.finest), signals_over_common_time(b.finest, a.finest)]
    out = []
    for name in computed[0]:
        if not all(name in known for known in numbers):
            continue
        of_a = numbers[0][name]
        of_b = numbers[1][name]
        gap = abs(of_a["value"] - of_b["value"])
        i = int(max(of_b["bar"], gap) < max(of_a["bar"], gap))
        ladder = (a, b)[i]
        number, other = (of_b, of_a) if i else (of_a, of_b)
        row = {
            "quantity": name, "method": ladder.finest.method, "unit": number["unit"], "value": number["value"],
            "bar": number["bar"], "other": other["value"], "bar_other": other["bar"], "gap": gap,
            "uncertainty": math.hypot(number["bar"], other["bar"]),
        }  # fmt: skip
        for direction in ("space", "time"):
            branch = getattr(ladder, direction)
            levels = branch.finest_half_and_quarter_values(ladder.finest, computed[i][name].extreme_value_or_nan)
            row[f"levels_{direction}"] = levels
            row[f"ratios_{direction}"] = list(branch.ratios)
            row[f"order_{direction}"] = observed_order(levels, branch.ratios)
        out.append(row)
    return out
