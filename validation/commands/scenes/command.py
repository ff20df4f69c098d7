import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from validation.page import terminal
from validation.page.options import (
    claim_and_finish_results,
    load_line_printing_notes_or_none,
    load_scene_printing_notes_or_refuse,
)

if TYPE_CHECKING:
    pass

EXAMPLE = "cablefem scenes level > my.toml"


def command(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Print this scene's TOML, to copy.")] = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Write TOML files into this folder instead.")] = None,
    keys: Annotated[bool, typer.Option("--keys", help="Print all keys of a scene file, with units.")] = False,
    limits: Annotated[
        bool, typer.Option("--limits", help="Print limits and load cases that are shipped, with their sources.")
    ] = False,
    schema: Annotated[bool, typer.Option("--schema", help="Print the JSON schema of a scene file.")] = False,
) -> int:
    """List the built-in scenes, print one as TOML, or say what a scene file may hold."""
    if limits:
        return _print_limits()
    if keys or schema:
        return _print_keys() if keys else _print_schema()
    if name is None and out is None:
        return _print_scenes()
    from cablefem.response import write_text

    texts = _toml_by_scene_name(name)
    if out is None:
        print("".join(texts.values()), end="")
        return 0
    with claim_and_finish_results(out, "scenes", "scenes", [f"{key}.toml" for key in texts]) as folder:
        for key, text in texts.items():
            write_text(folder / f"{key}.toml", text)
    return 0


def _toml_by_scene_name(name: str | None) -> dict[str, str]:
    """The TOML of a scene by its name; of all built-in ones for None."""
    from cablefem.scene import Scene
    from cablefem.scene.described import BUILT_IN

    if name is None or name in BUILT_IN:
        return {key: Scene.library_text(key) for key in (BUILT_IN if name is None else [name])}
    with redirect_stdout(sys.stderr):  # notes are no TOML
        scene = load_line_printing_notes_or_none(name) or load_scene_printing_notes_or_refuse(name)
    return {scene.name: scene.to_toml()}


def _print_scenes() -> int:
    from cablefem.scene import Scene
    from cablefem.scene.line import Line

    rows = []
    for key, title in Scene.library().items():
        scene = Scene.load(key)
        mass = "-" if scene.mass is None else f"{scene.mass.mass:.0f} kg"
        speed = "free" if scene.drive.mode == "free" else "-"  # a free car has none before its ride is computed
        if scene.travel is not None:
            speed = f"{scene.top_speed:.3g} m/s"
        rows.append([key, f"{scene.supports.span:.0f} m", mass, speed, title])
    for key, title in Line.library().items():
        line = Line.load(key)
        masses = ", ".join(f"{car.mass:.0f} kg" for car in line.car)
        speeds = [getattr(car.travel, "top_speed", 0.0) for car in line.car]
        speed = "free" if line.moves else "at rest"
        if any(speeds):
            speed = f"{max(speeds):.3g} m/s"
        rows.append([key, f"{line.contact[-1].at[0]:.0f} m", masses, speed, title])
    terminal.print_table(["scene", "span", "mass", "top speed", "title"], rows, right=["span", "mass", "top speed"])
    return 0


def _print_keys() -> int:
    from cablefem.scene import Scene
    from cablefem.scene.keys import list_keys
    from cablefem.scene.line import Line

    for title, part in (("one span, in motion", Scene), ("a line of several contacts, at rest or in motion", Line)):
        terminal.print_text(f"{title}:")
        rows = [
            [
                key.name,
                key.unit,
                f"{key.kind}: {key.meaning}" if key.kind else key.meaning,
                key.default,
                key.short_admits,
            ]
            for key in list_keys(part)
        ]
        terminal.print_table(["key", "unit", "meaning", "default", "range"], rows)
    return 0


def _print_limits() -> int:
    from cablefem.scene.limits import CASES, DEMANDS, TEXTS
    from validation.core.quantities import quantity_text

    rows = []
    for name, text in TEXTS.items():
        year = str(text.get("year", ""))
        year = "" if year in text["source"] else f", {year}"
        terminal.print_text(f"{name}: {text['source']}{year}; for {text['scope']}; {text['link']}")
        for rule in text["limit"]:
            words, side, unit, _ = DEMANDS[rule["demand"]]
            about = rule.get("kind") or rule.get("when", "")
            limit = f"{side} {quantity_text(rule['limit'], None, unit)}"
            rows.append([name, words.format("obstacles"), limit, about, rule["clause"]])
    terminal.print_table(["name", "limit", "number", "where or when", "clause"], rows)
    for name, case in CASES.items():
        terminal.print_text(f"--case {name}: {case['says']} ({case['source']})")
    return 0


def _print_schema() -> int:
    import json

    from cablefem.scene import Scene
    from cablefem.scene.keys import json_schema
    from cablefem.scene.line import Line

    print(json.dumps(json_schema(Scene, Line), indent=2))
    return 0
