"""The README tells the truth: its examples run, its commands exist, its scene is a scene."""

import re
from pathlib import Path

import pytest

from cablefem import Scene
from tests.validation.test_plugin import PLUGIN
from validation.commands.report.command import QUICK_PARTS

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")
PYTHON = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
EXAMPLES = [code for code in PYTHON if "def test_" not in code]
MODULES = [code for code in PYTHON if "def test_" in code]

pytest_plugins = ["pytester"]


def test_there_are_examples_and_a_test_module_and_few_words():
    assert len(EXAMPLES) == 3
    assert len(MODULES) == 1
    assert len(re.findall(r"\w+", README)) <= 1700


@pytest.mark.parametrize("code", EXAMPLES, ids=lambda code: code.strip().splitlines()[-1][:40])
def test_example_runs(code, capsys):
    exec(compile(code, "README.md", "exec"), {"__name__": "example"})
    assert len(code.splitlines()) < 25


def test_the_test_module_runs_as_a_user_would_run_it(pytester):
    pytester.makepyfile(test_my_solver=MODULES[0])
    result = pytester.runpytest(*PLUGIN, "-q", "-p", "no:cacheprovider")
    result.assert_outcomes(passed=1)


def test_the_scene_is_a_scene_and_a_fault_in_it_is_found():
    text = re.search(r"```toml\n(.*?)```", README, flags=re.DOTALL).group(1)
    assert Scene.from_toml(text).mass.mass == 95.0
    with pytest.raises(ValueError, match="rolling_friction"):
        Scene.from_toml(text.replace("rolling_friction = 0.02", "rolling_friction = -0.02"))


def test_every_command_of_the_table_exists_and_none_is_missing():
    from typer.main import get_command

    from validation.cli import app

    assert commands_named_in_readme() == set(get_command(app).commands)


def commands_named_in_readme():
    return set(re.findall(r"`cablefem (\w+)", README))


def test_continuous_integration_runs_every_command_on_real_input():
    script = (Path(__file__).parent.parent / ".ci" / "commands").read_text(encoding="utf-8")
    lines = script.partition("<<'COMMANDS'\n")[2].partition("\nCOMMANDS")[0].splitlines()
    assert "report --quick" in lines
    not_run = commands_named_in_readme() - {line.split()[0] for line in lines} - {part[0] for part in QUICK_PARTS}
    assert not not_run
