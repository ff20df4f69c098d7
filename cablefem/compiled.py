"""Compiled inner loops.

A wheel may bring them compiled (validation/wheel.py), for processors with the features of `PROCESSOR`.
"""

import hashlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from llvmlite.binding import get_host_cpu_features
from numba import njit, types
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.datamodel import register_default
from numba.core.datamodel.models import OpaqueModel
from numba.core.imputils import lower_constant
from numba.core.registry import CPUDispatcher
from numba.core.runtime import rtsys

# zero divisors are not tested; without entries for C, compiling is faster
OPTIONS: dict[str, Any] = {"error_model": "numpy", "no_cfunc_wrapper": True}
PROCESSOR = "x86-64-v3"
FEATURES = "avx2", "fma", "bmi", "bmi2"  # that tell it from older ones
SHIPPED = "shipped"  # folder of compiled functions beside their source


class _Cache(FunctionCache):
    """numba's cache without the types that only compiling needs, and the functions of a wheel."""

    def __init__(self, function: Callable, stamp: bytes) -> None:
        super().__init__(function)
        self._cache_file._source_stamp = stamp
        folder = Path(function.__code__.co_filename).parent / SHIPPED
        self._shipped = IndexDataCacheFile(str(folder), self._impl.filename_base, stamp) if folder.is_dir() else None

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            try:
                return self._load_shipped_overload(sig, target_context) or self._load_overload(sig, target_context)
            except (ImportError, AttributeError):  # another version's types
                self._cache_file.flush()
        return None

    def _load_shipped_overload(self, sig: Any, target_context: Any) -> Any:
        """A function as it came with the wheel, by its types and code; None: not there, or not for this processor."""
        if self._shipped is None or not can_run_shipped_code(get_host_cpu_features()):
            return None
        types, _, code = self._index_key(sig, target_context.codegen())
        for key in self._shipped._load_index():
            if (key[0], key[2]) == (types, code):
                return self._impl.rebuild(target_context, self._shipped.load(key))
        return None


def can_run_shipped_code(processor_features: Mapping[str, bool]) -> bool:
    """Whether a processor with these features can run what is compiled for `PROCESSOR`."""
    return all(processor_features.get(name) for name in FEATURES)


class _InnerType(types.Dispatcher):
    """Without an address, so that functions which take others can be cached."""


register_default(_InnerType)(OpaqueModel)
lower_constant(_InnerType)(lambda context, *_: context.get_dummy_value())


class _Inner(CPUDispatcher):
    @property
    def _numba_type_(self) -> Any:
        return _InnerType(self)

    def __call__(self, *arguments: Any) -> Any:
        raise TypeError(f"{self.py_func.__name__} is for compiled functions to call")


class _InnerCode(JITCodeLibrary):
    """Code that stays as it is until a caller takes it in: only then is it optimised and made machine code."""

    @property
    def codegen(self) -> Any:
        return self

    def set_env(self, name: str, env: Any) -> None:
        """No address to set: the callers hold their own."""

    def get_pointer_to_function(self, name: str) -> int:
        return 0

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        """Leave it to the callers."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


class _InnerCompiler(Compiler):
    def __init__(self, typing: Any, target: Any, library: Any, *arguments: Any) -> None:
        super().__init__(typing, target, _InnerCode(target.codegen(), "inner"), *arguments)


def _source_stamp(source_file: str) -> bytes:
    """A stamp of the sources in the folder of a file and below, and of the driver's."""
    driver = Path(__file__).parent / "newmark"
    sources = sorted([*driver.glob("*.py"), *Path(source_file).parent.rglob("*.py")])
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).digest()


def compiling_decorator(source_file: str, *, inner: bool = False, shared: bool = False) -> Callable[[Callable], Any]:
    """The decorator of compiled functions in the folder of a source file, and below.

    inner : only compiled functions call it, which take it in; compiling is faster by a third.
    shared : of an inner one, a caller takes in one copy for all its calls; compiling calls of large ones is faster.
    A change in any source file there, or in the driver's, compiles all anew: numba misses changes in called functions.
    """
    stamp = b"" if inner else _source_stamp(source_file)  # what others take in is not kept
    special: Any = {}
    if inner:
        special = {"no_cpython_wrapper": True, "pipeline_class": _InnerCompiler, "forceinline": not shared}

    def compiled(function: Callable) -> Any:
        fast: Any = njit(**OPTIONS, **special)(function)
        if hasattr(fast, "_cache"):  # unless numba's compilation is off
            if inner:
                fast.__class__ = _Inner
            else:
                fast._cache = _Cache(function, stamp)
        return fast

    return compiled
