"""How inner loops are compiled, and kept in a cache that knows all files they are made of."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit
from numba.core.caching import FunctionCache
from numba.core.registry import CPUDispatcher
from numba.core.runtime import rtsys

# no test for a zero divisor: norms catch NaN, infinity; no entry for C, which would be compiled with each function
OPTIONS: dict[str, Any] = {"error_model": "numpy", "no_cfunc_wrapper": True}


class _Cache(FunctionCache):
    """numba's, but for what it loads to compile other functions: that takes longer than to load one that is there."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            try:
                return self._load_overload(sig, target_context)
            except (ImportError, AttributeError):  # written by a version with modules or types that are gone
                self._cache_file.flush()
        return None


class _Inner(CPUDispatcher):
    """A compiled function without an entry from Python."""

    def __call__(self, *arguments: Any) -> Any:
        raise TypeError(f"{self.py_func.__name__} is for compiled functions to call")


def compiler(file: str, *, inner: bool = False) -> Callable[[Callable], Any]:
    """Return the decorator of the compiled functions in the folder of a file, and below.

    inner : for functions that only compiled ones call.  Their entry from Python is left out: it takes a sixth of the
        time that compiling takes.
    numba's cache forgets a function when its own file changes, not when one does whose functions it has taken in: the
    stamp of every function is therefore that of all sources together.
    """
    sources = sorted(Path(file).parent.rglob("*.py"))
    stamp = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).digest()

    def compiled(function: Callable) -> Any:
        fast: Any = njit(**OPTIONS | {"no_cpython_wrapper": inner})(function)
        if hasattr(fast, "_cache"):  # not where numba is told to compile nothing
            fast._cache = _Cache(function)
            fast._cache._cache_file._source_stamp = stamp
            if inner:
                fast.__class__ = _Inner
        return fast

    return compiled
