"""One BLAS thread: the matrices are small, and threads that wait for each other cost tenfold on a shared machine."""

import pytest
from threadpoolctl import threadpool_limits


@pytest.fixture(scope="session", autouse=True)
def one_thread():
    with threadpool_limits(1):
        yield


def pytest_collection_modifyitems(items):
    """Fine ladders take minutes by design; nothing takes an hour."""
    for item in items:
        if item.get_closest_marker("slow"):
            item.add_marker(pytest.mark.timeout(3600))
