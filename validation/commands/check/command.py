from pathlib import Path
from typing import Annotated, Any

import typer

from validation.core import store
from validation.page import options

EXAMPLE = "cablefem check my.toml --tol 1e-4 --with other.csv"
TOL = "Asked of the path's error, over its largest deflection. Default: 1e-3; of a line at rest 1e-6 m."
TOL_TENSION = "Asked of the tension, over H. Default: 10 times --tol."
ASK = "all, or path: path, position and speed of the car decide, all else is shown."
SECOND = "Scene the second solver is told: a planted fault."
SECOND_SET = "The same by a key of the scene: mass.mass=+1%."


def command(
    scene: options.SceneName,
    tol: Annotated[float | None, options.number_option("--tol", TOL)] = None,
    tol_tension: Annotated[float | None, options.number_option("--tol-tension", TOL_TENSION)] = None,
    other: Annotated[Path | None, typer.Option("--with", metavar="FILE", help="Another program's path as CSV.")] = None,
    with_tol: Annotated[float, options.number_option("--with-tol", "Allowed to it beside our own error bar.")] = 5e-3,
    set_: options.Set = None,
    verbose: Annotated[bool, typer.Option("--verbose", help="Print every comparison.")] = False,
    deep: Annotated[bool, typer.Option("--deep", help="Compare other programs, too.")] = False,
    second: Annotated[Path | None, typer.Option("--second", metavar="FILE", help=SECOND)] = None,
    second_set: Annotated[list[str] | None, typer.Option("--second-set", metavar="KEY=VALUE", help=SECOND_SET)] = None,
    sensitive: Annotated[
        bool, typer.Option("--sensitivity", help="Smallest error of each key that is detected.")
    ] = False,
    self_test: Annotated[bool, typer.Option("--self-test", help="Add 1 % to one mass: must be detected.")] = False,
    ask: Annotated[str, typer.Option("--ask", metavar="WHAT", help=ASK)] = "all",
    limits: options.LimitNames = None,
    case: options.Cases = None,
    require: options.RequireLimits = False,
    out: options.Out = None,
) -> int:
    """Run two solvers that share no formula on one scene, or on a grid of scenes; do they agree?

    Writes DIR/: report.html, agreement.json, scene.toml and one folder per method. A grid writes table.csv and
    report.html.

    Every number has a bar: what its solver expects to be wrong with it. Beyond three times both bars the solvers
    disagree. Else, if gap or bars exceed what was asked, the comparison is too coarse. Else they agree.

    FILE has columns t [s] or s_o [m], v [m] positive down, and u [m] if known; of a free ride t, x and y from the left
    support, y down. Other units and directions are told by the name: s_o_over_l, t_ms, v_over_l, v_mm, y_up, ...
    """
    if (line := options.load_line_printing_notes_or_none(scene)) is not None:
        others = {"--ask": ask != "all", "--with": other is not None, "--deep": deep, "--verbose": verbose}
        points = options.line_points_from_options(options.with_limits_of_regulations(line, limits), set_, case, others)
        second_line = _scene_of_second_solver(points[0].scene, second, second_set)

        from validation.commands.check import lines

        lines.refuse_before_check(points, second_line, self_test)
        code, results = lines.check_write_and_print_lines(points, tol, tol_tension, out, second_line, require)
        seen = lines.print_sensitivity_and_run_self_test(
            points[0].scene, results, tol, tol_tension, sensitive, self_test
        )
        return code or int(not seen)
    faults = _option_faults(tol, tol_tension, with_tol, ask)
    loaded = options.with_limits_of_regulations(
        options.load_scene_printing_notes_or_refuse(scene, faults, needs_mass=True), limits
    )
    points = options.grid_points_from_options_printing_notes(loaded, set_, case)
    if settings := sorted({key for point in points for key in point.settings}):
        raise store.Refused(f"--set {settings[0]}: check chooses its settings; keys of the scene have a dot")

    from validation.commands.check import spans

    asked: dict[str, Any] = {"tol": 1e-3 if tol is None else tol, "tol_tension": tol_tension, "ask": ask}
    if len(points) > 1:
        if other is not None:
            raise store.Refused("--with: holds one path against one scene; leave it out of a grid")
        return spans.check_and_write_grid(loaded, points, out, require, **asked)
    loaded = points[0].scene
    third = None if other is None else (spans.read_vetted_path(other, loaded), with_tol)
    asked |= {"deep": deep, "second": _scene_of_second_solver(loaded, second, second_set)}
    result, folder = spans.check_and_write(loaded, third, out, **asked)
    beside = {"require": require, "sensitive": sensitive, "self_test": self_test}
    return spans.print_and_verify_check(result, folder, verbose=verbose, **beside)


def _option_faults(tol: float | None, tol_tension: float | None, with_tol: float, ask: str) -> list[str]:
    """What is wrong with these options, one sentence each."""
    faults = [
        *options.tolerance_faults(tol), *options.tolerance_faults(tol_tension, "--tol-tension", 1e-6, 1.0),
        *options.tolerance_faults(with_tol, "--with-tol", 0.0, 1.0),
    ]  # fmt: skip
    return faults if ask in ("all", "path") else [*faults, f"--ask = {ask!r}: must be all or path"]


def _scene_of_second_solver(scene: Any, file: Path | None, set_pairs: list[str] | None) -> Any:
    """The scene for the second solver; None if the same."""
    name = str(file)
    other = scene
    if file is not None:
        other = options.load_line_printing_notes_or_none(name) or options.load_scene_printing_notes_or_refuse(
            name, needs_mass=True
        )
    try:
        points = options.grid_points_from_options_printing_notes(other, set_pairs)
    except store.Refused as error:
        raise store.Refused([fault.replace("--set", "--second-set", 1) for fault in error.faults]) from None
    if len(points) > 1 or points[0].settings:
        raise store.Refused("--second-set: one value for each key of the scene, as mass.mass=+1%")
    if file is None and not set_pairs:
        return None
    return points[0].scene
