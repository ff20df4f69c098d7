"""The command `cablefem`: every folder of validation/commands is a command, its `command.py` says what it takes.

Exit codes: see README.md.
"""

import atexit
import gc
import importlib
import io
import os
import signal
import sys
import threading
import traceback
from typing import Annotated, Any

import typer

from validation import command_names
from validation.page import terminal

ORDER = (
    "scenes", "methods", "run", "check", "find", "modes", "advise", "chart", "atlas", "oracles", "paper", "sweep",
    "report",
)  # fmt: skip


def _build_app() -> typer.Typer:
    """Collect the commands; those that ORDER does not name come last."""
    app = typer.Typer(
        add_completion=False,
        rich_markup_mode=None,  # units in brackets are units
        help="Dynamics of a cable that carries a moving mass, by two solvers that check each other.",
        epilog="Start with: cablefem check level",
        invoke_without_command=True,
    )
    app.callback()(_print_version)
    parts = {name: importlib.import_module(f"validation.commands.{name}.command") for name in command_names()}
    for name in sorted(parts, key=lambda name: ORDER.index(name) if name in ORDER else len(ORDER)):
        app.command(name, epilog=f"Example: {parts[name].EXAMPLE}")(parts[name].command)
    return app


def _print_version(version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False) -> None:
    if version:
        from cablefem import __version__

        terminal.print_text(f"cablefem {__version__}")
        raise typer.Exit


app = _build_app()


def run_command(arguments: list[str]) -> int:
    """Run one command; return its exit code. What breaks it is raised."""
    command = typer.main.get_command(app)
    with command.make_context("cablefem", arguments or ["--help"], obj=run_command) as context:
        return int(command.invoke(context) or 0)


def _print_interrupted(stored: str = "") -> int:
    """Say that Ctrl-C ended the command, and what was stored; return the exit code."""
    stored = stored or "files that were written are whole, and the command can be given again"
    terminal.print_faults([f"interrupted; {stored}"])
    return 130


def _interrupt_again_if_lost(unraisable: Any) -> None:
    """Ctrl-C again, a moment later, if Python dropped it: it raises nothing out of a destructor, or out of a fork."""
    if unraisable.exc_type is KeyboardInterrupt:
        # a signal of its own, as it must end a wait, too
        threading.Timer(0.1, signal.pthread_kill, [threading.main_thread().ident, signal.SIGINT]).start()
    else:
        sys.__unraisablehook__(unraisable)


def main(argv: list[str] | None = None) -> int:
    """Run one command; print what breaks it; return its exit code."""
    interrupts: list[int] = []

    def note_and_interrupt(number: int, frame: Any) -> None:
        interrupts.append(number)
        signal.default_int_handler(number, frame)

    gc.set_threshold(100_000, 50, 50)  # what is loaded stays; saves a tenth of a start
    atexit.register(gc.freeze)  # saves another two at the end
    usage_error: Any = typer.BadParameter.__mro__[1]
    try:
        if argv is None:
            for stream in (sys.stdout, sys.stderr):  # of an encoding that may have no ±; None if closed
                if isinstance(stream, io.TextIOWrapper):
                    stream.reconfigure(errors="replace")
            sys.unraisablehook = _interrupt_again_if_lost
            signal.signal(signal.SIGINT, note_and_interrupt)  # in the background of a script it is ignored
        return run_command(list(sys.argv[1:] if argv is None else argv))
    except typer.Exit as done:
        return done.exit_code
    except usage_error as error:
        where = error.ctx.command_path if error.ctx is not None else "cablefem"
        terminal.print_faults([f"{' '.join(error.format_message().split())} (see {where} --help)"])
        return 2
    except (KeyboardInterrupt, typer.Abort) as stop:
        return _print_interrupted(str(stop))
    except BrokenPipeError:
        # The reader has gone: nothing to flush at the end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except Exception as error:
        if interrupts:  # a compiled module turns Ctrl-C while it is imported into an ImportError
            return _print_interrupted()
        if not (hasattr(error, "faults") or isinstance(error, OSError)):
            traceback.print_exc()  # it was not the input
        terminal.print_faults(terminal.fault_sentences(error))
        return 2


if __name__ == "__main__":
    sys.exit(main())
