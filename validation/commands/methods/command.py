from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from validation.page import terminal
from validation.page.options import written

EXAMPLE = "cablefem methods"


def command(
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for methods.json.")] = None,
    files: Annotated[bool, typer.Option("--files", help="Print every column and key of the files of results.")] = False,
) -> int:
    """List every method, when to use it, and its settings; or say what the files of results hold."""
    if files:
        return _print_files()
    from cablefem.response import write_json
    from validation.core import store
    from validation.core.methods import METHODS, installed

    try:
        methods = METHODS | installed()
    except ValueError as error:
        raise store.Refused(str(error)) from None
    if out is not None:
        with written(out, "methods", "methods", ["methods.json"]) as folder:
            write_json(folder / "methods.json", {
                name: {
                    "title": method.title, "use": method.trust, "wrong": method.wrong,
                    "settings": {key: asdict(knob) for key, knob in method.knobs.items()},
                } for name, method in methods.items()
            })  # fmt: skip
        return 0
    _list(methods)
    return 0


def _list(methods: Mapping[str, Any]) -> None:
    """Print each method with the settings that are its own, then those of all."""
    first = next(iter(methods.values()))
    common = {key: knob for key, knob in first.knobs.items() if all(key in m.knobs for m in methods.values())}
    for name, method in methods.items():
        terminal.say(f"{name}: {method.title}", style="bold")
        terminal.say(f"    use: {method.trust}")
        for key, knob in method.knobs.items():
            if knob != common.get(key):
                terminal.say(f"    {_setting_text(key, knob)}")
    terminal.say("all methods, unless said otherwise above", style="bold")
    for key, knob in common.items():
        terminal.say(f"    {_setting_text(key, knob)}")


def _print_files() -> int:
    from validation.commands.methods.files import dictionary_entries

    terminal.table(["file", "key", "unit", "meaning"], [list(entry) for entry in dictionary_entries()])
    return 0


def _setting_text(key: str, knob: Any) -> str:
    named = isinstance(knob.default, str)
    allowed = "|".join(knob.allowed) if named else f"{knob.allowed[0]:g} to {knob.allowed[1]:g}"
    return f"{key}={knob.default}  {knob.meaning} ({allowed})"
