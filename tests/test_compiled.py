"""Compiled functions: kept from run to run, forgotten when a file of the folder changes; they round as Python does."""

import importlib
import sys

import pytest
from llvmlite.binding import get_host_cpu_features
from numba import njit

from cablefem.compiled import compiling_decorator

USER = (
    "from {package} import compiled\nfrom {package}.law import law\n\n@compiled\ndef twice(x):\n    return 2 * law(x)\n"
)


def freshly_imported(name):
    """Return the function as a new process would import it."""
    for module in [module for module in sys.modules if module.partition(".")[0] == name]:
        del sys.modules[module]
    importlib.invalidate_caches()
    return importlib.import_module(f"{name}.user").twice


@pytest.mark.parametrize("whole", [True, False], ids=["all sources", "own source alone"])
def test_a_law_that_changes_is_not_missed_by_who_has_taken_it_in(tmp_path, monkeypatch, whole):
    name = f"house_{whole}".lower()
    monkeypatch.syspath_prepend(tmp_path)
    folder = tmp_path / name
    folder.mkdir()
    decorator = (
        "from cablefem.compiled import compiling_decorator\ncompiled = compiling_decorator(__file__)\n"
        if whole
        else "from numba import njit\ncompiled = njit(cache=True)\n"
    )
    (folder / "__init__.py").write_text(decorator)
    (folder / "user.py").write_text(USER.format(package=name))
    law = f"from {name} import compiled\n\n@compiled\ndef law(x):\n    return x + {{}}\n"
    (folder / "law.py").write_text(law.format(1))
    assert freshly_imported(name)(3) == 8
    again = freshly_imported(name)
    assert again(3) == 8
    assert again.stats.cache_hits
    (folder / "law.py").write_text(law.format("10  # changed"))
    assert (freshly_imported(name)(3) == 26) is whole


@pytest.mark.parametrize("shared", [False, True])
def test_an_inner_function_serves_compiled_ones_and_refuses_others(shared):
    def half(x):
        return 0.5 * x

    inner = compiling_decorator(__file__, inner=True, shared=shared)(half)
    compiled = compiling_decorator(__file__)
    assert compiled(lambda x: inner(x) + inner(x + 2.0))(3.0) == 4.0
    with pytest.raises(TypeError, match="half is for compiled functions"):
        inner(3.0)


def test_loops_round_alike_with_a_processors_own_instructions_and_without_them():
    """One instruction for product and sum rounds once instead of twice: .ci/run changes the kernels of BLAS only."""

    def product_and_sum(a, b, c):
        return a * b + c

    tiny = 2.0**-30
    values = 1.0 + tiny, 1.0 - tiny, -1.0
    assert product_and_sum(*values) == 0.0
    assert compiling_decorator(__file__)(product_and_sum)(*values) == 0.0
    if get_host_cpu_features().get("fma"):
        assert njit(fastmath={"contract"})(product_and_sum)(*values) == -(tiny**2)
