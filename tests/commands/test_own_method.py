"""A method of another package reaches the command by an entry point."""

import pytest

from tests.commands.calls import fault_lines
from tests.validation import sines
from validation import cli


@pytest.fixture
def install_method_package(tmp_path, monkeypatch):
    """Install a package with an entry point, as pip would; returns a function of its name and value."""

    def install(name, value):
        folder = tmp_path / "site" / "theirs-1.0.dist-info"
        folder.mkdir(parents=True)
        (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: theirs\nVersion: 1.0\n")
        (folder / "entry_points.txt").write_text(f"[cablefem.methods]\n{name} = {value}\n")
        monkeypatch.syspath_prepend(str(folder.parent))

    return install


@pytest.mark.usefixtures("without_animation")
def test_it_is_listed_and_runs(cablefem, install_method_package):
    arguments = "--method", "my-sines", "--set", "waves=6", "--set", "steps=60", "--no-bars"
    assert cablefem("run", "level", *arguments)[0] == 2
    install_method_package("my-sines", "tests.validation.sines:METHOD")
    assert "my-sines: one line for the list" in cablefem("methods")[1]
    code, out, err = cablefem("run", "level", *arguments)
    assert (code, err) == (0, "")
    assert "by my-sines (waves=6, steps=60)" in out


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("mine", "no_such_module:METHOD", "method mine: no_such_module:METHOD cannot be loaded (No module named"),
        ("mine", "tests.validation.sines:METHOD", "must be a new Method with this name"),
        ("fourier", "tests.validation.sines:METHOD", "must be a new Method with this name"),
    ],
)
def test_what_is_no_method_is_said(cablefem, install_method_package, name, value, said):
    install_method_package(name, value)
    for command in (("methods",), ("run", "level", "--method", "other")):
        code, _, err = cablefem(*command)
        assert code == 2
        (line,) = fault_lines(err)
        assert said in line


def test_it_refuses_a_car_that_rolls(cablefem, install_method_package):
    install_method_package("my-sines", "tests.validation.sines:METHOD")
    for scene in ("zipline", "tramway"):
        code, out, err = cablefem("run", scene, "--method", "my-sines")
        assert (code, out) == (2, "")
        assert "the car must grip the cable" in err


def test_what_breaks_in_it_is_its_fault(install_method_package, monkeypatch, capsys, tmp_path):
    install_method_package("my-sines", "tests.validation.sines:METHOD")
    monkeypatch.setattr(sines.Sines, "residual", lambda self, *state: 1 / 0)
    assert cli.main(["run", "level", "--method", "my-sines", "--out", str(tmp_path)]) == 2
    assert "this is a fault of tests, not of your input (ZeroDivisionError" in capsys.readouterr().err
