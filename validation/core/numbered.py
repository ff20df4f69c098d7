"""Design numbers of a ladder."""

from validation.core.design import Number
from validation.core.design import numbers as of_companions
from validation.core.estimate import Estimated
from validation.core.ladder import Ladder


def numbers(ladder: Ladder, twin: Ladder | None = None) -> list[Number]:
    """Return the design numbers of a run with the bars of its coarser runs, and no less than the gap to its twin."""
    return of_companions(_companions(ladder), None if twin is None else _companions(twin))


def _companions(x: Ladder) -> Estimated:
    space, time = (branch.runs[0] if branch.runs else x.finest for branch in (x.space, x.time))
    return Estimated(x.finest, x.finest, space, time, (1.0, 0.5), "coarser runs")
