from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from validation.page import options, terminal

if TYPE_CHECKING:
    from validation.commands.sweep.study import Study
    from validation.core.sidebyside import Progress

EXAMPLE = "cablefem sweep throughput --workers 2"


def command(
    study: Annotated[str | None, typer.Argument(metavar="STUDY", help="A TOML file or a built-in study.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, metavar="N", help="Processes; default one per core.")] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Address of a Dask: tcp://host:8786.")
    ] = None,
    scene: Annotated[
        int | None, typer.Option(min=0, metavar="I", help="Print scene I as TOML and run nothing.")
    ] = None,
    keys: Annotated[bool, typer.Option("--keys", help="Print all keys of a study file, with units.")] = False,
    csv: Annotated[bool, typer.Option("--csv", help="Write rows.csv as well.")] = False,
    out: Annotated[Path | None, options.out_option("STUDY")] = None,
) -> int:
    """Run a study of many scenes; the same command goes on where it stopped.

    Without a STUDY it lists the built-in ones.
    Writes DIR/: rows/*.parquet, one row per scene; study.toml and report.html.
    """
    from validation.commands.sweep.study import Study, built_in_studies

    if keys:
        return _print_keys()
    if study is None:
        for name in built_in_studies():
            shipped = Study.load(name)
            terminal.print_text(f"{name}: {shipped.title} ({len(shipped)} scenes)")
        return 0
    loaded = Study.load(study)
    if scene is not None:
        _print_scene(loaded, scene)
        return 0

    from validation.commands.sweep import engine

    def sweep_and_read(folder: Path, progress: Progress) -> tuple[engine.Tally, Any]:
        tally = engine.sweep(loaded, folder, workers=workers, scheduler=scheduler, progress=progress)
        rows = engine.read_rows(folder)
        if csv:
            rows.to_csv(folder / "rows.csv")
        return tally, rows

    writes = [*engine.WRITES, *(["rows.csv"] if csv else [])]
    tally, rows = options.run_and_report_study("sweep", loaded.name, writes, out, sweep_and_read)
    terminal.print_text(f"{tally.status.total()} scenes in this call, {tally.scenes_per_second:.3g} per second")
    return _print_outcomes(rows, checked=loaded.job in ("check", "power"))


def _print_keys() -> int:
    from validation.core import store

    keys = store.read_packaged_toml(__package__, "keys.toml")
    groups = keys.pop("groups")
    terminal.print_table(["key", "unit", "meaning", "default"], [[name, *texts] for name, texts in keys.items()])
    terminal.print_text()
    terminal.print_table(["axis", "unit", "meaning"], [[name, *texts] for name, texts in groups.items()])
    return 0


def _print_scene(study: Study, index: int) -> None:
    """Print the TOML of a scene of a study, after the command that answers it alone."""
    point = study.point(index)
    toml = study.scene_at(point).to_toml()
    print(f"# scene {index} of {study.name}: cablefem {_command_of_point(study, point)}")
    print(toml, end="")


def _command_of_point(study: Study, point: dict[str, Any]) -> str:
    """The command, with its options, that does the job of a study on one scene."""
    from validation.core.methods import find_method

    given = study.run_options(point)
    words = ["check" if study.job == "power" else study.job, "SCENE.toml"]
    words += [f"--{name} {value}" for name, value in given.items()]
    if study.job == "power":
        _, fault = study.scene_and_fault_key(point)
        words += [] if fault is None else [f"--second-set {fault}=+1%"]
    elif "method" in given:
        known = find_method(given["method"]).all_settings
        words += [f"--set {name}={value}" for name, value in study.settings.items() if name in known]
    return " ".join(words)


def _print_outcomes(rows: Any, *, checked: bool) -> int:
    """Print the counts of outcomes and verdicts, and the first scene without an answer; return the exit code.

    checked : by two solvers.  1 for a scene without an answer, or where they do not agree on a sound one; 2 where all
    scenes are refused.
    """
    from validation.commands.sweep.job import reason_on_one_line

    terminal.print_text(_word_counts_text(rows["status"]))
    sound = rows["fault"].isna() | (rows["fault"] == "none")
    for part, words in ((rows[sound], ""), (rows[~sound], "with a planted fault: ")):
        if part["verdict"].notna().any():
            terminal.print_text(f"{words}{_word_counts_text(part['verdict'])}")
    unanswered = rows[~rows["status"].isin(("complete", "incomplete"))]
    for index, first in unanswered.head(1).iterrows():
        terminal.print_text(f"scene {index}, {first['status']}: {reason_on_one_line(first['status'], first['reason'])}")
    refused = rows["status"] == "refused"
    if refused.all():
        return 2
    differ = checked and (sound & rows["verdict"].notna() & (rows["verdict"] != "agree")).any()
    return int((unanswered["status"] != "refused").any() or differ)


def _word_counts_text(words: Any) -> str:
    """How often each word occurs, most frequent first."""
    return ", ".join(f"{n} {word}" for word, n in words.value_counts().items())
