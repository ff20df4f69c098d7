from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from validation.core import store
from validation.page import terminal
from validation.page.options import Out, SceneName, real, scene_named, tol_faults

if TYPE_CHECKING:
    from cablefem.response import Response

PLACE = 3
MOST_COARSE = 8  # steps that can be halved twice
EXAMPLE = "cablefem run level --method fourier --set terms=60"
CHOICES = {
    "model": ("full", "stretching", "sagged", "string", "quasi-static"),
    "load": ("mass", "force"),
    "law": ("auto", "elastic", "tension-only"),
}


def command(
    scene: SceneName,
    method: Annotated[str, typer.Option(metavar="NAME", help="A method (cablefem methods).")] = "following-p2",
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="A setting of the method; repeatable.")
    ] = None,
    model: Annotated[
        str, typer.Option(metavar="NAME", help="full, stretching, sagged or string; quasi-static needs no method.")
    ] = "full",
    load: Annotated[str, typer.Option(metavar="NAME", help="mass, or force: its weight alone.")] = "mass",
    law: Annotated[
        str, typer.Option(metavar="NAME", help="elastic, tension-only, or auto: tension-only from the slack onset on.")
    ] = "auto",
    tol: Annotated[
        float | None,
        typer.Option(parser=real, metavar="X", help="Choose resolution and steps for a path error of at most X."),
    ] = None,
    bars: Annotated[
        bool, typer.Option("--bars/--no-bars", help="Error bars from coarser runs, in space and in time.")
    ] = True,
    extrapolate: Annotated[
        bool, typer.Option("--extrapolate", help="Extrapolate in time where three nested runs show the order.")
    ] = False,
    out: Out = None,
) -> int:
    """Run one method on one scene.

    Writes DIR/METHOD/: path.csv, tension.csv, summary.json, response.npz, and for ParaView response.xdmf with
    its data, response.h5, and mass.xdmf.
    """
    from cablefem.scene.errors import nearest, shown

    faults: list[str] = []
    for option, given in (("model", model), ("load", load), ("law", law)):
        known = CHOICES[option]
        if given not in known:
            faults.append(f"--{option} = {shown(given)}: unknown.{nearest(given, known)}")
    faults += tol_faults(tol)
    if extrapolate and tol is not None:
        faults.append("--extrapolate and --tol exclude each other: --tol chooses the steps")
    if model == "quasi-static":
        return _quasi_static(scene, out, faults)
    chosen, settings = _method_with(method, set_ or [], tol, faults)
    loaded = scene_named(scene, faults, travelling=True)
    assert chosen is not None
    if extrapolate and (steps := chosen.settings(settings)["steps"]) < MOST_COARSE:
        terminal.complain([f"--extrapolate halves the steps twice: at least {MOST_COARSE}, got {steps}"])
        return 2

    from validation.commands.run.study import answer
    from validation.core.estimate import OF_BARS
    from validation.core.running import Run
    from validation.core.sidebyside import ready
    from validation.page import telling

    kind = {"model": model, "load": load, "law": law, **settings}
    with ready(_animation, _animate) as animate:
        try:
            Run(loaded, chosen, **kind)
        except ValueError as error:  # a method that cannot do what scene or options ask for
            raise store.Refused(str(error)) from None
        folder = store.claim(out, "run", loaded, [method])
        with terminal.progress() as progress:
            told = partial(progress, method)
            found = answer(loaded, chosen, tol=tol, bars=bars, extrapolate=extrapolate, progress=told, **kind)
            animate(found.response, folder / method)
            found.response.write(folder / method)
    store.finish(folder, "run")
    telling.answer(found.response)
    if found.extrapolated:
        terminal.say(f"extrapolated in time: {found.extrapolated}")
    terminal.say(f"written to {folder / method}")
    if broken := telling.broken(found.response):
        return broken
    if found.missed:
        terminal.complain([found.missed])
        return 1
    # a bar that could not be made, or not all the way, is no fault of the run
    return 1 if any(flag.kind not in (*OF_BARS, "not extrapolated") for flag in found.response.flags) else 0


def _animation() -> Any:
    from validation.page import paraview  # loading what it needs takes as long as the run

    return paraview


def _animate(response: "Response", folder: Path) -> None:
    _animation().write(response, folder)


def _quasi_static(scene: str, out: Any, faults: list[str]) -> int:
    """The cable at rest under the car, wherever the ride brings it: milliseconds, for a timetable."""
    loaded = scene_named(scene, faults, travelling=True)

    from cablefem.response import write_json
    from validation.core.design import design
    from validation.core.quasi_static import quasi_static
    from validation.page import telling

    home = store.claim(out, "run", loaded, ["quasi-static"])
    folder = home / "quasi-static"
    response = quasi_static(loaded)
    numbers = design(response)
    response.write(folder)
    write_json(folder / "summary.json", {**response.summary(), "design": numbers})
    store.finish(home, "run")
    terminal.say(f"{loaded.name}, quasi-static: {loaded.drive}")
    end = {"event": "end", "t": response.t[-1], "s_o": response.s_o[-1], "speed": response.speed[-1]}
    over = any(e["event"] in ("arrival", "back", "stop") for e in response.events)
    telling.events([*response.events, *(() if over else (end,))])
    telling.numbers(numbers, response.length)
    terminal.say("  the cable's inertia is left out: see cablefem advise for what that costs")
    terminal.say(f"written to {folder}")
    return 0


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
        elif tol is not None and key in (space := method.resolution.setting, "steps"):
            faults.append(f"--set {key} and --tol exclude each other: --tol chooses {space} and steps")
        else:
            try:
                settings[key] = method.settings({key: value})[key]
            except ValueError as error:
                faults.append(str(error))
    return method, settings
