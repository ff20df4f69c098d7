"""Common parts of commands: arguments, their faults, and how a study runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from validation.core import store
from validation.core.agreement import range_faults
from validation.page import terminal

if TYPE_CHECKING:
    from cablefem.scene import Scene
    from cablefem.scene.line import Line


def parse_float(text: str) -> float:
    """A number; BadParameter for any other text."""
    try:
        return float(text)
    except ValueError:
        raise typer.BadParameter(f"{text!r} is no number") from None


def number_option(name: str, help: str) -> Any:
    return typer.Option(name, parser=parse_float, metavar="X", help=help)


def _parse_folder(text: str) -> Path:
    if not text.strip():
        raise typer.BadParameter(f"{text!r} names no folder; --out . is the one you are in")
    return Path(text)


def out_option(folder: str, more: str = "") -> Any:
    default = store.ROOT / folder
    says = f"Folder for the results{more}. Default: {default}."
    return typer.Option("--out", parser=_parse_folder, metavar="DIR", help=says)


Quick = Annotated[bool, typer.Option("--quick", help="A small part of it, coarsely, within a minute.")]


SceneName = Annotated[str, typer.Argument(metavar="SCENE", help="A built-in scene (cablefem scenes) or a TOML file.")]
Out = Annotated[Path | None, out_option("SCENE", "; they replace those of the same command for another scene")]


def load_scene_printing_notes_or_refuse(
    name: str, earlier_faults: Sequence[str] = (), *, needs_mass: bool = False
) -> Scene:
    """Return the scene and print its notes, or raise Refused with its faults after the earlier ones."""
    from cablefem.scene import Scene, SceneError

    try:
        scene = Scene.load(name)
    except SceneError as error:
        own = [fault if fault.startswith("scene = ") else f"{name}: {fault}" for fault in error.faults]
        raise store.Refused([*earlier_faults, *own]) from None
    faults = list(earlier_faults)
    if needs_mass and scene.mass is None:
        faults.append(f"scene {scene.name} has no [mass] and [travel]: a bare cable is for modes and scenes only")
    if faults:
        raise store.Refused(faults)
    for note in scene.notes:
        terminal.print_text(f"{scene.name}: {note}")
    return scene


def load_line_printing_notes_or_none(name: str) -> Line | None:
    """The line of that name, its notes printed; None if it is a scene of one span; Refused with its faults."""
    from cablefem.scene import SceneError
    from cablefem.scene.short import load_line_or_none

    try:
        line = load_line_or_none(name)
    except SceneError as error:
        raise store.Refused([f"{name}: {fault}" for fault in error.faults]) from None
    if line is not None:
        for note in line.notes:
            terminal.print_text(f"{line.name}: {note}")
    return line


def tolerance_faults(value: float | None, name: str = "--tol", low: float = 1e-6, high: float = 0.2) -> list[str]:
    """Faults of a tolerance, or of another number in [low, high]."""
    return [] if value is None else range_faults(name, value, low, high)


Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUES",
        help="A key of the scene as `scenes --keys` prints it, with its dot (mass.mass, drive.brake.0.force), or a "
        "setting of the method. 40,60 or FROM:TO:COUNT make a grid: 40:80:5 is five values.",
    ),
]  # fmt: skip


LimitNames = Annotated[
    list[str] | None,
    typer.Option(
        "--limits", metavar="NAME", help="Limits of a text (cablefem scenes --limits) beside the scene's own."
    ),
]
RequireLimits = Annotated[
    bool, typer.Option("--require-limits", help="Exit with 1 where a limit is not met or too close to tell.")
]


Cases = Annotated[
    list[str] | None,
    typer.Option("--case", metavar="NAME", help="A load case (cablefem scenes --limits); several make a grid."),
]


def with_limits_of_regulations(scene: Any, regulations: list[str] | None) -> Any:
    """The scene or line with the limits of these regulations beside its own; Refused for an unknown one."""
    from cablefem.scene import SceneError

    if not regulations:
        return scene
    own = () if scene.limits is None else scene.limits.use
    try:
        return scene.replace({"limits.use": list(dict.fromkeys([*own, *regulations]))})
    except SceneError as error:
        raise store.Refused([fault.replace("limits.use", "--limits", 1) for fault in error.faults]) from None


@dataclass(frozen=True, slots=True)
class GridPoint:
    """One point of the grid of --set: its values, its scene, settings of the method."""

    values: dict[str, Any]
    scene: Any  # Scene or Line
    settings: dict[str, Any]


def grid_points_from_options_printing_notes(
    scene: Scene | Line, set_options: list[str] | None, cases: list[str] | None = None
) -> list[GridPoint]:
    """Points of a grid, one without --set and --case; Refused with all faults."""
    from cablefem.scene import SceneError
    from validation.core import grid

    options = list(set_options or [])
    if any(option.partition("=")[0].strip() == "case" for option in options):
        raise store.Refused("--set case: no key of the scene or setting of a method; load cases are given by --case")
    try:
        points = grid.grid_points(options, cases or ())
    except ValueError as error:
        raise store.Refused(str(error)) from None
    out = []
    faults = []
    for values in points:
        changes, settings = changes_and_settings(scene, values)
        source = f"--case {values['case']}" if "case" in values else f"--set {', '.join(changes)}"
        faults += _faults_of_undotted_keys(settings, type(scene))
        try:
            changed = scene.replace(changes) if changes else scene
            out.append(GridPoint(values, changed, settings))
        except (SceneError, ValueError) as error:
            faults += [f"{source}: {fault}" for fault in getattr(error, "faults", [str(error)])]
    if faults:
        raise store.Refused(list(dict.fromkeys(faults)))
    _print_notes_on_changes(scene, [point.scene for point in out])
    return out


def changes_and_settings(scene: Scene | Line, values: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Changes of the scene, those of a load case among them, and settings of the method at a point of a grid."""
    from validation.core import grid

    changes, settings = grid.split_scene_and_method_settings(values)
    if "case" in settings:
        changes = _load_case_changes(settings.pop("case"), scene) | changes
    return changes, settings


def _print_notes_on_changes(scene: Scene | Line, changed: Sequence[Scene | Line]) -> None:
    """Print the notes on changed scenes that the first one, whose notes are printed when it is read, has not."""
    notes = dict.fromkeys(note for x in changed for note in x.notes)
    for note in notes:
        if note not in scene.notes:
            terminal.print_text(f"{scene.name}: {note}")


def line_points_from_options(
    line: Line, set_options: list[str] | None, cases: list[str] | None, one_span_options: dict[str, bool]
) -> list[GridPoint]:  # fmt: skip
    """Points of a grid of lines; Refused for the first option or setting that has a meaning for one span only.

    one_span_options : whether each is given.
    """
    from cablefem.scene.described import OF_ONE_SPAN

    points = grid_points_from_options_printing_notes(line, set_options, cases)
    used = [name for name, is_used in one_span_options.items() if is_used]
    used += [f"--set {name}" for point in points for name in point.settings]
    if used:
        raise store.Refused(f"{used[0]}: {OF_ONE_SPAN}")
    return points


def _load_case_changes(name: str, scene: Scene | Line) -> dict[str, Any]:
    """Keys of a scene and their values in a load case; Refused for one that is unknown."""
    from cablefem.scene.errors import did_you_mean
    from cablefem.scene.limits import CASES

    if name not in CASES:
        raise store.Refused(f"--case {name!r}: unknown.{did_you_mean(name, CASES)}")
    return CASES[name]["set"] | {"title": f"{scene.title}: {CASES[name]['says']}"}


def _faults_of_undotted_keys(settings: Mapping[str, Any], scene_type: type[Any]) -> list[str]:
    """Faults of names that no method has as a setting, but the scene as a key with its dot."""
    if not settings:
        return []
    from cablefem.scene.keys import keys_containing_name_text
    from validation.core.methods import METHODS

    setting_names = {name for method in METHODS.values() for name in method.all_settings}
    hints = {name: keys_containing_name_text(name, scene_type) for name in settings if name not in setting_names}
    return [f"--set {name}: keys of the scene have a dot; {text}" for name, text in hints.items() if text]


@contextmanager
def claim_and_finish_results(out: Path | None, command: str, scene: Scene | str, files: list[str]) -> Iterator[Path]:
    """Claim the folder; after the `with` block mark it finished, and print what was written."""
    folder = store.claim_and_clear_folder(out, command, scene, files)
    yield folder
    store.mark_finished_with_files(folder, command)
    terminal.print_text(f"written to {folder}: {', '.join(files)}")


def run_and_report_study(
    command: str, scene: Scene | Line | str, files: list[str], out: Path | None, study: Callable[..., Any], *inputs: Any
) -> Any:
    """Run a study, write its pages and print their findings.

    study : called with `inputs`, the folder and the progress.
    """
    from validation.page import report

    folder = store.claim_and_clear_folder(out, command, scene, files)
    with terminal.progress_bars() as progress:
        results = study(*inputs, folder, progress)
        report.write_report_and_mark_finished(folder, command)
    report.print_findings(report.read_stored_sections(folder, command))
    stored = [name for name in files if (folder / name).exists()]
    terminal.print_text(f"written to {folder}: report.html, {', '.join(stored)}")
    return results
