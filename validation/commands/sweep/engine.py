"""The loop of a sweep on Dask, in chunks of scenes."""

import asyncio
import json
import logging
import os
import signal
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing import resource_tracker
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cablefem.response import atomic_write, write_text
from validation.commands.sweep import job
from validation.commands.sweep.study import Point, Study
from validation.core import store
from validation.core.sidebyside import Progress, no_progress
from validation.core.store import Refused

if TYPE_CHECKING:
    from pandas import DataFrame
    from pyarrow import Schema

LARGEST = 2000  # scenes in a chunk at most
WRITES = ("rows", "study.toml")

Row = job.Row
Work = Callable[[Study, list[tuple[int, Point]]], list[Row]]


@dataclass(slots=True)
class Tally:
    total: int
    before: int  # rows that an earlier call had written
    begin: float = field(default_factory=time.perf_counter)
    status: Counter[str] = field(default_factory=Counter)
    dashboard: str = ""

    @property
    def done(self) -> int:
        return self.before + self.status.total()

    @property
    def scenes_per_second(self) -> float:
        """Scenes per second of this call."""
        return self.status.total() / max(1e-9, time.perf_counter() - self.begin)

    def __str__(self) -> str:
        failed = sum(self.status[x] for x in job.BROKEN)
        to_do = self.total - self.done
        return (
            f"{self.done} done, {failed} failed, {to_do} left, {self.scenes_per_second:.3g} scenes/s {self.dashboard}"
        )


def sweep(
    study: Study, out: Path | str, *, workers: int | None = None, scheduler: str | None = None,
    progress: Progress = no_progress, work: Work = job.compute_rows_of_points,
) -> Tally:  # fmt: skip
    """Compute every point of a study that has no row in out/rows yet; after a kill the same call goes on.

    workers : processes on this machine, one per core by default; scheduler : address of a running one.
    progress : called with a label, the fraction done, and a line on it.
    Raises Refused for a folder with rows of another study, or without Dask; after Ctrl-C a KeyboardInterrupt that
    says what is stored.
    sweep("riders.toml", Path("riders"))
    """
    out = Path(out)
    held_before = store.holds_folder(out)  # by a command that writes on
    store.claim_and_clear_folder(out, "sweep", study.name, WRITES)
    try:
        _store_or_refuse_study(study, out)
        before = finished_indices(out)
        todo = deque(i for i in range(len(study)) if i not in before)
        tally = Tally(len(study), len(before))
        progress("sweep", tally.done / tally.total, str(tally))
        if todo:
            try:
                with (
                    _hold_back_interrupt() as raise_if_interrupted,
                    _dask_client(workers, scheduler, min(len(todo), LARGEST), raise_if_interrupted) as client,
                ):
                    tally.dashboard = client.dashboard_link or ""
                    for rows in filter(None, _compute_rows(client, study, todo, work, raise_if_interrupted)):
                        write_parquet_rows(out, study, rows)
                        tally.status.update(row["status"] for row in rows)
                        progress("sweep", tally.done / tally.total, str(tally))
            except KeyboardInterrupt:
                stored = f"{tally.done} of {tally.total} scenes are stored in {out}"
                raise KeyboardInterrupt(f"{stored}; the same command goes on from there") from None
    finally:
        if not held_before:
            store.unlock_folder(out)
    return tally


def _compute_rows(
    client: Any, study: Study, todo: deque[int], work: Work, raise_if_interrupted: Callable[[], None]
) -> Iterator[list[Row]]:
    """Yield the rows of all scenes, chunk by chunk; none for a chunk whose worker died."""
    from distributed import wait

    chunks = _Chunks(client, study, todo, work, capacity=max(1, sum(client.nthreads().values())))
    chunks.submit()
    while chunks.running:
        raise_if_interrupted()
        try:
            ended = wait(list(chunks.running), timeout=0.2, return_when="FIRST_COMPLETED").done
        except TimeoutError:
            continue
        for future in ended:
            rows = chunks.take_rows(future)
            chunks.submit()
            yield rows


@dataclass(slots=True)
class _Chunks:
    """Scenes to do, and chunks of them that workers compute.

    Dask retries a chunk once if its worker died; then each of its scenes is a chunk.
    No chunk waits at a worker: it would die with it.
    """

    client: Any
    study: Study
    todo: deque[int]
    work: Work
    capacity: int  # chunks that run at once
    size: int = 1
    running: dict[Any, list[int]] = field(default_factory=dict)  # scenes by future
    suspects: deque[int] = field(default_factory=deque)  # one of them may end its worker

    def submit(self) -> None:
        """Submit chunks until every worker has one."""
        while (self.suspects or self.todo) and len(self.running) < self.capacity:
            share = max(1, len(self.todo) // (2 * self.capacity))  # smaller at the end: all workers end together
            if self.suspects:
                chunk = [self.suspects.popleft()]
            else:
                chunk = [self.todo.popleft() for _ in range(min(self.size, share))]
            numbered = [(i, self.study.point(i)) for i in chunk]
            self.running[self.client.submit(self.work, self.study, numbered, pure=False)] = chunk

    def take_rows(self, future: Any) -> list[Row]:
        """The rows of a chunk that ended, and the size of the next ones; none where its worker died with several."""
        chunk = self.running.pop(future)
        rows = list[Row]()
        if future.status == "finished":
            rows = future.result()
            seconds = 1.0  # of work in a chunk; its transfer and file cost about 10 ms
            self.size = min(_chunk_size(seconds, rows), 4 * max(self.size, len(rows)))
        elif len(chunk) == 1:
            rows = [job.row_of_lost_scene(self.study, chunk[0], type(future.exception()).__name__)]
        else:
            self.suspects.extend(chunk)
        future.release()
        return rows


def _chunk_size(seconds: float, timed_rows: list[Row]) -> int:
    """How many scenes take `seconds`, from 1 to LARGEST, judged by rows with their time."""
    took = sum(row.get("seconds") or 0.0 for row in timed_rows)
    return int(np.clip(seconds * len(timed_rows) / max(took, 1e-9), 1, LARGEST))


def write_parquet_rows(out: Path, study: Study, rows: list[Row]) -> None:
    """Write rows as one Parquet file, complete or not at all."""
    import pyarrow
    from pyarrow import parquet

    texts = [name for name, axis in study.axes.items() if not axis.numeric]
    rows = [row | {name: _text_of_value(row[name]) for name in texts} for row in rows]
    table = pyarrow.Table.from_pylist(rows, _parquet_schema(study))
    with atomic_write(out / "rows" / f"{rows[0]['index']:08d}-{len(rows)}.parquet") as temporary:
        parquet.write_table(table, temporary)


def _parquet_schema(study: Study) -> "Schema":
    """The pyarrow.Schema of rows: index, values of the axes, results."""
    import pyarrow as pa

    inputs = {name: pa.float64() if axis.numeric else pa.string() for name, axis in study.axes.items()}
    return pa.schema({"index": pa.int64()} | inputs | _result_types() | inputs)


def _result_types() -> dict[str, Any]:
    """The pyarrow type of each result by its name."""
    import pyarrow as pa

    words = dict.fromkeys(job.COLUMNS["words"], pa.string())
    counts = dict.fromkeys(job.COLUMNS["counts"], pa.int64())
    design = [name for quantity in job.DESIGN for name in (quantity, f"{quantity}_bar")]
    return words | counts | dict.fromkeys([*job.GROUPS, *design, *job.COLUMNS["numbers"]], pa.float64())


def _text_of_value(value: Any) -> str:
    """A word as it is; numbers, lists and tables beside words as JSON."""
    return value if isinstance(value, str) else json.dumps(value)


def read_rows(out: Path, *columns: str) -> "DataFrame":
    """All rows as a pandas.DataFrame, by index; with these columns, if some are named, which all versions have stored.

    Else results that another version did not store are empty.  Raises Refused for a file that cannot be read, as
    after a loss of power.
    """
    import pyarrow
    from pyarrow import parquet

    tables = []
    for file in sorted((out / "rows").glob("*.parquet")):
        try:
            names = ["index", *columns] if columns else None
            tables.append(parquet.read_table(file, columns=names, partitioning=None))  # a folder may be named mass=80
        except pyarrow.ArrowInvalid:
            what_to_do = "delete it, and the same command computes its scenes again"
            raise Refused(f"{file}: damaged, or no Parquet file; {what_to_do}") from None
    rows = pyarrow.concat_tables(tables, promote_options="default").to_pandas()
    missing = [] if columns else [name for name in _result_types() if name not in rows]
    return rows.reindex(columns=[*rows, *missing]).set_index("index").sort_index()


def finished_indices(out: Path) -> set[int]:
    """Indices of the scenes that have a row."""
    return set(read_rows(out, "status").index) if any((out / "rows").glob("*.parquet")) else set()


def _store_or_refuse_study(study: Study, out: Path) -> None:
    """Store the study beside its rows; raise Refused where another one is stored."""
    file = out / "study.toml"
    if file.is_file():
        stored = _entries_that_change_rows(Study.load(file))
        differ = [name for name, value in _entries_that_change_rows(study).items() if value != stored[name]]
        if differ:
            of = f"{out} holds rows of another study (other: {', '.join(differ)})"
            raise Refused(f"{of}; nothing was written; choose another folder with --out")
    (out / "rows").mkdir(exist_ok=True)
    write_text(file, study.to_toml())


def _entries_that_change_rows(study: Study) -> dict[str, Any]:
    """The entries of a study that change its rows."""
    return study.model_dump(exclude={"title", "seconds"}, serialize_as_any=True)


@contextmanager
def _dask_client(
    workers: int | None, scheduler: str | None, scenes: int, raise_if_interrupted: Callable[[], None]
) -> Iterator[Any]:
    """Yield a client of a running scheduler, or of processes on this machine."""
    try:
        import dask
        import pyarrow  # noqa: F401
        from distributed import Client, LocalCluster
    except ImportError:
        raise Refused("sweep needs Dask and pyarrow: pip install 'cablefem[sweep]'") from None
    if scheduler is not None:
        try:
            with Client(scheduler, timeout="5s") as client:
                _wait_for_worker(client, raise_if_interrupted)
                yield client
        except (OSError, ValueError, TimeoutError) as error:
            raise Refused(f"--scheduler {scheduler}: {error or 'no answer'}") from None
        return
    config = {"distributed.scheduler.allowed-failures": 1, "distributed.comm.timeouts.connect": "60s"}
    with dask.config.set(config):
        cluster = LocalCluster(
            n_workers=min(workers or os.cpu_count() or 1, scenes), threads_per_worker=1, memory_limit=0,
            dashboard_address=":0", silence_logs=logging.CRITICAL,
        )  # fmt: skip
        with cluster, Client(cluster) as client:
            try:
                yield client
            except BaseException:
                cluster.sync(_stop_workers, cluster.workers.values())
                raise


def _wait_for_worker(client: Any, raise_if_interrupted: Callable[[], None]) -> None:
    """Wait a minute for a worker of a running scheduler; TimeoutError without one."""
    deadline = time.monotonic() + 60.0
    while not client.nthreads():
        raise_if_interrupted()
        if time.monotonic() > deadline:
            raise TimeoutError("it has no worker")
        time.sleep(0.1)


@contextmanager
def _hold_back_interrupt() -> Iterator[Callable[[], None]]:
    """Hold back Ctrl-C until what is yielded is called, or to the end.

    Raised anywhere it makes half a module an ImportError and half a cluster that does not close, and the garbage
    collection of Dask loses it.  Threads and processes that begin meanwhile never get the signal: this one ends them.
    """
    if threading.current_thread() is not threading.main_thread():
        yield lambda: None  # others get no signal
        return
    resource_tracker.ensure_running()  # its start would let the signal through again
    held: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: held.append(number))
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])

    def raise_if_interrupted() -> None:
        if signal.SIGINT in signal.sigpending():
            held.append(signal.sigwait([signal.SIGINT]))
        if held:
            held.clear()
            raise KeyboardInterrupt

    try:
        yield raise_if_interrupted
        raise_if_interrupted()
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])  # another one is noted, too late to matter
        signal.signal(signal.SIGINT, before)


async def _stop_workers(workers: Iterable[Any]) -> None:
    """End workers without waiting for their scenes."""
    await asyncio.gather(*(worker.close(timeout=0.5) for worker in workers), return_exceptions=True)
