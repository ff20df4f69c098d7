"""The one change of another program's path that would make it agree.

A change is applied to the columns as it is worded, rounded as printed, and compared with both solvers; what does not
agree then is not printed.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from cablefem.response import Array
from cablefem.scene import Scene
from validation.core import foreign, measures
from validation.core.agreement import Agreement, Verdict
from validation.core.foreign import ForeignPath
from validation.core.ladder import Ladder
from validation.core.measures import NotComparable, Window
from validation.core.store import Refused

SHARE = 0.1  # of duration, deflection or 1: the largest change that is tried


class Change(NamedTuple):
    """A number added to some columns, or the factor of v."""

    words: str
    columns: tuple[str, ...]
    largest: float
    factor: bool = False

    def in_words(self, amount: float) -> str:
        """The sentence with the amount, for a factor with 1 + amount."""
        return self.words.format(1.0 + amount if self.factor else amount)

    def rounded_as_printed(self, amount: float) -> float:
        """The amount with the digits that are printed."""
        number = float(self.in_words(amount).split("by ")[1].split()[0])
        return number - 1.0 if self.factor else number

    def applied_to(self, path: ForeignPath, scene: Scene, amount: float) -> ForeignPath:
        """The path of the changed columns; Refused if that is none."""
        columns: dict[str, Array] = dict(path.columns)
        if self.factor and "v" not in columns:  # v is known up to the end of the travel, and y follows from it
            columns = {name: getattr(path, name) for name in columns if name != "y"} | {"v": path.v}
        for name in self.columns:
            if name in columns:
                values = columns[name]
                columns[name] = values * (1.0 + amount) if self.factor else values + amount
        return ForeignPath.from_columns(path.method, scene, columns)


class Remedies(NamedTuple):
    """Changes of a path on a scene that may make it agree with both solvers in a window.

    tol : allowed beside our bars, relative to the largest deflection.
    """

    path: ForeignPath
    scene: Scene
    both: tuple[Ladder, Ladder]
    window: Window
    tol: float

    def best_in_words(self) -> str | None:
        """Of the changes with which the path agrees the one with the smallest gap left; None: none does."""
        from scipy.optimize import minimize_scalar  # seldom needed

        results = []
        for change in self._possible_changes():
            gap = partial(self._rms_gap_after, change)
            bounds = -change.largest, change.largest
            best = minimize_scalar(gap, bounds=bounds, method="bounded", options={"xatol": 1e-6 * change.largest})
            printed = change.rounded_as_printed(float(best.x))
            if self._agrees_with_both_after(change, printed):
                results.append((gap(printed), change.in_words(printed)))
        return min(results)[1] if results else None

    def _possible_changes(self) -> Iterator[Change]:
        r = self.both[0].finest
        yield Change("its times are shifted by {:.3g} s", ("t",), SHARE * float(r.t[-1]))
        yield Change("its places are shifted by {:.3g} m", ("s_o", "x"), SHARE * r.length / 20.0)
        yield Change("its v is multiplied by {:.4g}", ("v",), SHARE, factor=True)
        yield Change("its heights are shifted by {:.3g} m downwards", ("y", "v"), SHARE * float(abs(r.v).max()))

    def _rms_gap_after(self, change: Change, amount: float) -> float:
        """Rms gap of the changed path to our run; a large number where it is none."""
        run = self.both[0].finest
        try:
            changed = change.applied_to(self.path, self.scene, amount)
            if changed.u is None:
                changed = foreign.with_zero_u_and_x(changed)
                run = foreign.with_zero_u_and_x(run)
            return measures.relative_path_gap(changed, run, self.window).rms
        except (NotComparable, Refused):
            return 1e6  # nothing can be compared; finite, for the search

    def _agrees_with_both_after(self, change: Change, amount: float) -> bool:
        """Whether all rows of the changed path agree with both solvers."""
        try:
            changed = change.applied_to(self.path, self.scene, amount)
        except Refused:
            return False
        for ours in self.both:
            rows = foreign.third_party_rows(changed, ours, self.window, self.tol)
            if not all(row.verdict is Verdict.AGREE for row in rows):
                return False
        return True


def with_remedy_note(rows: Sequence[Agreement], remedies: Remedies) -> list[Agreement]:
    """The rows of a path; if one disagrees, those of the path itself with a note: what makes it agree."""
    if not any(row.verdict is Verdict.DISAGREE for row in rows):
        return list(rows)
    text = remedies.best_in_words()
    if text is None:
        return list(rows)
    note = (f"agrees if {text}",)
    noted = [replace(row, bound=replace(row.bound, notes=note)) for row in rows[:2]]
    return [*noted, *rows[2:]]
