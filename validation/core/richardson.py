"""Richardson's argument: two runs of known order say what is left in the finer one.

An error that falls like h^p and a refinement by `ratio` leave gap/(ratio^p - 1) of the gap between the two runs.
"""

import math
from typing import Any

# Wave fronts pass the mass as spikes whose order is lower than the path's nominal one: space is credited with no more.
CREDITED_SPACE_ORDER = 1.5
TIME_ORDER = {"newmark": 1.0}  # all other schemes: 2
# More than Roache's 1.25 for three grids, with which 5 percent of the bars of random scenes were too small.
SAFETY = 1.5
# Where two grids are all there is; not his 3, credited orders being low: with 2 just 95 percent of the bars hold.
UNCONFIRMED = 2.5
# times what the rule's order makes of a fall in time: of 521 hostile scenes two with more had bars too small, one 2.8
# times.  In space less is credited than the order anyway.
NONSENSE = 4.0
# Eca & Hoekstra (J. Comput. Phys. 262, 2014): what falls more slowly shows no order; three times its last change is the
# bar.
LEAST_ORDER, NO_ORDER = 0.5, 3.0


def left(order: float, ratio: float = 2.0) -> float:
    """Return the part of the gap between two runs that is left as error in the finer one."""
    return 1.0 / (ratio**order - 1.0)


def no_order(ratio: float) -> float:
    """Return the bar over the gap to a run coarser by `ratio` where no order shows: as for halves, for an order 1/2."""
    return NO_ORDER * left(LEAST_ORDER, ratio) / left(LEAST_ORDER)


def weight(order: float, fall: float | None, most: float = math.inf) -> float:
    """Return the bar of a run over its gap to the one half as fine, by how that gap fell from the one before.

    The order that this shows is credited as far as it is known, and none where nothing shows it: without the coarsest
    run (None), or with one so far off that it says nothing of order (a fall beyond `most`).
    """
    if fall is None or not 2.0**LEAST_ORDER <= fall <= most:
        return NO_ORDER
    return min(NO_ORDER, SAFETY * left(min(math.log2(fall), order)))


def space_order(nominal: float) -> float:
    """Return the order that a method's path is credited with in space."""
    return min(nominal, CREDITED_SPACE_ORDER) if nominal > 1.0 else 1.0


def time_order(settings: dict[str, Any]) -> float:
    """Return the order of a run's scheme."""
    return TIME_ORDER.get(settings["scheme"], 2.0)
