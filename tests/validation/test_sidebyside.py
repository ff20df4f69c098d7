"""Jobs in processes of their own: their results in order, what they report, and how they fail."""

import multiprocessing
import os
import signal

import pytest

from validation.core import sidebyside
from validation.core.sidebyside import do_in_background, map_in_parallel, run_in_parallel

forks = pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="nothing can be forked")


def job_named(name):
    def work(report):
        report(name, 0.5)
        return name, os.getpid()

    return work


@pytest.mark.parametrize("cores", [1, 2])
def test_results_come_in_order_and_progress_is_passed_on(monkeypatch, cores):
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: set(range(cores)), raising=False)
    results = []
    names, pids = zip(*run_in_parallel([job_named("a"), job_named("b")], lambda *x: results.append(x)), strict=True)
    assert names == ("a", "b")
    assert sorted(results) == [("a", 0.5), ("b", 0.5)]
    assert (pids == (os.getpid(), os.getpid())) == (cores == 1 or not sidebyside._can_fork())


@pytest.mark.parametrize("cores", [1, 2, 7])
def test_every_item_is_worked_on_once_and_told_as_it_is_done(monkeypatch, cores):
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: set(range(cores)), raising=False)
    results = []
    map_in_parallel(lambda x: 10 * x, [3, 1, 2], lambda i, result: results.append((i, result)))
    assert sorted(results) == [(0, 30), (1, 10), (2, 20)]
    map_in_parallel(failing_job, [], lambda *what: results.append(what))
    assert len(results) == 3
    with pytest.raises(ValueError, match="on purpose"):
        map_in_parallel(failing_job, [1, 2], lambda *what: results.append(what))


@forks
def test_an_interrupt_of_the_terminal_is_answered_by_the_first_process_alone(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 1}, raising=False)
    results = []
    map_in_parallel(lambda x: os.kill(os.getpid(), signal.SIGINT), [1, 2], lambda *what: results.append(what))
    assert sorted(results) == [(0, None), (1, None)]


@forks
def test_a_forked_process_forks_no_further(monkeypatch):
    """A grid keeps every core busy with points; two solvers beside each other in each would only get in the way."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 1}, raising=False)
    results = []
    map_in_parallel(
        lambda x: (os.getpid(), [pid for _, pid in run_in_parallel([job_named(x), job_named(x)])]),
        [1, 2],
        lambda i, r: results.append(r),
    )
    assert all(mine != os.getpid() and within == [mine, mine] for mine, within in results)


def failing_job(report):
    raise ValueError("on purpose")


class Odd(RuntimeError):
    def __init__(self, one, two):
        super().__init__(one)


def job_with_odd_failure(report):
    raise Odd("cannot be pickled", 2)


@pytest.mark.parametrize(("work", "kind"), [(failing_job, ValueError), (job_with_odd_failure, RuntimeError)])
def test_an_exception_is_raised_where_the_results_were_wanted(work, kind):
    with pytest.raises(kind, match=r"on purpose|could not answer|cannot be pickled"):
        run_in_parallel([job_named("a"), work])


@forks
def test_a_process_that_is_killed_is_an_error_and_nothing_hangs(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 1}, raising=False)
    with pytest.raises(RuntimeError, match="was killed"):
        run_in_parallel([job_named("a"), lambda report: os.kill(os.getpid(), signal.SIGKILL)])


@pytest.mark.parametrize("cores", [1, 2])
def test_work_done_aside_is_done_at_the_end_and_says_why_not(monkeypatch, tmp_path, cores):
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: set(range(cores)), raising=False)
    with do_in_background(lambda: (tmp_path / "file").write_text("there")):
        pass
    assert (tmp_path / "file").read_text() == "there"
    with pytest.raises(ValueError, match="on purpose"), do_in_background(lambda: failing_job(None)):
        pass
    with pytest.raises(KeyError), do_in_background(lambda: None):
        raise KeyError
