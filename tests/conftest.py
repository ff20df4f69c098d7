"""One BLAS thread: the matrices are small, and threads that wait for each other cost tenfold on a shared machine."""

import pytest
from threadpoolctl import threadpool_limits


@pytest.fixture(scope="session", autouse=True)
def one_thread():
    with threadpool_limits(1):
        yield
