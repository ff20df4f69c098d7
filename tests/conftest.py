"""The command, and one BLAS thread: on a shared machine threads that wait for each other cost tenfold."""

import pytest
from threadpoolctl import threadpool_limits


@pytest.fixture(scope="session", autouse=True)
def one_thread():
    with threadpool_limits(1):
        yield


@pytest.fixture
def cablefem(capsys, tmp_path, monkeypatch):
    """Call the command in an empty folder; returns (exit code, standard output, standard error)."""
    from validation import cli  # slow to load

    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        code = cli.main([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        assert "Traceback" not in err
        return code, out, err

    return call


def pytest_collection_modifyitems(items):
    """Fine ladders take minutes by design; nothing takes an hour."""
    for item in items:
        if item.get_closest_marker("slow"):
            item.add_marker(pytest.mark.timeout(3600))
