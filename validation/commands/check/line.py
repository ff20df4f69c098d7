"""A line at rest by exact catenaries and by elements: do they agree?

Bars: change in one more Newton step (catenaries); of elements `order.error_bar` of the change on halving; at least
rounding: of tensions of the elements that of coordinates over the distance of nodes.
"""

import itertools
import math
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cablefem import catenary_line
from cablefem.elements import line as elements
from cablefem.response import Array
from cablefem.scene.line import Line, LineNotConverged, LineRest, LineState
from validation.commands.check import sensitivity as sensitivities
from validation.commands.run.line import (
    RestAnswers,
    answer_line,
    max_and_min_rows,
    no_rest_refusal,
    numbers_by_position,
)
from validation.commands.run.lines import Row
from validation.commands.run.worst import with_added_positions
from validation.core import line_laws, store
from validation.core.agreement import FACTOR_DISAGREE, Agreement, Bound, BoundPart, no_bound
from validation.core.order import FIRST, error_bar
from validation.page import line as page
from validation.page.options import tolerance_faults

FINEST = 32  # elements on each piece, at most
ROUNDING = 256 * np.finfo(float).eps  # of the reach for lengths, of EA for forces
TOL = 1e-6  # [m], and of the largest tension
TOL_RANGE = (1e-9, 1e-2)
METRES = ("place", "rope_place", "s", "rope_length")  # quantities in metres; the others are forces


@dataclass(frozen=True, slots=True)
class Unit:
    """Rounding and tolerance in a unit."""

    name: str
    rounding: float
    rounding_of_elements: float
    tolerance: float


@dataclass(frozen=True)
class BothAnswers:
    """Both answers to a line, each with a coarser one."""

    a: LineRest
    coarser_a: LineRest
    b: LineRest
    coarser_b: LineRest
    elements: int = 1  # of b on each piece

    @property
    def answers_with_coarser(self) -> tuple[LineRest, ...]:
        return self.a, self.coarser_a, self.b, self.coarser_b

    @property
    def positions_solved_by_all(self) -> list[int]:
        """Positions that have a rest in all of them."""
        return [i for i in self.a.states if all(i in rest.states for rest in self.answers_with_coarser)]

    @cached_property
    def design_numbers_of_each(self) -> list[list[Row]]:
        """Design numbers of each answer, followed by the coarser one's, over the positions that all solve."""
        shared = self.positions_solved_by_all
        designs = []
        for rest in self.answers_with_coarser:
            numbers = [row if i in shared else None for i, row in enumerate(numbers_by_position(rest))]
            designs.append(max_and_min_rows(rest.line, numbers))
        return designs

    def units_with_tolerances(self, tol: float, tol_tension: float) -> tuple[Unit, Unit]:
        """Metres and newtons, each with what it rounds to and the tolerance."""
        reach = float(np.ptp(self.a.empty.points[:, 0]))
        EA = self.a.empty.case.EA
        tension = max(float(np.nanmax(state.station_tensions)) for state in self.a.states.values())
        metres = Unit("m", ROUNDING * reach, ROUNDING * reach, tol)
        # strains of elements are differences of coordinates over the distance of nodes
        shortest = min(float(np.diff(state.s).min()) for state in self.a.states.values())
        strain = np.finfo(float).eps * reach * elements.DEGREE * self.elements / shortest
        newtons = Unit("N", ROUNDING * EA, max(ROUNDING, strain) * EA, tol_tension * tension)
        return metres, newtons


class StationValues(NamedTuple):
    """Values of one quantity at the stations where it is compared."""

    values: Array  # (m,) or (m, 2)
    stations: list[str]  # names (m,)


def station_values_by_quantity(state: LineState) -> dict[str, StationValues]:
    """What is compared of a state at rest."""
    case = state.case
    n = len(case.stations)
    kinds = np.array([station.kind for station in case.stations])
    free_point = np.isnan(case.points_or_nan).any(axis=1)
    free_s = np.isnan(case.s_or_nan)
    length = np.full(n, np.ptp(state.s))
    compared: dict[str, tuple[Array, np.ndarray]] = {  # values of all stations, and indices of those that count
        "place": (state.points, np.flatnonzero(free_point)),
        "rope_place": (state.middle, np.arange(n - 1)),
        "s": (state.s, np.flatnonzero(free_s)),
        "rope_length": (length, np.array([n - 1])),
        "tension_behind": (state.station_tensions[:, 0], np.arange(1, n)),
        "tension_ahead": (state.station_tensions[:, 1], np.arange(n - 1)),
        "haul": (state.haul, np.flatnonzero(kinds == "hauled")),
        "pressure": (state.rope_force_on_stations, np.flatnonzero(kinds == "saddle")),
    }
    out = {}
    for quantity, (values, stations) in compared.items():
        out[quantity] = StationValues(values[stations], [case.stations[i].name for i in stations])
    return out


def worst_state_rows(both: BothAnswers, metres: Unit, newtons: Unit) -> Iterator[Agreement]:
    """One row a quantity, of the worst station and position that all answers solve."""
    shared = both.positions_solved_by_all
    if not shared:
        return
    states = [[station_values_by_quantity(rest.states[i]) for i in shared] for rest in both.answers_with_coarser]
    for quantity in states[0][0]:
        values = []  # 4 of (m,) or (m, 2)
        for by_position in states:
            values.append(np.concatenate([state[quantity].values for state in by_position]))
        where: list[str] = []
        for i, state in zip(shared, states[0], strict=True):
            where += [f"{name}, position {i + 1}" for name in state[quantity].stations]
        if where:
            yield _worst_value_row(quantity, values, where, metres if quantity in METRES else newtons)


def worst_design_number_rows(both: BothAnswers, *units: Unit) -> Iterator[Agreement]:
    """One row a unit, of the worst design number."""
    designs = both.design_numbers_of_each
    numbers = [{d["quantity"]: d["value"] for d in design} for design in designs]
    for unit in units:
        names = [d["quantity"] for d in designs[0] if d["unit"] == unit.name]
        names = [name for name in names if all(name in of_answer for of_answer in numbers)]
        values = [np.array([of_answer[name] for name in names]) for of_answer in numbers]
        if names:
            yield _worst_value_row("design", values, names, unit)


def _worst_value_row(quantity: str, values: Sequence[Array], where: Sequence[str], unit: Unit) -> Agreement:
    """The row of the worst value; values : of both answers, each followed by those of the coarser one."""
    a, coarser_a, b, coarser_b = values
    gap = np.abs(a - b)
    bar_a = np.maximum(np.abs(a - coarser_a), unit.rounding)
    bar_b = np.maximum(error_bar(b - coarser_b, 0.0, (2.0,), FIRST), unit.rounding_of_elements)
    bars = bar_a + bar_b
    disagrees = gap > FACTOR_DISAGREE * bars
    badness = np.where(disagrees, gap / ROUNDING, np.maximum(gap, bars))
    worst = np.argmax(np.nan_to_num(badness, nan=math.inf))
    k = np.unravel_index(worst, badness.shape)
    if np.isfinite(badness[k]):
        bound = _bound_by_error_bars(float(bar_a[k]), float(bar_b[k]))
    else:
        bound = no_bound("a number beyond all bounds")
    return Agreement(quantity, float(gap[k]), bound, where[int(k[0])], required=unit.tolerance, unit=unit.name)


def _bound_by_error_bars(of_catenaries: float, of_elements: float) -> Bound:
    return Bound("error bars", (BoundPart("catenaries", of_catenaries), BoundPart("elements", of_elements)))


def _solved_by_one_row(both: BothAnswers) -> Agreement | None:
    """A row `rest` for positions that one solver alone solves: a disagreement, unless a search did not end."""
    alone = []
    for i, pair in enumerate(zip(both.a.positions, both.b.positions, strict=True), start=1):
        solved = [isinstance(x, LineState) for x in pair]
        if any(solved) and not all(solved):
            alone.append((i, pair))
    if not alone:
        return None
    first, pair = alone[0]
    unfinished = any(isinstance(x, LineNotConverged) for x in pair)
    bound = _bound_by_error_bars(math.inf if unfinished else 0.0, 0.0)
    return Agreement("rest", len(alone), bound, f"position {first}", required=0.0, unit="positions")


def solve_both_refining_elements(line: Line, second: Line, tol: float, tol_tension: float) -> BothAnswers:
    """Both answers, the second line's by elements, which are doubled until their bars are small enough, up to FINEST.

    A position that a solver refuses is not tried again by it; one that both refuse, by none.
    """
    a = line.solve_at_rest(partial(catenary_line.solve, extra_newton_steps=1))
    if not a.states:
        raise no_rest_refusal(a)
    coarser_a = line.solve_at_rest(catenary_line.solve, a.refused)
    n = 4
    coarser_b = second.solve_at_rest(partial(elements.solve, elements=n // 2))
    hopeless = {i: why for i, why in coarser_b.refused.items() if i in a.refused}
    largest_share = 0.5  # of the tolerance, for bars of the elements
    while True:
        b = second.solve_at_rest(partial(elements.solve, elements=n), hopeless)
        both = BothAnswers(a, coarser_a, b, coarser_b, n)
        units = both.units_with_tolerances(tol, tol_tension)
        rows = itertools.chain(worst_state_rows(both, *units), worst_design_number_rows(both, *units))
        coarse = any(
            row.bound.parts[1].value > largest_share * (row.required or 0.0) for row in rows if row.bound.parts
        )
        unsolved = _solved_by_one_row(both) is not None  # finer elements do not help
        if not coarse or unsolved or n >= FINEST:
            return both
        coarser_b = b
        n = 2 * n


def check_line(
    line: Line, tol: float = TOL, tol_tension: float | None = None, second: Line | None = None
) -> RestAnswers:
    """Compare both solvers on a line at rest, and hold its states and printed numbers against the TOML.

    tol : [m];  tol_tension : of the largest tension, default `tol`;  second : a line for the elements alone.
    """
    faults = tolerance_faults(tol, "--tol in m", *TOL_RANGE)
    faults += tolerance_faults(tol_tension, "--tol-tension", *TOL_RANGE)
    if faults:
        raise store.Refused([f"{fault}, of a line at rest" for fault in faults])
    tol_tension = tol if tol_tension is None else tol_tension
    checked = line
    line = with_added_positions(line)
    if second is not None and line is not checked:
        second = second.replace({f"car.{car.name}.at": list(car.at or ()) for car in line.car})
    both = solve_both_refining_elements(line, second or line, tol, tol_tension)
    units = both.units_with_tolerances(tol, tol_tension)
    designs = both.design_numbers_of_each
    result = answer_line(line, rest=both.a)
    result = replace(result, design=_design_with_error_bars(result.design, designs[1], designs[2]))
    rows = [*worst_state_rows(both, *units), *worst_design_number_rows(both, *units)]
    alone = _solved_by_one_row(both)
    if alone is not None:
        rows.append(alone)
    rows += line_laws.statics_law_rows(line.to_toml(), both.a)
    return replace(result, rows=rows + _rows_of_outputs_read_back(result))


def _design_with_error_bars(design: Sequence[Row], coarser: Sequence[Row], other: Sequence[Row]) -> list[Row]:
    """Design numbers with bars: the change from the coarser answer, at least the gap to the other solver."""
    values = [{d["quantity"]: d["value"] for d in x} for x in (coarser, other)]
    out = []
    for d in design:
        bars = [abs(d["value"] - x[d["quantity"]]) for x in values if d["quantity"] in x]
        out.append({**d, "bar": max(bars, default=None)})
    return out


def _rows_of_outputs_read_back(result: RestAnswers) -> list[Agreement]:
    """Write files and page into a temporary folder, read them back, and hold them against the states."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        result.write(folder, 0.0)
        html = "".join(section.html + section.summary for section in page.rest_sections(folder))
        return line_laws.printed_number_rows(result.line.to_toml(), result.rest, folder, html, page.WORDS)


def detectable_relative_changes(result: RestAnswers) -> dict[str, float]:
    """Smallest relative change of each input key that this check would detect in one solver, by catenaries."""
    line = result.line
    base = line.solve_at_rest(catenary_line.solve)
    exact = Unit("m", ROUNDING, ROUNDING, 0.0), Unit("N", ROUNDING, ROUNDING, 0.0)

    def gaps_to(changed_line: Line) -> sensitivities.Gaps:
        changed = changed_line.solve_at_rest(catenary_line.solve)
        rows = worst_state_rows(BothAnswers(base, base, changed, changed), *exact)
        return {(row.quantity, row.law): row.gap for row in rows}

    return sensitivities.detectable_relative_changes_by_gaps(line, result.rows, gaps_to)
