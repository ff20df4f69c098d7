"""One BLAS thread: the matrices are small, and threads that wait for each other cost tenfold on a shared machine."""

import fcntl
import os
import tempfile
from pathlib import Path

import pytest
from threadpoolctl import threadpool_limits


@pytest.fixture(scope="session", autouse=True)
def one_thread():
    with threadpool_limits(1):
        yield


@pytest.fixture(scope="session", autouse=True)
def compiled():
    """On a fresh machine the first calls compile for half a minute: once, a wing a worker, and in no test's time."""
    from cablefem import Scene
    from validation.core.running import run

    elements = ({"elements": 2}, {"elements": 2, "scheme": "radau"})
    wings = [("following-p2", elements), ("fourier-kink", ({"terms": 3},))]
    for method, settings in wings if os.environ.get("PYTEST_XDIST_WORKER", "gw0")[-1] in "02468" else wings[::-1]:
        with (Path(tempfile.gettempdir()) / f"cablefem-compiles-{method}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            for scene in ("level", "zipline"):
                for how in settings:
                    run(Scene.load(scene), method, steps=20, until=0.3, **how)


def pytest_collection_modifyitems(items):
    """Fine ladders take minutes by design; nothing takes an hour."""
    for item in items:
        if item.get_closest_marker("slow"):
            item.add_marker(pytest.mark.timeout(3600))
