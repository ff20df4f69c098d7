"""Exact answers against the solvers that reach them: rows of `cablefem oracles`, but those of lines (tests/line)."""

from functools import cache

import pytest

from validation.commands.oracles import study

TASKS = {" ".join(task.key): task for task in study.all_tasks() if task.oracle != "line"}
DEAR = (  # about a second and more
    "ellipse", "incline friction", "quasi-static up to",
    "rest held", "rocket", "accelerating-mass through",
)  # fmt: skip
DEAR_OF_SINES = (
    "rest car", "moving-force", "moving-mass mass", "moving-mass acc", "moving-mass from",
    "accelerating-force", "damped", "moving-mass limit of small sag, model s",
)  # fmt: skip


def is_expensive(key):
    plain = key.endswith(" fourier") and not key.startswith("moving-mass the paper")
    sines = key.endswith("fourier-kink") and key.startswith(DEAR_OF_SINES)
    return key.endswith("fixed-hermite") or key.startswith(DEAR) or plain or sines


@cache
def computed_row(key):
    return TASKS[key].compute_row()


@pytest.mark.parametrize("key", [pytest.param(key, marks=[pytest.mark.slow] * is_expensive(key)) for key in TASKS])
def test_a_solver_is_as_near_an_exact_answer_as_its_bar_and_its_order_say(key):
    """Rows that must fail stand beside them: a term left out, a method that is wrong."""
    found = computed_row(key)
    assert found["verdict"] == found["expected"], found


@pytest.mark.parametrize(
    ("method", "low", "high", "error"),
    [
        ("following-p1", 1.8, 2.1, 1e-5), ("following-p2", 2.4, 2.8, 1e-6), ("following-p4", 2.7, 3.1, 4e-7),
        ("fixed-p1-path", 0.9, 1.1, 1e-2), ("fourier", 0.9, 1.1, 7e-3),
        ("fourier-kink", 1.8, 2.3, 2e-5), ("wavelet", 0.9, 1.3, 8e-3),
    ],
)  # fmt: skip
def test_a_moving_mass_has_the_orders_and_errors_of_the_formulations(method, low, high, error):
    """Errors alone: a bar that is wide would hold as well."""
    found = computed_row(f"moving-mass the paper's mass and speed, g (1 + V²) {method}")
    assert low < found["observed_order"] < high
    assert found["error"] < error
