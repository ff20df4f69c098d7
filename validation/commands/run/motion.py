"""A line in motion: its runs, its numbers, its outcome and its files."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, Literal

import numpy as np

from cablefem import catenary_line
from cablefem.elements.system import LineElements
from cablefem.motion import CarMotion, ContactMotion, LineMotion, join_motions_in_time
from cablefem.newmark import Scheme, State, StepFailure, Work, integrate_blocks, scheme
from cablefem.response import Array, write_csv, write_json, write_text
from cablefem.scene.contacts import AT_REST, Car, MovingLine
from cablefem.scene.line import Line, LineState
from cablefem.scene.moving import line_in_motion
from galerkin.lines import LineSines
from validation.commands.run.lines import TOUCHES, LineAnswers
from validation.core import motion_laws, store
from validation.core.agreement import Agreement
from validation.core.answers import STATIONS, Outcome
from validation.core.clearances import rope_depths
from validation.core.ladder import ROUNDING, Branch, Ladder
from validation.core.motion_rows import (
    LineRun,
    design_with_error_bars,
    turning_and_wheel_load_series,
)
from validation.core.readback import (
    limit_faults,
    limit_table_faults,
    motion_design_table_faults,
    moving_line_outcome_faults,
    rope_csv_and_side_view_faults,
)
from validation.core.sidebyside import Progress, map_in_parallel, no_progress
from validation.core.wheels import approximate_pitch_period, with_wheel_loads_by_hand
from validation.page import terminal
from validation.page.line import print_line_summary
from validation.page.motion import (
    TABLE_QUANTITIES,
    comparison_words,
    design_number_rows,
    line_averaging_time_sentence,
    motion_unit,
)

Factors = tuple[int, int]  # of the coarsest resolution, and of the fewest steps
Events = Sequence[tuple[str, float]]  # name and time [s]

ALMOST = 1.0 - 1e-9  # of a time: it is that time


@dataclass(frozen=True, slots=True)
class LineMethod:
    """A solver of lines in motion: its system with a resolution, and the coarsest one."""

    name: str
    setting: str
    coarsest: int
    on_wave: float  # coarsest resolution on the length of a wave; four times it leaves 0.1 % of the pitch
    system: Callable[[MovingLine, int], Any]
    scheme: str = "radau"  # see `cablefem.newmark.scheme`


ELEMENTS = LineMethod("elements", "elements", 2, 0.6, lambda line, n: LineElements(line, elements=n, degree=4))
SINES = LineMethod("sines", "terms", 3, 0.9, LineSines)


def shortest_time_on_rail(system: Any, state: State) -> float:
    """[s] that cars on rails need for them at their present speed, the shortest; 0 without."""
    times = []
    for car in system.line.all_cars:
        if car.rail is not None:
            length = car.rail.end.x - car.rail.begin.x
            speed = system.car_point_and_rates(car.name, state)[1, 0]
            times.append(abs(length / speed))
    return float(min(times, default=0.0))


def time_of_timetables(line: MovingLine) -> float:
    """When the last car with a travel comes to rest [s]; inf without one."""
    last = 0.0
    for travel in (car.travel for car in line.cars_on_rope if car.travel is not None):
        for phase, (t0, t1) in enumerate(travel.phases):
            if any(travel.position_with_rates(t, phase)[1] for t in (t0, 0.5 * (t0 + t1))):
                last = max(last, t1)
    return last or math.inf


def estimated_free_crossing_time(line: MovingLine, empty: LineState) -> float:
    """About the shortest time [s] in which a free car crosses the longest span; inf without one.

    Its speed is that of a fall from the highest support to the lowest point of the rope below it, with its thrust.
    """
    span = float(np.diff(empty.points[:, 0]).max())
    fall = float(np.ptp(np.concatenate([empty.points[:, 1], empty.middle[:, 1]])))
    N = float(np.nanmin(empty.station_tensions))
    speed = 0.0
    for car in line.cars_on_rope:
        if car.drive_mode_or_haul_x == "free":
            deflection = car.mass * line.gravity * span / (4.0 * N)
            thrust = max((abs(force) for _, force in car.drive.thrust_table), default=0.0)
            work = line.gravity * (fall + deflection) + thrust * span / car.mass  # over the mass
            speed = max(speed, math.sqrt(2.0 * work))
    return span / speed if speed else math.inf


def shoe_holds_down_sentences(line: Line, motion: LineMotion) -> list[str]:
    """Where a shoe would have to hold a car down, and which speed or length of the shoe would do without.

    The share of its force that the turn of the path takes grows with the speed squared, and falls with the length.
    """
    out = []
    shoes = [(c.at[0], c.shoe, c.name) for c in line.contact if c.shoe is not None]
    light = 0.01  # of its weight: a shoe that pulls a car down by less
    for car, table in zip(motion.cars, line.car, strict=True):
        i = int(np.argmin(car.shoe_force))
        down = -car.shoe_force[i] / (table.mass * line.gravity)
        if down < light:
            continue
        x = car.point[i, 0]
        _, shoe, name = min(shoes, key=lambda at: abs(at[0] - x))
        lifted = car.shoe_force < 0.0
        vx, vy = car.velocity[lifted].T
        ax, ay = car.acceleration[lifted].T
        turn = table.mass * np.sign(vx) * (vx * ay - vy * ax) / np.hypot(vx, vy)  # down
        share = float(np.min(1.0 + car.shoe_force[lifted] / turn))
        enough = "no speed would do without"
        if share > 0.0:
            slower = math.floor(100.0 * math.sqrt(share))
            enough = f"about {slower} % of its speed or a shoe of {math.ceil(shoe / share)} m would do without"
        where = f"at x = {x:.1f} m (F_shoe in path-{car.name}.csv)"
        held = f"the shoe of {name} would have to hold the car '{car.name}' down with {down:.2f} of its weight"
        out.append(f"{held} {where}; {enough}")
    return out


def faster_than_waves_sentences(line: Line, motion: LineMotion) -> list[str]:
    """Cars that are faster than transverse waves, of speed sqrt(N/rho), and from where on."""
    rho = line.cable.mass_per_length + line.cable.ice_mass_per_length
    out = []
    for car in motion.cars:
        tension = np.fmin(car.tension_behind, car.tension_ahead)
        fast = np.flatnonzero(rho * car.ds**2 > tension)
        if fast.size:
            waves = f"faster than transverse waves from x = {car.point[fast[0], 0]:.1f} m on"
            out.append(f"{car.name} is {waves}, where error bars are no bound")
    return out


def events_without_rattling(events: Events, line: MovingLine, motion: LineMotion) -> tuple[tuple[str, float], ...]:
    """Events, name and time, without the end at rest and those of cars that stay within `rest_distance` of their stop.

    Waves in an undamped rope rattle a car that friction holds by 1e-5 m, at times that do not converge.
    """
    rattling = {i for i, (name, _) in enumerate(events) if name == AT_REST}
    for car in line.cars_on_rope:
        rattling |= _rattling_events(events, car, motion)
    return tuple(event for i, event in enumerate(events) if i not in rattling)


def _rattling_events(events: Events, car: Car, motion: LineMotion) -> set[int]:
    """Indices of the events of one car that leave it within `rest_distance` of where it came to rest."""
    s = next(moved for moved in motion.cars if moved.name == car.name).s
    own = _indexed_stops_and_starts(events, car.name, motion.t, s)
    rattling = set[int]()
    rest = float(s[0])
    rested = False
    for i, stops, rests_at in own:
        moves = abs(rests_at - rest) > car.drive.rest_distance
        stays = not rested and i == own[-1][0]
        lasts = moves or stays if stops else moves and rested
        if not lasts:
            rattling.add(i)
        elif stops:
            rest = rests_at
            rested = True
    return rattling


def _indexed_stops_and_starts(events: Events, name: str, t: Array, s: Array) -> list[tuple[int, bool, float]]:
    """Events of a car: index among all, whether it stops or breaks loose, and where it stops, or will stop next.

    t, s : times and positions of the car (n,).
    """
    kinds = {f"{name} stops": True, f"{name} breaks loose": False}
    own = [(i, kinds[event], time) for i, (event, time) in enumerate(events) if event in kinds]
    at_events = np.interp([time for _, _, time in own], t, s)
    positions = [*at_events.tolist(), float(s[-1])]
    return [(i, stops, positions[n] if stops else positions[n + 1]) for n, (i, stops, _) in enumerate(own)]


def factors_of_coarser_runs(space_factor: int, time_factor: int) -> tuple[list[Factors], list[Factors]]:
    """Factors of the coarser runs: half and quarter of the resolution, and of the steps."""
    in_space = [(space_factor // k, time_factor) for k in (2, 4) if space_factor >= k]
    in_time = [(space_factor, time_factor // k) for k in (2, 4) if time_factor >= k]
    return in_space, in_time


def run_ladders(solvers: Sequence[LineRuns], space_factor: int, time_factor: int, report: Progress) -> None:
    """Make the runs of the ladders of several solvers in parallel, the finest first, and store them in the solvers."""
    in_space, in_time = factors_of_coarser_runs(space_factor, time_factor)
    factors = [(space_factor, time_factor), *in_time, *in_space]
    missing = [(solver, x) for x in factors for solver in reversed(solvers) if x not in solver.known]

    def store_run(i: int, run: LineRun) -> None:
        solver, x = missing[i]
        solver.known[x] = run
        done = sum(at in of.known for of, at in missing)
        report(done / len(missing), f"{done} of {len(missing)} runs")

    map_in_parallel(lambda item: item[0].run(*item[1]), missing, store_run)


def merge_instants(grid: Array, finer: Array) -> Array:
    """The instants of a grid with those inside it of a finer one; of two that differ by rounding, the first grid's.

    A step of a rounding error has no extrapolation to the next one.
    """
    rounding = 1e-9 * (grid[1] - grid[0])
    distances = np.abs(finer[:, None] - grid).min(axis=1)
    inside = (finer > grid[0]) & (finer < grid[-1])
    return np.union1d(grid, finer[inside & (distances > rounding)])


class OutOfTime(RuntimeError):
    """A run was cut, for it took longer than it was given."""


def append_marched_states(
    states: list[State], system: Any, chosen: Scheme, steps: list[Array], work: Work, cut_at: float
) -> None:
    """March a system on from the last state, or from its start, up to an event that ends it; append its states.

    Where forces jump, the states before and after the jump are appended.
    Raises OutOfTime at the first step after `cut_at`, by `perf_counter` [s].
    """
    noted = len(work.events)
    start = states[-1] if states else None
    for group in integrate_blocks(system, chosen, steps, work=work, start=start):
        if perf_counter() > cut_at:
            raise OutOfTime
        if len(work.events) > noted and work.after_event is not None:
            states.append(work.after_event)
        noted = len(work.events)
        for x in group:
            if states and x.phase > states[-1].phase:
                states.append(system.start(x.phase, states[-1]))
            _drop_instants_within_rounding_before(states, x.t)
            states.append(x)


def _drop_instants_within_rounding_before(states: list[State], t: float) -> None:
    """Drop last states less than rounding before the time t [s] of an event, but not the first one.

    The spline of a mean has no slope between two such instants.
    """
    while len(states) > 1 and 0.0 < t - states[-1].t <= ROUNDING * t:
        states.pop()


class LineRuns:
    """Runs of one method on a line, each made once."""

    def __init__(self, method: LineMethod, line: Line, like: LineRuns | None = None, coarser: float = 1.0) -> None:
        """like : runs to be compared with, at whose instants these step, too.

        coarser : times in space and time than what a car that pitches needs.
        """
        self.method = method
        self.table = line
        self.line = line_in_motion(line, catenary_line.solve)
        empty = line.solve_empty_line(catenary_line.solve)
        rope = self.line.rope
        thermal_stretch = 1.0 + line.cable.thermal_strain
        self.length = rope.length or float(np.ptp(empty.s)) * thermal_stretch
        self.period = 2.0 * self.length * math.sqrt(rope.mass_per_length / rope.EA)
        N = float(np.nanmax(empty.station_tensions))
        wheels = [(car.wheels, car.mass) for car in self.line.cars_on_rope if car.wheels is not None]
        pitches = [approximate_pitch_period(pair, mass, N) for pair, mass in wheels]
        shortest = min(pitches, default=math.inf)
        # a car that pitches sends waves along the rope, which damp it: a rope too coarse for them lets it ring
        longest_span = float(np.diff(empty.s).max()) * thermal_stretch
        speed = math.sqrt(N / rope.mass_per_length)
        waves = min(longest_span / (speed * shortest), 40.0)  # more take hours
        self.coarsest = max(method.coarsest, math.ceil(method.on_wave * waves / coarser))
        phases = self.line.phases
        if like is None:
            # coarsest steps: 120 in a run, 60 until all timetables stand still, 40 while the fastest free car crosses a
            # span, 4 in a period of the pitch
            crossing = estimated_free_crossing_time(self.line, empty)
            travel = time_of_timetables(self.line)
            rate = max(120 / self.line.t_end, 60 / travel, 40 / crossing, 4.0 / (shortest * coarser))
            self.grid = [np.linspace(t0, t1, max(2, math.ceil(rate * (t1 - t0))) + 1) for t0, t1 in phases]
            self.instants = np.unique(np.concatenate(self.grid))
        else:
            self.grid = [np.unique([t0, t1, *like.instants_between(t0, t1)]) for t0, t1 in phases]
            self.instants = like.instants_between(0.0, self.line.t_end)
        self.line = replace(self.line, longest_step=max(float(np.diff(t).max()) for t in self.grid))
        self.fewest_steps = sum(t.size - 1 for t in self.grid)
        self.known: dict[Factors, LineRun] = {}  # runs made so far, by `run`'s arguments
        self.cut_at = math.inf  # see `append_marched_states`

    def instants_between(self, t0: float, t1: float) -> Array:
        """Instants from t0 to t1."""
        return self.instants[(self.instants >= t0) & (self.instants <= t1)]

    def run(self, space_factor: int, time_factor: int) -> LineRun:
        """The run with multiples of the coarsest resolution and of the fewest steps, made once."""
        factors = space_factor, time_factor
        if factors not in self.known:
            self.known[factors] = self._compute_run(*factors)
        return self.known[factors]

    def ladder(self, space_factor: int, time_factor: int) -> Ladder:
        """The run, half and quarter in space and in time; no quarter of 2."""
        branches = []
        order = 4.0  # credited to refinement in space and time, at most
        for settings in factors_of_coarser_runs(space_factor, time_factor):
            runs: list[Any] = [self.run(*setting) for setting in settings]
            branches.append(Branch(tuple(runs), (2.0,) * len(runs), order))
        finest: Any = self.run(space_factor, time_factor)
        return Ladder(finest, *branches)

    def _compute_run(self, space_factor: int, time_factor: int) -> LineRun:
        """March from system to system, a new one wherever a car comes to other contacts."""
        n = space_factor * self.coarsest
        system = self.method.system(self.line, n)
        n_dof = system.n_dof
        grid = []
        for t in self.grid:
            shares = np.arange(time_factor * (t.size - 1) + 1) / time_factor
            grid.append(np.interp(shares, np.arange(t.size), t))
        origin = self.line.rope.length if self.line.rope.length is not None else self.length
        s = np.linspace(origin - self.length, origin, 101)  # stations
        work = Work()
        parts: list[LineMotion] = []
        states: list[State] = []
        start: State | None = None
        steps = grid
        steps_on_rail = 6  # coarsest steps of a car on a rail over a shoe
        shares_of_rail = np.linspace(0.0, 2.0, 2 * steps_on_rail * time_factor + 1)
        seconds = 0.0
        while True:
            begin = process_time()
            marched, following, reason = self._march_one_system(system, start, steps, work)
            seconds += process_time() - begin
            parts.append(system.observe(marched, s))
            states += marched
            if following is None:
                break
            system, start = following
            finer = start.t + shortest_time_on_rail(system, start) * shares_of_rail
            steps = [merge_instants(t, finer) for t in grid]
        motion = join_motions_in_time(parts)
        events = [(event.name, event.t) for event in work.events]
        return LineRun(
            method=self.method.name,
            settings={self.method.setting: n, "steps": time_factor * self.fewest_steps},
            motion=with_wheel_loads_by_hand(motion, self.table, self.line, states),
            events=events_without_rattling(events, self.line, motion),
            reason=reason,
            period=self.period,
            instants=self.instants,
            n_dof=n_dof,
            work=work,
            seconds=seconds,
        )

    def _march_one_system(
        self, system: Any, start: State | None, steps: list[Array], work: Work
    ) -> tuple[list[State], tuple[Any, State] | None, str | None]:
        """States of a system from one on, or from its start; the system after its end, with its state; why it broke.

        Refused where it does not begin.
        """
        states: list[State] = [] if start is None else [start]
        try:
            append_marched_states(states, system, scheme(self.method.scheme), steps, work, self.cut_at)
            following = None
            if work.events and states[-1].t < self.line.t_end:
                following = system.system_after_event_or_none(work.events[-1].name, states[-1])
        except StepFailure as error:
            if len(states) < 2 and start is None:
                raise store.Refused(f"{self.method.name}: {error}") from None
            return states, None, str(error)
        return states, following, None


@dataclass(frozen=True, kw_only=True, repr=False)
class MotionAnswers(LineAnswers):
    """A line in motion and its numbers; of a check also the other method and the judged rows."""

    moved: LineRun
    empty: LineState
    other: LineRun | None = None

    @property
    def t(self) -> Array:
        return self.moved.motion.t

    @property
    def cars(self) -> tuple[CarMotion, ...]:
        return self.moved.motion.cars

    @property
    def contacts(self) -> tuple[ContactMotion, ...]:
        return self.moved.motion.contacts

    @property
    def motion(self) -> LineMotion:
        return self.moved.motion

    @property
    def status(self) -> Literal["complete", "incomplete"]:
        return "complete" if self.moved.reason is None else "incomplete"

    @property
    def outcome(self) -> Outcome:
        """Kinds: incomplete, breaks, collides, how the ride ends; the first that holds."""
        parts = []
        if self.moved.reason is not None:
            parts.append(Outcome("incomplete", f"the run broke: {self.moved.reason}"))
        failures, doubts = self._failures_and_doubts()
        parts += failures
        end = self._end_outcome_unless_broken()
        if end is not None:
            parts.append(end)
        sentences = shoe_holds_down_sentences(self.line, self.motion)
        sentences += faster_than_waves_sentences(self.line, self.motion)
        sentences += [*doubts, *(part.sentence for part in parts)]
        largest = self.tension_max
        sentences.append(f"largest tension {largest['value'] / 1e3:.1f} kN at {largest['t']:.1f} s")
        return Outcome(parts[0].kind, "; ".join(sentences))

    def _failures_and_doubts(self) -> tuple[list[Outcome], list[str]]:
        """Whether the rope breaks and what is hit, the deepest first; and sentences on what is too close to tell."""
        failures = []
        doubts = []
        judged = [d for d in self.design if d["quantity"].startswith(("safety_factor", "clearance"))]
        for d in sorted(judged, key=lambda d: (d["quantity"].startswith("clearance"), d["value"])):
            body, _, obstacle = d["quantity"].partition(":")[2].rpartition(" over ")
            body = body or "the rope"
            bar = d["bar"] or 0.0
            limit = TOUCHES if obstacle else 1.0
            if d["value"] + bar < limit:
                failures.append(self._break_or_collision(body, obstacle, d["value"]))
            elif d["value"] - bar < limit:
                doubts.append(f"too close to tell whether {body} {f'clears {obstacle}' if obstacle else 'breaks'}")
        return failures, doubts

    def _break_or_collision(self, body: str, obstacle: str, clearance: float) -> Outcome:
        """That a body hits an obstacle, by a clearance [m] below 0; that the rope breaks for an obstacle ""."""
        if obstacle:
            return Outcome("collides", f"would collide: {body} hits {obstacle} by {-clearance:.2f} m")
        strength = f"{(self.line.cable.breaking_load or 0.0) / 1e3:.1f} kN"
        return Outcome("breaks", f"{body} is loaded beyond its breaking load of {strength}")

    def _end_outcome_unless_broken(self) -> Outcome | None:
        """How the run ends; None for one that broke."""
        run = self.moved
        positions = ", ".join(f"{car.name} at x = {car.point[-1, 0]:.1f} m" for car in self.cars)
        before = "".join(f"{sentence}; " for sentence in self._earlier_stop_sentences())
        if run.events and run.events[-1][1] >= run.end_time * ALMOST:
            name, t = run.events[-1]
            early = run.end_time < run.instants[-1] * ALMOST
            whose = "for all cars " if len(self.cars) > 1 else ""
            sentence = f"{before}{name} after {t:.1f} s with {positions}"
            kind = self._outcome_kind_of_end_event(name)
            return Outcome(kind, f"{sentence}; this ends the run {whose}early" if early else sentence)
        if run.reason is not None:
            return None
        return Outcome(
            self._outcome_kind_without_end_event(), f"{before}ends after {run.end_time:.1f} s with {positions}"
        )

    def _outcome_kind_without_end_event(self) -> str:
        """The kind of outcome where time ends the run, or rest does."""
        free = [car for car in self.line.car if car.mode == "free"]
        if not free:
            return "arrives"
        if len(free) > len(list(self._earlier_stop_sentences())):
            return "rolling"
        drive = free[0].drive
        if len(self.cars) > 1 or drive is None:
            return "ends"
        stretch = 1.0 + self.line.cable.thermal_strain
        brakes = [stretch * brake.position for brake in drive.brake]
        return "stopped_by_brake" if self.cars[0].s[-1] >= min(brakes, default=math.inf) else "stuck"

    def _outcome_kind_of_end_event(self, event: str) -> str:
        """The kind of outcome of an event at the end: of one free car as on one span, else "ends"."""
        if len(self.cars) > 1 or self.line.car[0].mode == "grip":
            return "ends"
        car = self.cars[0]
        left, right = self.line.contact[0], self.line.contact[-1]
        near, far = (left, right) if 2.0 * car.point[0, 0] < left.at[0] + right.at[0] else (right, left)
        return {f"{car.name} reaches {far.name}": "arrives", f"{car.name} reaches {near.name}": "rolls_back"}.get(
            event, "ends"
        )

    def _earlier_stop_sentences(self) -> Iterator[str]:
        """Where and when cars that stay to the end have stopped before it."""
        t = self.t
        before_end = t[-1] * ALMOST
        for car, table in zip(self.cars, self.line.car, strict=True):
            stops = [time for name, time in self.moved.events if name == f"{car.name} stops" and time < before_end]
            if not stops or table.drive is None:
                continue
            last = stops[-1]
            s = float(np.interp(last, t, car.s))
            if abs(s - car.s[-1]) <= table.drive.rest_distance:
                x = float(np.interp(last, t, car.point[:, 0]))
                yield f"{car.name} stops at x = {x:.1f} m after {last:.1f} s"

    @property
    def methods(self) -> list[str]:
        """Names of both solvers."""
        return [self.moved.method, "" if self.other is None else self.other.method]

    @property
    def path_scale(self) -> float:
        """Largest deflection of a car [m]."""
        return largest_car_deflection(self.line, self.empty, self.motion)

    def write(self, folder: Path | str, seconds: float | None = None) -> None:
        """Write path-NAME.csv, contacts.csv, profile.csv, rope.csv, summary.json and scene.toml."""
        folder = Path(folder)
        self._write_paths(folder)
        self._write_contacts(folder)
        self._write_profile(folder)
        self._write_rope(folder)
        write_text(folder / "scene.toml", self.line.to_toml())
        line = self.line
        moved = self.moved
        outcome = self.outcome
        events = [{"event": name, "t": t} for name, t in moved.events]
        summary = {
            "scene": line.name, "title": line.title, "method": moved.method, "settings": moved.settings,
            "status": self.status, "reason": moved.reason, "outcome": outcome.sentence, "outcome_kind": outcome.kind,
            "events": events, "design": self.design, "limits": self.limits, "round_trip": moved.period,
            "n_dof": moved.n_dof, "steps": moved.work.steps, "seconds": seconds,
        }  # fmt: skip
        write_json(folder / "summary.json", store.nulls_for_nonfinite(summary))

    def _write_paths(self, folder: Path) -> None:
        """Write path-NAME.csv of each car."""
        for car in self.cars:
            w = car_deflections(self.line, self.empty, car)
            columns = {"t": self.t, "s_o": car.s, "x": car.point[:, 0], "y": car.point[:, 1]}
            columns |= {"u": w[:, 0], "v": w[:, 1], "T_behind": car.tension_behind, "T_ahead": car.tension_ahead}
            columns["speed"] = np.hypot(*car.velocity.T)
            columns |= {"F_haul": car.haul_force, "F_contact": car.contact_force}
            columns |= turning_and_wheel_load_series(car)
            if car.shoe_force.any():
                columns["F_shoe"] = car.shoe_force
            write_csv(folder / f"path-{car.name}.csv", columns)

    def _write_contacts(self, folder: Path) -> None:
        columns = {"t": self.t}
        for x in self.contacts:
            tension = motion_laws.tension_behind_or_ahead(x)
            of_contact = {"s": x.s, "tension": tension, "pressure": np.hypot(*x.pressure.T), "rise": x.rise}
            columns |= {f"{x.name}.{name}": values for name, values in of_contact.items()}
        write_csv(folder / "contacts.csv", columns)

    def _write_profile(self, folder: Path) -> None:
        """Write profile.csv: over x the empty rope, and the extremes of depth over all time."""
        x = np.linspace(0.0, self.line.contact[-1].at[0], STATIONS)
        depths = rope_depths(motion_laws.rope_chain(self.motion).points, x)  # (n, STATIONS)
        rest = catenary_line.depth_and_tension_at_x(self.empty, x)[0]
        columns = {"x": x, "y_rest": rest, "y_highest": depths.min(axis=0), "y_lowest": depths.max(axis=0)}
        write_csv(folder / "profile.csv", columns)

    def _write_rope(self, folder: Path) -> None:
        """Write rope.csv: points and tension of every second station in some frames."""
        motion = self.motion
        count = 101  # frames, at most
        times = np.linspace(motion.t[0], motion.t[-1], count)
        frames = np.unique(np.searchsorted(motion.t, times))
        s = motion.s[::2]
        x, y = np.moveaxis(motion.points[frames, ::2], 2, 0)  # (frames, stations)
        columns = {"t": np.repeat(motion.t[frames], s.size), "s": np.tile(s, frames.size), "x": x.ravel()}
        columns |= {"y": y.ravel(), "T": motion.tension[frames, ::2].ravel()}
        write_csv(folder / "rope.csv", columns)

    def comparison_in_words(self, row: Agreement) -> str:
        """What a row compares."""
        return comparison_words(row.quantity, row.law)

    def output_faults(self, folder: Path, html: str) -> list[str]:
        table = tomllib.loads(self.line.to_toml())
        out = list(motion_laws.faults_of_line_files(folder, self.motion, self.design, self.moved.period))
        out += limit_faults(self.limits, table, self.design, ())
        out += limit_table_faults(html, self.limits)
        out += motion_design_table_faults(html, self.design)
        out += rope_csv_and_side_view_faults(html, folder, self.motion)
        out += moving_line_outcome_faults(folder)
        return out

    def print_answer(self, seconds: float) -> None:
        """Print outcome, limits and the most important design numbers."""
        few = [d for d in self.design if d["quantity"].partition(":")[0] in TABLE_QUANTITIES]
        moving = [d for d in few if d["value"]]  # a counterweight only sinks: its largest rise is 0
        printed = design_number_rows(moving)
        print_line_summary(self.line, self.outcome.sentence, self.limits, printed, len(self.design))
        terminal.print_text(
            f"  {line_averaging_time_sentence(self.moved.period)}; path-*.csv and contacts.csv have each time step"
        )
        settings = self.moved.settings
        words = [f"{value} {name}" for name, value in settings.items()]
        if self.moved.method not in settings:
            words.insert(0, self.moved.method)
        terminal.print_text(f"  {', '.join(words)}; {seconds:.1f} s")


def answer_line(line: Line, *, report: Progress = no_progress) -> MotionAnswers:
    """Run a line in motion on elements, with bars from coarser runs; in more steps where too few break one."""
    runs = LineRuns(ELEMENTS, line)
    steps = 2
    run_ladders([runs], 2, steps, report)
    while steps < 8 and any(runs.run(2, n).reason for n in (steps, steps // 2)):
        steps *= 2
        run_ladders([runs], 2, steps, report)
    return motion_answers(line, runs.ladder(2, steps), None)


def motion_answers(line: Line, a: Ladder, b: Ladder | None, rows: Sequence[Agreement] = ()) -> MotionAnswers:
    """The answers of ladder a with bars from its coarser runs; b : the other method's ladder, if there is one."""
    finest: Any = a.finest
    other: Any = None if b is None else b.finest
    design = design_with_error_bars(a, b, line, motion_unit)
    empty = line.solve_empty_line(catenary_line.solve)
    return MotionAnswers(line=line, moved=finest, empty=empty, design=design, other=other, rows=list(rows))


def largest_car_deflection(line: Line, empty: LineState, motion: LineMotion) -> float:
    """Largest distance of a car from its point of the empty rope [m]; 1 without cars."""
    deflections = [np.hypot(*car_deflections(line, empty, car).T) for car in motion.cars]
    return max((float(w.max()) for w in deflections), default=1.0)


def car_deflections(line: Line, empty: LineState, car: CarMotion) -> Array:
    """How far (n, 2) [m] a car is from its point of the empty rope."""
    s = car.s / (1.0 + line.cable.thermal_strain)
    return car.point - empty_rope_points(empty, s)


def empty_rope_points(empty: LineState, s: Array) -> Array:
    """Points (n, 2) [m] of the empty rope at s (n,) [m] of it."""
    inner = np.clip(s, empty.s[0], empty.s[-1])
    k = np.searchsorted(empty.s[1:-1], inner, side="right")  # pieces (n,)
    lengths = inner - empty.s[k]
    chords = catenary_line.piece_chord_vectors(empty.ahead[k][:, :, None], lengths[:, None], empty.case)
    return empty.points[k] + chords[..., 0]
