from pathlib import Path
from typing import Annotated

import typer

from validation.page import terminal
from validation.page.options import scene_named, written

EXAMPLE = "cablefem scenes level > my.toml"


def command(
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
        scene = scene_named(name)
        texts = {scene.name: scene.to_toml()}
    if out is None:
        print("".join(texts.values()), end="")
        return 0
    with written(out, "scenes", "scenes", [f"{key}.toml" for key in texts]) as folder:
        for key, text in texts.items():
            with whole(folder / f"{key}.toml") as temporary:
                temporary.write_text(text, encoding="utf-8")
    return 0
