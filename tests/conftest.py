"""The command, one BLAS thread and one core: on a shared machine threads that wait for each other cost tenfold."""

import os
import re

import pytest
from threadpoolctl import threadpool_limits


def pytest_configure(config):
    """Stay on one core: a check then forks no solvers that load all they need anew, a tenth of its time.

    Forks: tests/validation/test_sidebyside.py, and the commands of .ci/commands.
    """
    distributes = getattr(config.option, "numprocesses", None)  # its workers would inherit its core
    if hasattr(os, "sched_setaffinity") and not distributes:
        cores = sorted(os.sched_getaffinity(0))
        number = int(os.environ.get("PYTEST_XDIST_WORKER", f"gw{os.getpid()}").removeprefix("gw"))
        os.sched_setaffinity(0, {cores[number % len(cores)]})


@pytest.fixture(scope="session", autouse=True)
def one_thread():
    with threadpool_limits(1):
        yield


@pytest.fixture
def cablefem(capsys, tmp_path, monkeypatch):
    """Call the command in an empty folder; returns (exit code, standard output, standard error).

    Rows on progress, one a minute, are left out: only slow machines print them.
    """
    from validation import cli  # slow to load

    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        code = cli.main([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        assert "Traceback" not in err
        return code, out, re.sub(r"(?m)^.*: \d+%.*\n", "", err)

    return call


def pytest_collection_modifyitems(items):
    """Fine ladders take minutes by design; nothing takes an hour."""
    for item in items:
        if item.get_closest_marker("slow"):
            item.add_marker(pytest.mark.timeout(3600))
