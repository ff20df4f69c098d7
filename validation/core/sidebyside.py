"""Independent jobs in forked processes, or one after another on one core.

Forks inherit jobs; results and progress are pickled.
"""

import multiprocessing
import os
import signal
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, as_completed, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from typing import Any, TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")
Progress = Callable[..., None]  # label, fraction done, place reached
Job = Callable[[Progress], Result]


def no_progress(*progressed: object) -> None:
    """A progress report that does nothing."""


_inherited_calls: list[Any] = []  # what a forked process calls


def run_in_parallel(
    jobs: Sequence[Job[Result]], report: Progress = no_progress, when_first_done: Callable[[], object] = no_progress
) -> list[Result]:
    """Results of all jobs in order; an exception ends all and is raised.

    when_first_done : called here once, when the first of several jobs is done.
    """
    if len(jobs) < 2 or not _can_fork():
        return [job(report) for job in jobs]
    queue = multiprocessing.get_context("fork").SimpleQueue()

    def work(i: int) -> Result:
        return jobs[i](lambda *progressed: queue.put(progressed))

    def pass_on_progress() -> None:
        while not queue.empty():
            report(*queue.get())

    with _forked_pool(len(jobs), work) as submit:
        futures = [submit(i) for i in range(len(jobs))]
        _wait_for_all(futures, pass_on_progress, when_first_done)
        return [future.result() for future in futures]


def _wait_for_all(
    futures: Sequence[Future], while_waiting: Callable[[], None], when_first_done: Callable[[], object]
) -> None:
    """Wait until all are done; raises what the first one raised.  while_waiting : called every 0.1 s."""
    running = set(futures)
    while running:
        done, running = wait(running, timeout=0.1, return_when=FIRST_COMPLETED)
        while_waiting()
        for future in done:
            future.result()  # raises what the job raised
        if done and running:
            when_first_done()
            when_first_done = no_progress


def map_in_parallel(
    work: Callable[[Item], Result], items: Sequence[Item], on_result: Callable[[int, Result], None]
) -> None:
    """Work on all items in other processes; here call on_result(i, result of items[i]) when each is done."""
    if len(items) < 2 or not _can_fork():
        for i, item in enumerate(items):
            on_result(i, work(item))
        return
    with _forked_pool(min(_core_count(), len(items)), lambda i: (i, work(items[i]))) as submit:
        for future in as_completed([submit(i) for i in range(len(items))]):
            on_result(*future.result())


@contextmanager
def do_in_background(work: Callable[[], object]) -> Iterator[None]:
    """Do work in another process while the body runs, or after it without forks; raises what it raised."""
    if not _can_fork():
        yield
        work()
        return
    with _forked_pool(1, work) as submit:
        future = submit()
        yield
        future.result()


@contextmanager
def _forked_pool(workers: int, call: Callable[..., Any]) -> Iterator[Callable[..., Future]]:
    """Gives a function that submits call(*arguments) to a worker; an exception in the body ends all workers."""
    context = multiprocessing.get_context("fork")
    before = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(workers, context, initializer=_ignore_interrupts_and_keep_call, initargs=(call,))
    try:
        with warnings.catch_warnings():
            # a fork beside threads that only draw
            warnings.simplefilter("ignore", DeprecationWarning)
            yield partial(pool.submit, _call_inherited)
        pool.shutdown()
    except BaseException as error:
        for process in set(multiprocessing.active_children()) - before:
            process.terminate()
        pool.shutdown(cancel_futures=True)
        if isinstance(error, BrokenProcessPool):
            raise RuntimeError(
                "a process that computes was killed or could not answer, perhaps for want of memory"
            ) from error
        raise


def _ignore_interrupts_and_keep_call(call: Callable[..., Any]) -> None:
    # Ctrl+C reaches all processes of a terminal: the first one answers, and ends the others
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _inherited_calls.append(call)


def _call_inherited(*arguments: Any) -> Any:
    return _inherited_calls[-1](*arguments)


def _core_count() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _can_fork() -> bool:
    forks = "fork" in multiprocessing.get_all_start_methods()
    # a forked process forks no further: its neighbours use the other cores
    return _core_count() > 1 and forks and not _inherited_calls and not multiprocessing.current_process().daemon
