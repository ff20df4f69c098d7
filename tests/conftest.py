"""One BLAS thread: the matrices are small, and threads that wait for each other cost tenfold on a shared machine."""

import fcntl
import hashlib
import os
import tempfile
from pathlib import Path

import pytest
from threadpoolctl import threadpool_limits


@pytest.fixture(scope="session", autouse=True)
def one_thread():
    with threadpool_limits(1):
        yield


FIRST_CALLS = (
    ("following-p2", "level", {"elements": 2}),
    ("following-p2", "level", {"elements": 2, "scheme": "radau"}),
    ("following-p2", "zipline", {"elements": 2, "scheme": "radau"}),
    ("fourier-kink", "zipline", {"terms": 3}),
    ("fourier-kink", "level", {"terms": 3}),
)


@pytest.fixture(scope="session", autouse=True)
def compiled():
    """On a fresh machine the first calls compile for minutes: once, in no test's time, by workers that meet halfway."""
    from cablefem import Scene
    from validation.core.running import run

    here = hashlib.sha256(f"{__file__} {os.environ.get('NUMBA_CACHE_DIR')}".encode()).hexdigest()[:12]
    forward = os.environ.get("PYTEST_XDIST_WORKER", "gw0")[-1] in "02468"
    for i in range(len(FIRST_CALLS)) if forward else reversed(range(len(FIRST_CALLS))):
        method, scene, how = FIRST_CALLS[i]
        with (Path(tempfile.gettempdir()) / f"cablefem-compiles-{here}-{i}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            run(Scene.load(scene), method, steps=20, until=0.3, **how)


def pytest_collection_modifyitems(items):
    """Fine ladders take minutes by design; nothing takes an hour."""
    for item in items:
        if item.get_closest_marker("slow"):
            item.add_marker(pytest.mark.timeout(3600))
