from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from validation.core import store
from validation.page import terminal
from validation.page.options import Out, SceneName, real, scene_named, tol_faults

if TYPE_CHECKING:
    from cablefem.response import Response

PLACE = 4
EXAMPLE = "cablefem check my.toml --tol 1e-4 --with other.csv"


def command(
    scene: SceneName,
    tol: Annotated[
        float,
        typer.Option(parser=real, metavar="X", help="Asked of the path's error, over its largest deflection."),
    ] = 1e-3,
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
    deep: Annotated[
        bool, typer.Option("--deep", help="Hold what both solvers share against third parties, too.")
    ] = False,
    out: Out = None,
) -> int:
    """Run two solvers that share no formula; do they agree?

    Writes DIR/: report.html, agreement.json, scene.toml and one folder per method.

    Gaps: of the mass paths over the largest deflection, of a free ride over a tenth of the length, its instants open
    by a tenth of an axial wave's way there and back once it has turned against friction (path_max, path_rms,
    path_slack past the slack onset); of the tension along the cable, at the mass and of the reactions
    over H (tension, tension_behind, tension_ahead, reactions); of the fields over their own size (displacement,
    velocity); of the slack onsets in s_o/l; what is missing from the balance of energy (energy), of momentum at the
    mass (impulse), and from mechanics as the judge knows it from the scene file alone (laws_si). With --deep: of
    both from exact frequencies, statics of the loaded cable, scipy on the same system, another method with a bar of
    its own, another damping of the slack cable (deep).

    FILE has columns t [s] or s_o [m], v [m] positive down, and u [m] if known; of a free ride t, x and y from the left
    support, y down. Other units and directions are told by the name: s_o_over_l, t_ms, v_over_l, v_mm, y_up, ...
    """
    faults = tol_faults(tol)
    if tol_tension is not None and not 0.0 < tol_tension <= 1.0:
        faults.append(f"--tol-tension must lie in (0, 1], got {tol_tension:g}")
    if not 0.0 <= with_tol <= 1.0:
        faults.append(f"--with-tol must lie in [0, 1], got {with_tol:g}")
    loaded = scene_named(scene, faults, travelling=True)

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

        result = study.check(loaded, tol=tol, tol_tension=tol_tension, deep=deep, progress=progress, made=made)
        from validation.commands.check import words  # by now they are loaded, while solvers ran
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
        store.finish(folder, "check")
        progress("writing", 1.0)
    words.tell(result)
    terminal.say(f"written to {folder}: report.html, agreement.json, {result.a.run.method}/, {result.b.run.method}/")
    return telling.broken(result.a.run, result.b.run) or (1 if result.verdict.value != "agree" or result.doubts else 0)


def _write_tables(folder: Path, runs: "tuple[Response, ...]") -> None:
    from validation.page import paraview  # loading what it needs takes as long as it does

    for run in runs:
        run.write_tables(folder / run.method)
        paraview.write(run, folder / run.method)
