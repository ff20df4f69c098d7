from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from validation.page import terminal
from validation.page.options import written

EXAMPLE = "cablefem methods"


def command(
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Write methods.json there instead.")] = None,
) -> int:
    """List every method, when to use it, and its settings."""
    from cablefem.response import write_json
    from validation.core.methods import METHODS

    if out is not None:
        with written(out, "methods", "methods", ["methods.json"]) as folder:
            write_json(folder / "methods.json", {
                name: {
                    "title": method.title, "use": method.trust, "wrong": method.wrong,
                    "settings": {key: asdict(knob) for key, knob in method.knobs.items()},
                } for name, method in METHODS.items()
            })  # fmt: skip
        return 0
    first = next(iter(METHODS.values()))
    common = {key: knob for key, knob in first.knobs.items() if all(key in m.knobs for m in METHODS.values())}
    for name, method in METHODS.items():
        terminal.say(f"{name}: {method.title}", style="bold")
        terminal.say(f"    use: {method.trust}")
        for key, knob in method.knobs.items():
            if knob != common.get(key):
                terminal.say(f"    {_told(key, knob)}")
    terminal.say("all methods, unless said otherwise above", style="bold")
    for key, knob in common.items():
        terminal.say(f"    {_told(key, knob)}")
    return 0


def _told(key: str, knob: Any) -> str:
    named = isinstance(knob.default, str)
    allowed = "|".join(knob.allowed) if named else f"{knob.allowed[0]:g} to {knob.allowed[1]:g}"
    return f"{key}={knob.default}  {knob.meaning} ({allowed})"
