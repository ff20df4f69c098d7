"""`cablefem sweep`: thousands of scenes on all cores, or on a cluster that runs; killed at any moment, it goes on."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from validation.core import store
from validation.page import terminal

if TYPE_CHECKING:
    from validation.commands.sweep.study import Study

EXAMPLE = "cablefem sweep throughput --workers 2"


def command(
    study: Annotated[
        str | None, typer.Argument(metavar="STUDY", help="A TOML file, or a built-in study; none lists them.")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Worker processes on this machine; default one per core.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="A Dask scheduler that runs, e.g. tcp://host:8786.")
    ] = None,
    scene: Annotated[
        int | None, typer.Option(min=0, metavar="I", help="Print scene I as TOML and what was run on it; run nothing.")
    ] = None,
    csv: Annotated[bool, typer.Option("--csv", help="Write rows.csv as well.")] = False,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help=f"Folder for the results. Default: {store.ROOT}/STUDY.")
    ] = None,
) -> int:
    """Run a study of many scenes; given again it goes on where it stopped.

    Writes DIR/: rows/*.parquet, one row per scene; study.toml, sweep.json and report.html.
    """
    from validation.commands.sweep.study import Study, built_in

    if study is None:
        for name in built_in():
            asked = Study.load(name)
            terminal.say(f"{name}: {asked.title} ({len(asked)} scenes)")
        return 0
    asked = Study.load(study)
    if scene is not None:
        _print(asked, scene)
        return 0

    from validation.commands.sweep import engine

    folder = store.ROOT / asked.name if out is None else out
    if folder.is_dir() and any(folder.iterdir()) and not (folder / "rows").is_dir():
        raise store.Refused(f"{folder} is not empty and holds no sweep; nothing was written; choose another with --out")
    with terminal.progress() as progress:

        def told(tally: engine.Tally) -> None:
            progress("sweep", tally.done / tally.total, str(tally))

        tally = engine.sweep(asked, folder, workers=workers, scheduler=scheduler, progress=told)
    if csv:
        engine.frame(folder).to_csv(folder / "rows.csv")
    from validation.commands.sweep.page import sections
    from validation.page import page

    page.render(f"cablefem sweep: {asked.title or asked.name}", sections(folder), folder / "report.html")
    terminal.say(f"{tally.status.total()} scenes in this call, {tally.rate:.3g} per second")
    terminal.say(f"written to {folder}: rows/, study.toml, sweep.json, report.html")
    return _outcome(folder)


def _print(study: Study, scene: int) -> None:
    point = study.point(scene)
    how = " ".join(f"{key}={value}" for key, value in study.how(point).items())
    print(f"# scene {scene} of {study.name}: {study.job} {how} {'' if study.tol is None else f'tol={study.tol:g}'}")
    print(study.scene_at(point).to_toml(), end="")


def _outcome(folder: Path) -> int:
    """Print how many scenes came to what, and the first without an answer; return the exit code."""
    from validation.commands.sweep import engine

    counts = engine.statuses(folder)
    terminal.say(", ".join(f"{n} {status}" for status, n in sorted(counts.items(), key=lambda x: -x[1])))
    if len(rows := engine.frame(folder).query("status not in ('complete', 'incomplete')")):
        first = rows.iloc[0]
        terminal.say(f"scene {rows.index[0]}, {first['status']}: {str(first['reason']).splitlines()[-1]}")
    return 1 if any(counts.get(x) for x in ("failed", "died", "cut off")) else 0
