"""Jobs that need nothing of one another, run in processes where there are cores for them: same results, sooner."""

import multiprocessing
import os
import pickle
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import connection
from typing import Any, TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")
Progress = Callable[..., None]
Job = Callable[[Progress], Result]


def alone(work: Callable[[], Result]) -> Job[Result]:
    """Return work that has no progress to report as a job."""
    return lambda progress: work()


def side_by_side(
    jobs: Sequence[Job[Result]], progress: Progress | None = None, meanwhile: Callable[[], object] | None = None
) -> list[Result]:
    """Return what each job returns, in their order; an exception in one is raised here and ends the others.

    A job is called with a function that reports its progress, which is passed on to `progress`.  Jobs are forked, so
    that they need no pickling; where nothing can be forked, or on one core, they run one after another.

    meanwhile : called here once, as soon as a core is idle because the first of several jobs is done.
    """
    report = progress or (lambda *told: None)
    if len(jobs) < 2 or not _can_fork():
        return [job(report) for job in jobs]
    return _found(_started(jobs), report, meanwhile)


def spread(work: Callable[[Item], Result], items: Sequence[Item], told: Callable[[int, Result], None]) -> None:
    """Call told(i, work(items[i])) for all items, each as soon as it is done; every core takes the next one left."""
    context = multiprocessing.get_context("fork") if _can_fork() else multiprocessing.get_context()
    turn = context.Value("i", 0)

    def job(report: Progress) -> None:
        while True:
            with turn.get_lock():
                i, turn.value = turn.value, turn.value + 1
            if i >= len(items):
                return
            report(i, work(items[i]))

    side_by_side([job] * min(_cores(), len(items)), told)


@contextmanager
def aside(work: Callable[[], object]) -> Iterator[None]:
    """Do work in a process of its own while the body runs, or before it; an exception in it is raised at the end."""
    if not _can_fork():
        work()
        yield
        return
    started = _started([alone(work)])
    try:
        yield
        _found(started, lambda *told: None)
    finally:
        _end(started)


@contextmanager
def ready(load: Callable[[], object], work: Callable[..., object]) -> Iterator[Callable[..., object]]:
    """Give a function that hands its arguments to `work`, in a process that calls `load` while they come to be.

    An exception in it is raised at the end.  Where nothing can be forked, it works here and at once.
    """
    if not _can_fork():
        yield work
        return
    theirs, ours = multiprocessing.Pipe(duplex=False)

    def job(progress: Progress) -> None:
        ours.close()
        load()
        work(*theirs.recv())

    started = _started([job])
    try:
        yield lambda *arguments: ours.send(arguments)
        _found(started, lambda *told: None)
    finally:
        _end(started)
        ours.close()
        theirs.close()


Started = list[tuple[connection.Connection, Any]]


def _started(jobs: Sequence[Job[Any]]) -> Started:
    """Return the end of a pipe and the process of each job."""
    context = multiprocessing.get_context("fork")
    ends: Started = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads at a fork: ours only draw on the terminal
        for job in jobs:
            ours, theirs = context.Pipe(duplex=False)
            process = context.Process(target=_work, args=(job, theirs))
            process.start()
            theirs.close()
            ends.append((ours, process))
    return ends


def _found(started: Started, report: Progress, meanwhile: Callable[[], object] | None = None) -> list[Any]:
    found: dict[Any, Any] = {}
    waiting = [end for end, _ in started]
    try:
        while waiting:
            for end in connection.wait(waiting):
                assert isinstance(end, connection.Connection)
                try:
                    kind, content = end.recv()
                except EOFError:
                    raise RuntimeError("a process that computes was killed, perhaps for want of memory") from None
                if kind == "failed":
                    raise content
                if kind == "told":
                    report(*content)
                else:
                    found[end] = content
                    waiting.remove(end)
                    if meanwhile is not None and waiting and len(found) == 1:
                        meanwhile()
    finally:
        _end(started)
    return [found[end] for end, _ in started]


def _end(started: Started) -> None:
    for _, process in started:
        process.terminate()
        process.join()


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _can_fork() -> bool:
    forks = "fork" in multiprocessing.get_all_start_methods()
    return _cores() > 1 and forks and not multiprocessing.current_process().daemon


def _work(job: Job[Any], out: connection.Connection) -> None:
    try:
        out.send(("done", job(lambda *told: out.send(("told", told)))))
    except KeyboardInterrupt:
        pass  # the parent has it too
    except BaseException as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:
            error = RuntimeError(f"{type(error).__name__}: {error}")
        out.send(("failed", error))
