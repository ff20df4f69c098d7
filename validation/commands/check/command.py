from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from validation.core import store
from validation.page import terminal
from validation.page.options import (
    Out,
    SceneName,
    Set,
    line_named,
    points_of,
    real,
    refuse_moving,
    scene_named,
    tol_faults,
)

if TYPE_CHECKING:
    from cablefem.response import Response
    from validation.page.options import Point

EXAMPLE = "cablefem check my.toml --tol 1e-4 --with other.csv"


def command(
    scene: SceneName,
    tol: Annotated[
        float | None,
        typer.Option(
            parser=real,
            metavar="X",
            help="Asked of the path's error, over its largest deflection. Default: 1e-3; of a line at rest 1e-6 m.",
        ),
    ] = None,
    tol_tension: Annotated[
        float | None,
        typer.Option(parser=real, metavar="X", help="Asked of the tension, over H. Default: 10 times --tol."),
    ] = None,
    other: Annotated[
        Path | None, typer.Option("--with", metavar="FILE", help="Another program's mass path as CSV, a third party.")
    ] = None,
    with_tol: Annotated[
        float, typer.Option(parser=real, metavar="X", help="Allowed to it beside our own error bar.")
    ] = 5e-3,
    set_: Set = None,
    verbose: Annotated[bool, typer.Option("--verbose", help="Print every comparison.")] = False,
    deep: Annotated[
        bool, typer.Option("--deep", help="Hold what both solvers share against third parties, too.")
    ] = False,
    second: Annotated[
        Path | None, typer.Option("--second", metavar="FILE", help="Scene the second solver is told: a planted fault.")
    ] = None,
    second_set: Annotated[
        list[str] | None,
        typer.Option("--second-set", metavar="KEY=VALUE", help="The same by a key of the scene: mass.mass=+1%."),
    ] = None,
    sensitive: Annotated[
        bool, typer.Option("--sensitivity", help="Print for each key the smallest fault this check would notice.")
    ] = False,
    out: Out = None,
) -> int:
    """Run two solvers that share no formula on one scene, or on a grid of scenes; do they agree?

    Writes DIR/: report.html, agreement.json, scene.toml and one folder per method. A grid writes table.csv and
    report.html.

    Every number has a bar: what its solver expects to be wrong with it. Beyond three times both bars the solvers
    disagree. Else, if gap or bars exceed what was asked, the comparison is too coarse. Else they agree.

    FILE has columns t [s] or s_o [m], v [m] positive down, and u [m] if known; of a free ride t, x and y from the left
    support, y down. Other units and directions are told by the name: s_o_over_l, t_ms, v_over_l, v_mm, y_up, ...
    """
    if (line := line_named(scene)) is not None:
        refuse_moving({"--with": other is not None, "--deep": deep, "--sensitivity": sensitive})
        from validation.commands.check import line as at_rest

        given = points_of(line, set_)
        return at_rest.check(given, tol, tol_tension, out, _second(given[0].scene, second, second_set))
    tol = 1e-3 if tol is None else tol
    faults = tol_faults(tol)
    if tol_tension is not None and not 0.0 < tol_tension <= 1.0:
        faults.append(f"--tol-tension must lie in (0, 1], got {tol_tension:g}")
    if not 0.0 <= with_tol <= 1.0:
        faults.append(f"--with-tol must lie in [0, 1], got {with_tol:g}")
    loaded = scene_named(scene, faults, travelling=True)
    points = points_of(loaded, set_)
    if settings := sorted({key for point in points for key in point.settings}):
        raise store.Refused(f"--set {settings[0]}: check chooses its settings; keys of the scene have a dot")
    if len(points) > 1:
        if other is not None:
            raise store.Refused("--with: holds one path against one scene; leave it out of a grid")
        return _many(loaded, points, out, tol=tol, tol_tension=tol_tension)
    loaded = points[0].scene
    other_scene = _second(loaded, second, second_set)

    from validation.commands.check import study
    from validation.core import foreign
    from validation.core.running import run
    from validation.core.sidebyside import aside
    from validation.page import telling

    path = None
    if other is not None:
        path = foreign.ForeignPath.read(other, loaded)
        foreign.refuse_misnamed(path, run(loaded, study.SOLVERS[0], elements=6, steps=200))
    folder = store.claim(out, "check", loaded, ["agreement.json", "scene.toml", "with.csv", "grip", *study.SOLVERS])
    with terminal.progress() as progress, ExitStack() as writing:

        def made(*runs: "Response") -> None:
            writing.close()
            writing.enter_context(aside(partial(_write_tables, folder, runs)))

        result = study.check(
            loaded, tol=tol, tol_tension=tol_tension, deep=deep, second=other_scene, progress=progress, made=made
        )
        from validation.commands.check import words  # already loaded while solvers ran
        from validation.core.answers import write_answers
        from validation.page import report

        progress("writing", 0.0)
        (folder / "with.csv").unlink(missing_ok=True)
        if path is not None:
            result = study.joined(result, path, with_tol)
            path.write(folder / "with.csv")
        result.store(folder)
        progress("writing", 0.3)
        report.write(folder, "check")
        writing.close()
        for r in (result.a.run, result.b.run):
            write_answers(folder / r.method, loaded, r)
        store.finish(folder, "check")
        progress("writing", 1.0)
    words.tell(result, verbose)
    if sensitive:
        from validation.commands.check import sensitivity

        terminal.say(f"  {sensitivity.told(sensitivity.sensitivity(result))}")
    terminal.say(f"  written to {folder}: report.html, {result.a.run.method}/, {result.b.run.method}/")
    return telling.broken(result.a.run, result.b.run) or (1 if result.verdict.value != "agree" or result.doubts else 0)


def _second(scene: Any, file: Path | None, pairs: list[str] | None) -> Any:
    """The scene for the second solver; None if the same."""
    faults: list[str] = []
    other = scene if file is None else line_named(str(file)) or scene_named(str(file), faults, travelling=True)
    points = points_of(other, pairs)
    if len(points) > 1 or points[0].settings:
        raise store.Refused("--second-set: one value for each key of the scene, as mass.mass=+1%")
    return points[0].scene if file is not None or pairs else None


def _write_tables(folder: Path, runs: "tuple[Response, ...]") -> None:
    from validation.page import paraview  # slow to load

    for run in runs:
        run.write_tables(folder / run.method)
        paraview.write(run, folder / run.method)


def _many(scene: Any, points: "list[Point]", out: Path | None, **asked: Any) -> int:
    """Check every point of a grid; 1 unless all agree."""
    from validation.commands.check import study
    from validation.page.answer import many

    def row(point: "Point") -> tuple[dict[str, Any], Any]:
        found = study.check(point.scene, **asked)
        return many.row(point.scene, found.a.run, found.design, found.verdict.value), many.path(found.a.run)

    rows = many.grid("check", "grid-check", scene, points, out, row, many.columns)
    return 0 if all(row["verdict"] == "agree" for row in rows) else 1
