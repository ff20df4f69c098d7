from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from validation.page import terminal
from validation.page.options import claim_and_finish_results

EXAMPLE = "cablefem methods"


def command(
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for methods.json.")] = None,
    files: Annotated[bool, typer.Option("--files", help="Print every column and key of the files of results.")] = False,
) -> int:
    """List every method, when to use it, and its settings; or say what the files of results hold."""
    if files:
        from validation.commands.methods.files import data_dictionary_entries

        terminal.print_table(["file", "key", "unit", "meaning"], list(map(list, data_dictionary_entries())))
        return 0
    from cablefem.response import write_json
    from validation.core import store
    from validation.core.methods import METHODS, methods_of_other_packages

    try:
        methods = METHODS | methods_of_other_packages()
    except ValueError as error:
        raise store.Refused(str(error)) from None
    if out is not None:
        content = {}
        for name, method in methods.items():
            content[name] = {"title": method.title, "use": method.use, "wrong": method.wrong}
            content[name]["settings"] = {key: setting._asdict() for key, setting in method.all_settings.items()}
        with claim_and_finish_results(out, "methods", "methods", ["methods.json"]) as folder:
            write_json(folder / "methods.json", content)
        return 0
    _print_methods(methods)
    return 0


def _print_methods(methods: Mapping[str, Any]) -> None:
    """Print each method with the settings that are its own, then those of all."""
    first = next(iter(methods.values()))
    common = {
        key: setting
        for key, setting in first.all_settings.items()
        if all(key in m.all_settings for m in methods.values())
    }
    for name, method in methods.items():
        terminal.print_text(f"{name}: {method.title}", style="bold")
        terminal.print_text(f"    use: {method.use}")
        for key, setting in method.all_settings.items():
            if setting != common.get(key):
                terminal.print_text(f"    {_setting_help_line(key, setting)}")
    terminal.print_text("all methods, unless said otherwise above", style="bold")
    for key, setting in common.items():
        terminal.print_text(f"    {_setting_help_line(key, setting)}")


def _setting_help_line(key: str, setting: Any) -> str:
    named = isinstance(setting.default, str)
    allowed = "|".join(setting.allowed) if named else f"{setting.allowed[0]:g} to {setting.allowed[1]:g}"
    return f"{key}={setting.default}  {setting.meaning} ({allowed})"
