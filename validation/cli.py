"""The command `cablefem`: one function per subcommand; each calls a study, writes its files and says what came out.

Exit codes: 0 fine; 1 the solvers disagree, are not comparable, or a check failed; 2 bad input, or a run that broke
before the slack onset.  Everything heavy is imported inside the commands, so that help comes at once.
"""

from __future__ import annotations

import difflib
import importlib
import math
import os
import sys
import traceback
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from validation import terminal
from validation.core import store

if TYPE_CHECKING:
    from cablefem.response import Response
    from cablefem.scene import Scene

app = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,  # units in brackets are units
    help="Dynamics of a cable that carries a moving mass, by two solvers that check each other.",
    epilog="Start with: cablefem check level",
)


def real(text: str) -> float:
    """Return the number that a text says."""
    try:
        return float(text)
    except ValueError:
        raise typer.BadParameter(f"{text!r} is no number") from None


def _to(folder: str) -> Any:
    return typer.Option(metavar="DIR", help=f"Folder for the results. Default: {store.ROOT}/{folder}.")


SceneName = Annotated[str, typer.Argument(metavar="SCENE", help="A built-in scene (cablefem scenes) or a TOML file.")]
Out = Annotated[Path | None, _to("SCENE")]

CHOICES = {
    "model": ("full", "stretching", "sagged", "string"),
    "load": ("mass", "force"),
    "law": ("auto", "elastic", "tension-only"),
}
TOL_RANGE = (1e-6, 0.2)
# Commands with a folder in validation.commands: a study that computes and stores, and pages that draw what is stored.
STUDIES = ("check", "advise", "chart", "atlas", "oracles", "paper", "modes")
# What a full report consists of: commands, and the folder of each is its scene or itself.
PARTS = (
    ("check", "level"), ("check", "cruise"), ("check", "inclined"), ("modes", "bare"),
    ("advise", "level", "--tol", "1e-2"), ("chart", "level"), ("oracles",), ("paper",), ("atlas",),
)  # fmt: skip


# --- what there is --------------------------------------------------------------------------------------------------


@app.command(epilog="Example: cablefem scenes level > my.toml")
def scenes(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Print this scene's TOML, to copy.")] = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Write TOML files there instead.")] = None,
) -> int:
    """List the built-in scenes, or print one as TOML."""
    from cablefem.response import whole
    from cablefem.scene import Scene

    library = Scene.library()
    if name is None and out is None:
        rows = []
        for key, title in library.items():
            scene = Scene.load(key)
            mass = "-" if scene.mass is None else f"{scene.mass.mass:.0f} kg"
            speed = "-" if scene.top_speed is None else f"{scene.top_speed:.3g} m/s"
            rows.append([key, f"{scene.supports.span:.0f} m", mass, speed, title])
        terminal.table(["scene", "span", "mass", "top speed", "title"], rows, right=["span", "mass", "top speed"])
        return 0
    if name is None or name in library:
        texts = {key: Scene.library_text(key) for key in (library if name is None else [name])}
    else:
        scene = _scene(name)
        texts = {scene.name: scene.to_toml()}
    if out is None:
        print("".join(texts.values()), end="")
        return 0
    folder = store.claim(out, "scenes", "scenes", [f"{key}.toml" for key in texts])
    for key, text in texts.items():
        with whole(folder / f"{key}.toml") as temporary:
            temporary.write_text(text, encoding="utf-8")
    terminal.say(f"written to {folder}: {', '.join(f'{key}.toml' for key in texts)}")
    return 0


@app.command(epilog="Example: cablefem methods")
def methods(
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Write methods.json there instead.")] = None,
) -> int:
    """List every method, when to use it, and its settings."""
    from cablefem.response import write_json
    from validation import telling
    from validation.core.methods import METHODS

    if out is not None:
        folder = store.claim(out, "methods", "methods", ["methods.json"])
        write_json(folder / "methods.json", {
            name: {
                "title": method.title, "use": method.trust, "wrong": method.wrong,
                "settings": {
                    key: {"default": knob.default, "allowed": list(knob.allowed), "meaning": knob.meaning}
                    for key, knob in method.knobs.items()
                },
            } for name, method in METHODS.items()
        })  # fmt: skip
        terminal.say(f"written to {folder}: methods.json")
        return 0
    first = next(iter(METHODS.values()))
    common = {key: knob for key, knob in first.knobs.items() if all(key in m.knobs for m in METHODS.values())}
    for name, method in METHODS.items():
        terminal.say(f"{name}: {method.title}", style="bold")
        terminal.say(f"    use: {method.trust}")
        for key, knob in method.knobs.items():
            if knob != common.get(key):
                terminal.say(f"    {telling.knob(key, knob)}")
    terminal.say("all methods, unless said otherwise above", style="bold")
    for key, knob in common.items():
        terminal.say(f"    {telling.knob(key, knob)}")
    return 0


# --- one run --------------------------------------------------------------------------------------------------------


@app.command(epilog="Example: cablefem run level --method fourier --set terms=60")
def run(
    scene: SceneName,
    method: Annotated[str, typer.Option(metavar="NAME", help="A method (cablefem methods).")],
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="A setting of the method; repeatable.")
    ] = None,
    model: Annotated[str, typer.Option(metavar="NAME", help="full, stretching, sagged or string.")] = "full",
    load: Annotated[str, typer.Option(metavar="NAME", help="mass, or force: its weight alone.")] = "mass",
    law: Annotated[
        str, typer.Option(metavar="NAME", help="elastic, tension-only, or auto: tension-only from the slack onset on.")
    ] = "auto",
    tol: Annotated[
        float | None,
        typer.Option(parser=real, metavar="X", help="Choose resolution and steps for a path error of at most X."),
    ] = None,
    out: Out = None,
) -> int:
    """Run one method on one scene.

    Writes DIR/METHOD/: path.csv, tension.csv, summary.json, response.npz, and response.xdmf and mass.xdmf for ParaView.
    """
    faults: list[str] = []
    for option, given in (("model", model), ("load", load), ("law", law)):
        known = CHOICES[option]
        if given not in known:
            faults.append(f"--{option} must be one of {', '.join(known)}, got {given!r}{_near(given, known)}")
    faults += _tol_faults(tol)
    chosen, settings = _method_with(method, set_ or [], tol, faults)
    loaded = _scene(scene, faults, travelling=True)

    from validation import paraview, telling
    from validation.core.resolution import TooCoarse, resolve
    from validation.core.running import run as run_method

    folder = store.claim(out, "run", loaded, [method])
    kind = {"model": model, "load": load, "law": law, **settings}
    too_coarse = ""
    with terminal.progress() as progress:
        if tol is None:
            response = run_method(loaded, chosen, **kind, progress=partial(progress, method))
        else:
            try:
                response = resolve(loaded, method, tol, **kind, progress=partial(progress, method))
            except TooCoarse as error:
                response, too_coarse = error.best, str(error)
        response.write(folder / method)
        paraview.write(response, folder / method)
    telling.run(response)
    terminal.say(f"written to {folder / method}")
    if broken := _broken(response):
        return broken
    if too_coarse:
        terminal.complain([too_coarse])
    return 1 if too_coarse or response.flags else 0


def _method_with(name: str, pairs: list[str], tol: float | None, faults: list[str]) -> tuple[Any, dict[str, Any]]:
    """Return the method and the settings given; every fault adds a line."""
    from validation.core.methods import find

    try:
        method = find(name)
    except ValueError as error:
        faults.append(str(error))
        return None, {}
    if method.wrong and tol is not None:
        faults.append(f"{name} converges to a wrong answer: no resolution meets --tol")
    settings: dict[str, Any] = {}
    for pair in pairs:
        key, given, value = (part.strip() for part in pair.partition("="))
        if not given:
            faults.append(f"--set must be KEY=VALUE, got {pair!r}")
        elif tol is not None and key in (method.resolution, "steps"):
            faults.append(f"--set {key} and --tol exclude each other: --tol chooses {method.resolution} and steps")
        else:
            try:
                settings[key] = method.settings({key: value})[key]
            except ValueError as error:
                faults.append(str(error))
    return method, settings


def _broken(*responses: Response) -> int:
    """Return 2 and say so where a run broke before the slack onset, else 0; an unstable run's slack is no slack."""
    broken = [r for r in responses if r.status != "complete" and (r.slack_onset is None or r.cause == "unstable")]
    terminal.complain([f"{r.method} broke at s_o/l = {r.reached:.4g}: {r.reason}" for r in broken])
    return 2 if broken else 0


# --- the main job ---------------------------------------------------------------------------------------------------


@app.command(epilog="Example: cablefem check my.toml --tol 1e-4 --with other.csv")
def check(
    scene: SceneName,
    tol: Annotated[
        float, typer.Option(parser=real, metavar="X", help="Asked of the path's error, over its largest deflection.")
    ] = 1e-3,
    other: Annotated[
        Path | None, typer.Option("--with", metavar="FILE", help="Another program's mass path as CSV, a third party.")
    ] = None,
    with_tol: Annotated[
        float, typer.Option(parser=real, metavar="X", help="Allowed to it beside our own error bar.")
    ] = 5e-3,
    out: Out = None,
) -> int:
    """Run two solvers that share no formula; do they agree?

    Writes DIR/: report.html, agreement.json, scene.toml and one folder per method.

    Gaps: of the mass paths over the largest deflection (path_max, path_rms); of the tension fields over H (tension);
    what is missing from the law of the jump at the mass over M g (jump) and from the balance of energy (energy); of
    the oscillation of the tension along the cable over H (overshoot).

    FILE has columns t [s] or s_o [m], v [m] positive down, and u [m] if known; other units and directions are told by
    the name: s_o_over_l, t_ms, v_over_l, v_mm, v_up, ...
    """
    faults = _tol_faults(tol)
    if not 0.0 <= with_tol <= 1.0:
        faults.append(f"--with-tol must lie in [0, 1], got {with_tol:g}")
    loaded = _scene(scene, faults, travelling=True)

    from validation import paraview, telling
    from validation.commands.check import study
    from validation.core import foreign
    from validation.core.running import run as run_method

    path = None
    if other is not None:
        path = foreign.ForeignPath.read(other, loaded)
        foreign.refuse_misnamed(path, run_method(loaded, study.SOLVERS[0], elements=6, steps=200))
    folder = store.claim(out, "check", loaded, ["agreement.json", "scene.toml", "with.csv", *study.SOLVERS])
    with terminal.progress() as progress:
        result = study.check(loaded, tol=tol, progress=progress)
        progress("writing", 0.0)
        (folder / "with.csv").unlink(missing_ok=True)
        if path is not None:
            result = study.joined(result, path, with_tol)
            path.write(folder / "with.csv")
        result.write(folder)
        progress("writing", 0.5)
        for e in (result.a, result.b):
            paraview.write(e.run, folder / e.run.method)
        _report(folder, "check")
        store.finish(folder, "check")
        progress("writing", 1.0)
    telling.check(result)
    terminal.say(f"written to {folder}: report.html, agreement.json, {result.a.run.method}/, {result.b.run.method}/")
    return _broken(result.a.run, result.b.run) or (0 if result.verdict.value == "agree" else 1)


# --- frequencies ----------------------------------------------------------------------------------------------------


@app.command(epilog="Example: cablefem modes bare")
def modes(scene: SceneName, out: Out = None) -> int:
    """Print the first ten frequencies of the cable alone.

    From both solvers and the exact theory, omega l sqrt(rho/H). Writes DIR/modes.json.
    """
    loaded = _scene(scene)

    from validation import telling
    from validation.commands.modes import study

    folder = store.claim(out, "modes", loaded, ["modes.json"])
    found = study.modes(loaded)
    found.write(folder)
    store.finish(folder, "modes")
    hertz = found.omega[study.EXACT] / (2.0 * math.pi * loaded.time_scale)
    rows = [
        [str(i + 1), f"{hertz[i]:.5g}", *(f"{omega[i]:.7f}" for omega in found.omega.values())]
        for i in range(study.COUNT)
    ]
    terminal.table(["mode", "Hz", *found.omega], rows, right=["mode", "Hz", *found.omega])
    terminal.say()
    telling.rows(found.rows)
    terminal.say(f"written to {folder}: modes.json")
    return 0 if all(row.verdict.value == "agree" for row in found.rows) else 1


# --- studies --------------------------------------------------------------------------------------------------------


@app.command(epilog="Example: cablefem advise inclined --tol 1e-2")
def advise(
    scene: SceneName,
    tol: Annotated[float, typer.Option(parser=real, metavar="X", help="Error of the mass path that is good enough.")],
    out: Out = None,
) -> int:
    """Find the least model and cheapest method for a scene.

    Writes DIR/: advice.json, with the evidence, and report.html.
    """
    loaded = _scene(scene, _tol_faults(tol), travelling=True)
    return _study("advise", loaded, ["advice.json"], out, loaded, tol)


@app.command(epilog="Example: cablefem chart level")
def chart(scene: SceneName, out: Out = None) -> int:
    """Chart speed against accuracy of every method on a scene.

    Writes DIR/: chart.json and report.html.
    """
    loaded = _scene(scene, travelling=True)
    return _study("chart", loaded, ["chart.json"], out, loaded)


@app.command(epilog="Example: cablefem atlas")
def atlas(out: Annotated[Path | None, _to("atlas")] = None) -> int:
    """Map where methods fail, and what helps.

    Writes DIR/: atlas.json and report.html.
    """
    return _study("atlas", "atlas", ["atlas.json", "cells.jsonl"], out)


@app.command(epilog="Example: cablefem oracles")
def oracles(out: Annotated[Path | None, _to("oracles")] = None) -> int:
    """Hold the solvers against exact answers.

    Writes DIR/: oracles.json and report.html.
    """
    return _study("oracles", "oracles", ["oracles.json"], out)


@app.command(epilog="Example: cablefem paper")
def paper(out: Annotated[Path | None, _to("paper")] = None) -> int:
    """Redo the paper's figures; a verdict on each claim.

    Writes DIR/: claims.json and report.html.
    """
    return _study("paper", "paper", ["claims.json", "numbers.json", "runs"], out)


def _study(command: str, scene: Any, writes: list[str], out: Path | None, *inputs: Any) -> int:
    """Run a study, write its pages and print their one-line findings."""
    from validation import telling

    study = importlib.import_module(f"validation.commands.{command}.study")
    call = getattr(study, "oracle_table" if command == "oracles" else command)
    folder = store.claim(out, command, scene, writes)
    with terminal.progress() as progress:
        found = call(*inputs, folder, progress)
        _report(folder, command)
        store.finish(folder, command)
    telling.pages(_kept(folder, command))
    terminal.say(f"written to {folder}: report.html, {', '.join(writes)}")
    # What the paper claims, or where a method fails on purpose, is a finding; oracles put our solvers to the test.
    return 1 if command == "oracles" and found["verdict"] != "agree" else 0


@app.command(epilog="Example: cablefem report")
def report(
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help=f"Folder of all results. Default: {store.ROOT}.")
    ] = None,
) -> int:
    """Run what is missing and gather all results in one HTML file.

    Each part is a command of its own, with its results in DIR/SCENE; finished parts are taken as they are, so an
    interrupted report goes on where it stopped. Writes DIR/report.html. DIR may also be the folder of one result: then
    only this is gathered.
    """
    root = store.ROOT if out is None else out
    if not set(store.results(root)) - {"report"}:
        store.claim(root, "report", "report", ["report.html"], among=True)
        store.ROOT, before = root, store.ROOT
        try:
            missing = [part for part in PARTS if not store.finished(root / part[min(1, len(part) - 1)], part[0])]
            for i, part in enumerate(missing):
                terminal.say(f"part {i + 1} of {len(missing)}: cablefem {' '.join(part)}", style="bold")
                code = main(list(part))
                if code == 130:
                    raise KeyboardInterrupt
                terminal.say()
        finally:
            store.ROOT = before
    return _gathered(root)


def _gathered(root: Path) -> int:
    """Write the report of all finished results in a folder and in its subfolders."""
    from dataclasses import replace

    from validation import telling
    from validation.page import page

    sections = [
        replace(s, id=f"{folder.name}-{s.id}", title=f"{folder.name}: {s.title}")
        for folder in [root, *sorted(root.glob("*/"))]
        for command in store.results(folder) if store.finished(folder, command)
        for s in _kept(folder, command)
    ]  # fmt: skip
    if not sections:
        raise store.Refused(f"{root} holds no finished results to report")
    page.render("cablefem", sections, root / "report.html")
    telling.pages(sections)
    terminal.say(f"written to {root}: report.html")
    return 0


# --- shared ---------------------------------------------------------------------------------------------------------


def _scene(name: str, faults: list[str] | None = None, *, travelling: bool = False) -> Scene:
    """Return the scene, or raise Refused with its faults and those found before."""
    from cablefem.scene import Scene, SceneError

    faults = [] if faults is None else faults
    scene = None
    try:
        scene = Scene.load(name)
        if travelling and (scene.mass is None or scene.travel is None):
            faults.append(f"scene {scene.name} has no [mass] and [travel]: a bare cable is for modes and scenes only")
    except SceneError as error:
        faults += [fault if fault.startswith("scene = ") else f"{name}: {fault}" for fault in error.faults]
    if faults or scene is None:
        raise store.Refused(faults)
    return scene


def _tol_faults(tol: float | None) -> list[str]:
    low, high = TOL_RANGE
    return [] if tol is None or low <= tol <= high else [f"--tol must lie in [{low:g}, {high:g}], got {tol:g}"]


def _near(word: str, known: Any) -> str:
    close = difflib.get_close_matches(word, list(known), n=1)
    return f"; did you mean {close[0]}?" if close else ""


def _sections(folder: Path, command: str) -> list[Any]:
    """Return the pages about a command's results, and keep them; commands without a study have none."""
    from dataclasses import asdict

    from cablefem.response import write_json

    if command not in STUDIES:
        return []
    sections = importlib.import_module(f"validation.commands.{command}.page").sections(folder)
    write_json(folder / f".{command}.pages.json", [asdict(section) for section in sections])
    return sections


def _kept(folder: Path, command: str) -> list[Any]:
    """Return the pages as they were drawn when the command finished; drawing takes most of a report's time."""
    import json

    from markupsafe import Markup

    from validation.page.page import Section

    try:
        kept = json.loads((folder / f".{command}.pages.json").read_text(encoding="utf-8"))
        return [Section(**page | {"html": Markup(page["html"]), "scripts": tuple(page["scripts"])}) for page in kept]
    except (OSError, ValueError, TypeError, KeyError):
        return _sections(folder, command)


def _report(folder: Path, command: str) -> None:
    """Write report.html from all results in a folder, those of this command drawn anew."""
    from validation.page import page

    sections = [
        section
        for other in store.results(folder)
        for section in (_sections if other == command else _kept)(folder, other)
    ]
    page.render(f"cablefem: {folder.name}", sections, folder / "report.html")


def main(argv: list[str] | None = None) -> int:
    """Run one command and return its exit code; a user's mistake ends in lines on standard error, never in a trace."""
    command = typer.main.get_command(app)
    usage_error: Any = typer.BadParameter.__mro__[1]
    try:
        arguments = sys.argv[1:] if argv is None else argv
        with command.make_context("cablefem", list(arguments) or ["--help"]) as context:
            return int(command.invoke(context) or 0)
    except typer.Exit as done:
        return done.exit_code
    except usage_error as error:
        where = error.ctx.command_path if error.ctx is not None else "cablefem"
        terminal.complain([f"{' '.join(error.format_message().split())} (see {where} --help)"])
        return 2
    except (KeyboardInterrupt, typer.Abort):
        terminal.complain(["interrupted; files that were written are whole, and the command can be given again"])
        return 130
    except BrokenPipeError:
        # The reader has gone: nothing more to say, and nothing to flush at the end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except OSError as error:
        terminal.complain([f"{error.filename or 'a file'}: {error.strerror}"])
        return 2
    except Exception as error:
        faults = getattr(error, "faults", None)
        if faults is None:
            traceback.print_exc()
            terminal.complain(["this is a fault of cablefem, not of your input"])
        else:
            terminal.complain(faults)
        return 2


if __name__ == "__main__":
    sys.exit(main())
