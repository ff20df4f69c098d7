"""The one change of another program's path that would make it agree.

A change is applied to the columns as it is worded, rounded as printed, and compared with both solvers; what does not
agree then is not printed.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from cablefem.response import Array
from cablefem.scene import Scene
from validation.core import foreign, measures
from validation.core.agreement import Agreement, Verdict
from validation.core.foreign import ForeignPath
from validation.core.ladder import Ladder
from validation.core.measures import NotComparable, Window
from validation.core.store import Refused

SHARE = 0.1  # of duration, deflection or 1: the largest change that is tried


@dataclass(frozen=True, slots=True)
class Change:
    """A number added to some columns, or the factor of v."""

    words: str
    columns: tuple[str, ...]
    largest: float
    factor: bool = False

    def in_words(self, x: float) -> str:
        return self.words.format(1.0 + x if self.factor else x)

    def as_printed(self, x: float) -> float:
        """The change with the digits that are printed."""
        number = float(self.in_words(x).split("by ")[1].split()[0])
        return number - 1.0 if self.factor else number

    def apply_to(self, path: ForeignPath, scene: Scene, x: float) -> ForeignPath:
        """The path of the changed columns; Refused if that is none."""
        columns: dict[str, Array] = dict(path.columns)
        if self.factor and "v" not in columns:
            del columns["y"]  # follows from v
            columns["v"] = path.v
        for name in self.columns:
            if name in columns:
                columns[name] = columns[name] * (1.0 + x) if self.factor else columns[name] + x
        return ForeignPath.from_columns(path.method, scene, columns)


def with_remedy(
    rows: Sequence[Agreement], path: ForeignPath, scene: Scene, both: tuple[Ladder, Ladder], window: Window, tol: float
) -> list[Agreement]:
    """The rows of a path that disagrees, those of the path itself with a note: what makes it agree with both solvers.

    tol : allowed beside our bars, relative to the largest deflection.
    """
    text = (
        _remedy_text(path, scene, both, window, tol) if any(row.verdict is Verdict.DISAGREE for row in rows) else None
    )
    if text is None:
        return list(rows)
    note = (f"agrees if {text}",)
    noted = [replace(row, bound=replace(row.bound, notes=note)) for row in rows[:2]]
    return [*noted, *rows[2:]]


def _remedy_text(
    path: ForeignPath, scene: Scene, both: tuple[Ladder, Ladder], window: Window, tol: float
) -> str | None:  # fmt: skip
    from scipy.optimize import minimize_scalar  # seldom needed

    run = both[0].finest
    results = []
    for change in _possible_changes(both[0]):

        def rms(x: float, change: Change = change) -> float:
            """Rms gap of the changed path to our run; FAR where it is none."""
            try:
                changed = change.apply_to(path, scene, x)
                pair = (changed, run) if changed.u is not None else tuple(map(foreign.with_zero_u, (changed, run)))
                return measures.relative_path_gap(pair[0], pair[1], window).rms
            except (NotComparable, Refused):
                return 1e6  # nothing can be compared; finite, for the search

        bounds = -change.largest, change.largest
        found = minimize_scalar(rms, bounds=bounds, method="bounded", options={"xatol": 1e-6 * change.largest})
        printed = change.as_printed(float(found.x))
        if _changed_path_agrees(path, change, printed, scene, both, window, tol):
            results.append((rms(printed), change.in_words(printed)))
    return min(results)[1] if results else None


def _possible_changes(ours: Ladder) -> Iterator[Change]:
    r = ours.finest
    yield Change("its times are shifted by {:.3g} s", ("t",), SHARE * float(r.t[-1]))
    yield Change("its places are shifted by {:.3g} m", ("s_o", "x"), SHARE * r.length / 20.0)
    yield Change("its v is multiplied by {:.4g}", ("v",), SHARE, factor=True)
    yield Change("its heights are shifted by {:.3g} m downwards", ("y", "v"), SHARE * float(abs(r.v).max()))


def _changed_path_agrees(
    path: ForeignPath, change: Change, x: float, scene: Scene, both: tuple[Ladder, Ladder], window: Window, tol: float
) -> bool:
    """Whether all rows of the changed path agree with both solvers."""
    try:
        changed = change.apply_to(path, scene, x)
    except Refused:
        return False
    rows = [row for ours in both for row in foreign.third_party_rows(changed, ours, window, tol)]
    return all(row.verdict is Verdict.AGREE for row in rows)
