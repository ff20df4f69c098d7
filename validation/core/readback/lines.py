"""What a command printed of a line, and what its outcome says of the motion."""

import re
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from validation.core.readback.limits import LIMIT_VERDICT, expected_limit_scope_sentences, limit_row_faults
from validation.core.readback.stored import (
    Faults,
    Row,
    expected_excess_sentences,
    read_package_toml,
    worst_asked_verdict,
)
from validation.core.readback.texts import plain_text, rows_of_each_table
from validation.core.scene_data import thermal_stretch
from validation.core.stored_files import damaged_files_are_faults, read_csv_columns, read_json

COUNTED = "comparisons of two solvers agree", "laws hold", "kinds of printed numbers are as computed"
TOUCHES = -1e-6  # [m] a rope that ends on the ground does not hit it


@damaged_files_are_faults
def line_terminal_faults(printed: Sequence[str], html_text: str, folder: Path) -> Faults:
    """Faults of what a command printed of a line: rows must stand on its page, sentences be those of the files.

    The tables of the page have readers of their own.  folder : of the line's files, below agreement.json of a check.
    """
    summary = read_json(folder / "summary.json")
    checked = folder.name.endswith("-check")
    judged = read_json(folder.parent / "agreement.json")["rows"] if checked else []
    scene = tomllib.loads((folder / "scene.toml").read_text(encoding="utf-8"))
    sentences = {
        *_sentences_beside_tables(summary, judged),
        *_expected_line_limit_scope_sentences(scene, at_rest="positions" in summary),
    }
    if plain_text(summary["outcome"]) in plain_text(html_text):
        sentences.add(f"{summary['scene']}: {summary['outcome']}")
    texts = {tuple(map(plain_text, re.split(" {2,}", text.strip()))): text.strip() for text in printed}  # by cells
    for rows in rows_of_each_table(html_text):
        filled = [tuple(filter(None, cells)) for cells in rows]
        shown = [texts.pop(cells) for cells in filled if cells in texts]
        sentences.add(f"{len(rows) - len(shown)} more in the report" if shown else "")
    for cells, text in texts.items():
        if re.match(LIMIT_VERDICT, cells[-1]):
            yield from limit_row_faults(cells, summary["limits"])
        elif text.partition("; not so: ")[0] not in sentences:
            yield f"printed: {text!r} is neither on the page nor in the files"


def _sentences_beside_tables(summary: Row, judged: Sequence[Row]) -> Iterator[str]:
    """What is printed beside the tables: verdict, cost, counts of what agrees, positions without rest."""
    seconds = f"{summary['seconds']:.1f} s"
    if "positions" in summary:
        count = summary["positions"]
        yield f"{count} position{'s' if count != 1 else ''} in {seconds}"
        for x in summary["refused"]:
            yield f"position {x['position']}: {x['reason']}"
        yield f"and {len(summary['refused']) - 3} more positions without rest"
    else:
        settings = ", ".join(f"{value} {name}" for name, value in summary["settings"].items())
        method = "" if summary["method"] in summary["settings"] else f"{summary['method']}, "
        yield f"{method}{settings}; {seconds}"
        means = f"forces are means over an axial round trip of the rope, {summary['round_trip']:.2g} s"
        yield f"{means}; path-*.csv and contacts.csv have each time step"
    if judged:
        yield read_package_toml("page", "assets/verdicts.toml")[worst_asked_verdict(judged) or "not comparable"]
        yield "; ".join(_agreement_count_sentences(judged))
        yield from expected_excess_sentences(judged)


def _expected_line_limit_scope_sentences(scene: Row, at_rest: bool) -> Iterator[str]:
    """What the texts of the limits are for, and whether the line is that."""
    cars = scene.get("car", [])
    either = [{car.get("drive", {}).get("mode", "grip") for car in cars}]
    if at_rest:
        either = [{"rest"}]
        if cars:
            either.append({"haul" if car.get("hauled") else "grip" for car in cars})
    yield from expected_limit_scope_sentences(scene.get("limits", {}).get("use", []), *either)
    yield "at the positions in positions.csv; a single car without `at` is also where each number is worst"


def _agreement_count_sentences(judged: Sequence[Row]) -> Iterator[str]:
    """How many comparisons, laws and printed numbers agree."""
    groups: dict[str, list[str]] = {words: [] for words in COUNTED}
    comparisons, laws, printed = COUNTED
    for x in judged:
        words = laws if x["allowed_because"].startswith("law") else comparisons
        groups[printed if x["quantity"] == "printed" else words].append(x["verdict"])
    for words, verdicts in groups.items():
        if verdicts:
            yield f"{verdicts.count('agree')} of {len(verdicts)} {words}"


@damaged_files_are_faults
def moving_line_outcome_faults(folder: Path) -> Faults:
    """Faults of the outcome of a line in motion: its kind, where the cars end, what is hit, the largest tension."""
    return _MovingLine(folder).outcome_faults()


class _MovingLine:
    """What the files of a line in motion say of how its run ends."""

    def __init__(self, folder: Path) -> None:
        self.summary = read_json(folder / "summary.json")
        self.scene = tomllib.loads((folder / "scene.toml").read_text(encoding="utf-8"))
        self.cars: list[Row] = self.scene["car"]
        self.paths = {car["name"]: read_csv_columns(folder / f"path-{car['name']}.csv") for car in self.cars}
        self.design = {number["quantity"]: number for number in self.summary["design"]}
        self.end = max(path["t"][-1] for path in self.paths.values())  # [s]
        drives = {car["name"]: car.get("drive", {}) for car in self.cars}
        self.free = {name: drive for name, drive in drives.items() if drive.get("mode") == "free"}
        self.stops = {name: self._lasting_stop_time(name, drive) for name, drive in drives.items()}
        last = self.summary["events"][-1:]
        self.last_event: str = last[0]["event"] if last and last[0]["t"] >= self.end * (1.0 - 1e-9) else ""

    def _lasting_stop_time(self, name: str, drive: Row) -> float | None:
        """Time [s] of a car's last stop before the end of its path, if it has not moved since."""
        path = self.paths[name]
        before_end = path["t"][-1] * (1.0 - 1e-9)
        of_car = [x["t"] for x in self.summary["events"] if x["event"] == f"{name} stops" and x["t"] < before_end]
        if not of_car:
            return None
        distance = abs(path["s_o"][-1] - np.interp(of_car[-1], path["t"], path["s_o"]))
        return of_car[-1] if distance <= drive.get("rest_distance", 0.01) else None

    def outcome_faults(self) -> Faults:
        """Faults of the kind of outcome, and of its sentence."""
        clearances = [number for name, number in self.design.items() if name.startswith("clearance")]
        hit = [number for number in clearances if _upper_end_of_error_bar(number) < TOUCHES]
        kind = self._expected_outcome_kind(hit)
        if self.summary["outcome_kind"] != kind:
            yield f"outcome: {self.summary['outcome_kind']} where the files say {kind}"
        tension = self.design["tension_max"]
        parts = [f"largest tension {tension['value'] / 1e3:.1f} kN at {tension['t']:.1f} s"]
        for x in hit:
            over = x["quantity"].partition(":")[2].rpartition(" over ")[2]  # the name alone of what the rope hits
            parts.append(f"hits {over} by {-x['value']:.2f} m")
        if self.summary["status"] == "complete":
            parts += self._expected_end_sentences()
            yield from self._early_end_faults()
        for part in parts:
            if part not in self.summary["outcome"]:
                yield f"outcome: {self.summary['outcome']!r} does not say {part!r}"

    def _expected_outcome_kind(self, hit: Sequence[Row]) -> str:
        """The kind of outcome that numbers say, the first that holds, else that of the end."""
        if self.summary["status"] != "complete":
            return "incomplete"
        if "safety_factor_min" in self.design and _upper_end_of_error_bar(self.design["safety_factor_min"]) < 1.0:
            return "breaks"
        return "collides" if hit else self._expected_outcome_kind_at_end()

    def _expected_outcome_kind_at_end(self) -> str:
        """The kind of outcome by the last event, or by who still rolls without one."""
        of_one_ride = len(self.cars) == 1 and self.free
        if self.last_event:
            return self._outcome_kind_of_last_event() if of_one_ride else "ends"
        if not self.free:
            return "arrives"
        if any(self.stops[name] is None for name in self.free):
            return "rolling"
        return self._outcome_kind_of_stop() if of_one_ride else "ends"

    def _early_end_faults(self) -> Faults:
        """Free cars not at rest for an axial round trip in a run that ends before its time without an event."""
        latest = max((drive["end"]["time"] for drive in self.free.values()), default=0.0)
        if self.last_event or self.end >= latest * (1.0 - 1e-9):
            return
        ended = f"the run ends after {self.end:.4g} s of {latest:.4g} s"
        chords_in_rope = 0.9  # at least: the run takes the one for the other under a counterweight
        for name in self.free:
            stop = self.stops[name]
            if stop is None or self.end - stop < chords_in_rope * self.summary["round_trip"]:
                yield f"outcome: {ended}, and {name} is not at rest by then"

    def _outcome_kind_of_stop(self) -> str:
        """The kind of outcome of the one car, which has stopped."""
        (path,) = self.paths.values()
        stretch = thermal_stretch(self.scene["cable"])
        brakes = [stretch * brake["from"] for brake in self.cars[0]["drive"].get("brake", [])]
        return "stopped_by_brake" if path["s_o"][-1] >= min(brakes, default=np.inf) else "stuck"

    def _outcome_kind_of_last_event(self) -> str:
        """The kind of outcome of the one car, which rolls freely."""
        ((name, path),) = self.paths.items()
        ends = [self.scene["contact"][i] for i in (0, -1)]
        distances = {contact["name"]: abs(contact["at"][0] - path["x"][0]) for contact in ends}
        reached = self.last_event.removeprefix(f"{name} reaches ")
        if reached not in distances:
            return "ends"
        return "arrives" if distances[reached] == max(distances.values()) else "rolls_back"

    def _expected_end_sentences(self) -> Iterator[str]:
        """When and how a run ends, where each car is then, and since when if it stays there."""
        for name, path in self.paths.items():
            yield f"{name} at x = {path['x'][-1]:.1f} m"
            stop = self.stops[name]
            if stop is not None:
                yield f"{name} stops at x = {np.interp(stop, path['t'], path['x']):.1f} m after {stop:.1f} s"
        yield f"{self.last_event or 'ends'} after {self.end:.1f} s"


def _upper_end_of_error_bar(number: Row) -> float:
    """Largest possible value of a design number; of an unknown bar the value itself."""
    return float(number["value"] + (number["bar"] or 0.0))
