"""The command as people meet it: how it helps, refuses, and what its exit code says."""

import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cablefem import Scene
from cablefem.scene.line import Line
from tests.commands.calls import QUICK, fault_lines, file_contents
from validation import cli

COMMANDS = (
    "scenes", "methods", "run", "check", "find", "modes", "advise", "chart", "atlas", "oracles", "paper", "sweep",
    "report",
)  # fmt: skip


def test_help_lists_every_command_of_the_design_and_so_does_no_argument_at_all(cablefem):
    code, out, err = cablefem("--help")
    assert (code, err) == (0, "")
    listed = out.partition("Commands:\n")[2].splitlines()[: len(COMMANDS)]
    assert tuple(line.split()[0] for line in listed) == COMMANDS
    assert cablefem() == (0, out, "")


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example_and_says_where_it_writes(cablefem, command):
    code, out, err = cablefem(command, "--help")
    assert (code, err) == (0, "")
    assert f"Example: cablefem {command}" in out
    assert "--out DIR" in out
    assert "..." not in out.splitlines()[2]  # the first line is whole


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["chek", "level"], ["No such command 'chek'. Did you mean 'check'? (see cablefem --help)"]),
        (["check"], ["Missing argument 'SCENE'. (see cablefem check --help)"]),
        (["check", "level", "--tl", "1"], ["No such option: --tl", "--tol"]),
        (["check", "level", "--tol"], ["'--tol' requires an argument"]),
        (["check", "level", "--tol", "abc"], ["'--tol': 'abc' is no number"]),
        (["check", "level", "--tol", "nan"], ["--tol must lie in [1e-06, 0.2], got nan"]),
        (["check", "level", "--tol-tension", "0"], ["--tol-tension must lie in"]),
        (["check", "level", "--with-tol", "-1"], ["--with-tol must lie in [0, 1], got -1"]),
        (["check", "level", "more"], ["unexpected extra argument"]),
        (["check", "levl"], ["scene = 'levl': no built-in scene, no file. Did you mean level?"]),
        (["check", "bare"], ["scene bare has no [mass] and [travel]: a bare cable is for modes and scenes only"]),
        (["run", "bare", *QUICK], ["scene bare has no [mass] and [travel]"]),
        (["advise", "bare", "--tol", "1e-2"], ["scene bare has no [mass] and [travel]"]),
        (["advise", "level", "--tol", "0"], ["--tol must lie in"]),
        (["chart", "bare"], ["scene bare has no [mass] and [travel]"]),
        (["check", "level", "--with", "no.csv"], ["no.csv: cannot be read (No such file or directory)"]),
        (["scenes", "levle"], ["Did you mean level?"]),
        (["run", "level", "--method", "fourir"], ["unknown method 'fourir'. Did you mean fourier?"]),
        (["run", "level", "--method", "fourier", "--set", "trms=3"], ["fourier has no setting 'trms'", "mean terms?"]),
        (["run", "level", "--method", "fourier", "--set", "terms=0"], ["terms must lie in [1, 2000], got 0"]),
        (["run", "level", "--method", "fourier", "--set", "terms=x"], ["terms must be an integer, got 'x'"]),
        (
            ["run", "level", "--method", "fourier", "--set", "terms=0,-1", "--set", "trms=3", "--set", "steps=1"],
            ["terms must lie in [1, 2000], got 0", "terms must lie in [1, 2000], got -1", "no setting 'trms'",
             "steps must lie in"],
        ),
        (["run", "level", "--method", "fourier", "--set", "terms"], ["--set must be KEY=VALUE, got 'terms'"]),
        (["run", "level", "--method", "fourier", "--set", "scheme=newmrk"], ["Did you mean newmark?"]),
        (["run", "level", *QUICK, "--tol", "1e-2"], ["--set elements and --tol exclude", "--set steps and --tol"]),
        (["run", "level", "--method", "fixed-p1-naive", "--tol", "1e-2"], ["converges to a wrong answer"]),
        (
            ["run", "levl", "--method", "fourir", "--model", "ful", "--load", "masse", "--law", "x", "--tol", "9"],
            ["--model = 'ful': unknown. Did you mean full? Known: full, stretching, sagged, string, quasi-static.",
             "--load = '", "--law = '", "--tol must lie in", "unknown method", "scene = 'levl'"],
        ),
    ],
)  # fmt: skip
def test_bad_input_is_one_clear_line_per_fault_and_2_and_nothing_is_written(cablefem, tmp_path, arguments, said):
    code, out, err = cablefem(*arguments)
    assert (code, out) == (2, "")
    found = fault_lines(err)
    for part in said:
        assert sum(part in line for line in found) == 1, (part, found)
    assert len(found) <= len(said)
    assert file_contents(tmp_path) == {}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("gravity = = 3", ["bad.toml: not valid TOML"]),
        ("", ["bad.toml: cable: missing", "bad.toml: supports: missing"]),
        (Scene.library_text("level").replace("mass = 2002", "mas = 2002"), ["mass.mas = 2002", "mass.mass: missing"]),
        (Scene.library_text("level").replace("span = 2000.0", "span = nan"), ["supports.span = nan"]),
    ],
)
def test_a_bad_scene_file_is_told_fault_by_fault_with_its_name(cablefem, tmp_path, text, said):
    (tmp_path / "bad.toml").write_text(text)
    code, out, err = cablefem("check", "bad.toml")
    assert (code, out) == (2, "")
    found = fault_lines(err)
    assert len(found) == len(said)
    for part in said:
        assert any(part in line and line.startswith("bad.toml: ") for line in found), (part, found)


def test_a_fault_of_ours_is_owned_up_to_and_never_looks_like_a_verdict(monkeypatch, capsys):
    monkeypatch.setattr(Scene, "library", lambda: 1 / 0)
    assert cli.main(["scenes"]) == 2
    err = capsys.readouterr().err
    assert "ZeroDivisionError" in err
    assert err.splitlines()[-1].startswith(
        "cablefem: this is a fault of cablefem, not of your input (ZeroDivisionError: "
    )


def test_ctrl_c_that_a_module_turns_into_an_error_of_its_import_is_ctrl_c(monkeypatch, capsys):
    def import_interrupted():
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise ImportError("initialization failed") from None

    monkeypatch.setattr(Scene, "library", import_interrupted)
    monkeypatch.setattr(sys, "argv", ["cablefem", "scenes"])
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)  # is put back
    before = signal.getsignal(signal.SIGINT)
    try:
        assert cli.main() == 130
    finally:
        signal.signal(signal.SIGINT, before)
    assert fault_lines(capsys.readouterr().err) == [
        "interrupted; files that were written are whole, and the command can be given again"
    ]


def test_ctrl_c_in_a_destructor_or_a_fork_which_python_drops_ends_the_command():
    script = """
import os, signal, sys, time
from validation import cli

def interrupted():
    signal.raise_signal(signal.SIGINT)

def command(arguments):
    os.register_at_fork(after_in_parent=interrupted)
    if os.fork() == 0:
        os._exit(0)
    time.sleep(30.0)

cli.run_command = command
sys.exit(cli.main())
"""
    begin = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (done.returncode, fault_lines(done.stderr)) == (
        130, ["interrupted; files that were written are whole, and the command can be given again"]
    )  # fmt: skip
    assert time.perf_counter() - begin < 20.0


def test_ctrl_c_while_the_command_is_loaded_leaves_no_traceback():
    script = """
import signal, sys

class Interrupting:
    def find_spec(self, name, *of):
        if name == "typer":
            signal.raise_signal(signal.SIGINT)

sys.meta_path.insert(0, Interrupting())
from validation.__main__ import main
main()
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (-signal.SIGINT, "")


def test_a_pipe_gets_plain_lines_whatever_the_width(cablefem, monkeypatch):
    monkeypatch.setenv("COLUMNS", "20")
    _, out, _ = cablefem("scenes")
    assert "\x1b" not in out
    assert out.isascii()
    assert len(out.splitlines()) == len(Scene.library()) + len(Line.library()) + 1
    assert all(line == line.rstrip() for line in out.splitlines())


@pytest.mark.parametrize("columns", [30, 80, 200])
def test_a_terminal_of_any_width_gets_every_word(monkeypatch, capsys, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    assert cli.main(["scenes"]) == 0
    out = re.sub(r"\x1b\[[0-9;]*m", "", capsys.readouterr().out)
    assert max(map(len, out.splitlines())) <= columns
    letters = "".join(out.split())
    for name, title in Scene.library().items():
        assert name in letters
        assert set(title.split()) <= set(out.split())


def test_a_reader_that_leaves_early_is_no_fault(tmp_path):
    shell = f"{sys.executable} -m validation.cli methods | head -n 1"
    done = subprocess.run(["bash", "-c", shell], capture_output=True, text=True, cwd=Path(cli.__file__).parents[1])
    assert done.stdout.startswith("following-p1")
    assert done.stderr == ""
