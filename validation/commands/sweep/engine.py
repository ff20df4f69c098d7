"""The loop of a sweep on Dask: chunks of about a second go out, rows come home and are written, whole or not at all."""

import fcntl
import time
import tomllib
from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cablefem.response import whole, write_json, write_text
from validation.commands.sweep import job
from validation.commands.sweep.study import Study
from validation.core.store import Refused

CHUNK = 1.0  # [s] of work in a chunk: the way to a worker and back, and a file, cost about 10 ms
LARGEST = 2000  # scenes in a chunk, however fast they are
AHEAD = 2  # chunks waiting beside each one that is worked on

Work = Callable[[Study, list[tuple[int, dict[str, Any]]]], list[dict[str, Any]]]


@dataclass(slots=True)
class Tally:
    """How far a sweep is."""

    total: int
    before: int  # rows that an earlier call had written
    begin: float = field(default_factory=time.perf_counter)
    status: Counter[str] = field(default_factory=Counter)
    busy: float = 0.0  # [s] of work in the rows, all workers together
    dashboard: str | None = None

    @property
    def done(self) -> int:
        return self.before + self.status.total()

    @property
    def failed(self) -> int:
        return sum(self.status[x] for x in job.BROKEN)

    @property
    def rate(self) -> float:
        """Scenes per second of this call."""
        return self.status.total() / max(1e-9, time.perf_counter() - self.begin)

    def __str__(self) -> str:
        where = f", {self.dashboard}" if self.dashboard else ""
        left = self.total - self.done
        return f"{self.done} done, {self.failed} failed, {left} left, {self.rate:.3g} scenes/s{where}"


def sweep(
    study: Study, out: Path, *, workers: int | None = None, scheduler: str | None = None,
    progress: Callable[[Tally], None] | None = None, work: Work = job.rows,
) -> Tally:  # fmt: skip
    """Compute every point of a study that has no row in out/rows yet; killed at any moment, the same call goes on.

    workers : processes on this machine, one per core by default; scheduler : address of one that runs.
    Raises Refused for a folder that holds rows of another study, or without Dask.
    sweep("riders.toml", Path("riders"))
    """
    report = progress or (lambda tally: None)
    with _alone(out):
        _same_study(study, out)
        known = done(out)
        todo = deque(i for i in range(len(study)) if i not in known)
        tally = Tally(len(study), len(known))
        del known
        report(tally)
        if todo:
            with _client(workers, scheduler, min(len(todo), LARGEST)) as client:
                tally.dashboard = _dashboard(client)
                loop = _Loop(client, study, out, todo, tally, work)
                loop.run(report)
        seconds = time.perf_counter() - tally.begin
        write_json(out / "sweep.json", {
            "study": study.name, "scenes": len(study), "statuses": statuses(out), "seconds": seconds,
            "busy": tally.busy, "computed": tally.status.total(),
        })  # fmt: skip
    return tally


class _Loop:
    """Chunks go out to a client's workers, and their rows are written as they come home."""

    def __init__(
        self, client: Any, study: Study, out: Path, todo: deque[int], tally: Tally, work: Work
    ) -> None:  # fmt: skip
        from distributed import as_completed

        self.client, self.study, self.out, self.todo, self.tally, self.work = client, study, out, todo, tally, work
        self.capacity = max(1, sum(client.nthreads().values()))
        self.running: dict[Any, list[int]] = {}
        self.results = as_completed()
        self.size = 1  # scenes in a chunk
        # Chunks of workers that died are tried one at a time, so that a death tells whose fault it was.
        self.suspects: deque[list[int]] = deque()
        self.alone = False
        self.deaths: Counter[int] = Counter()

    def run(self, report: Callable[[Tally], None]) -> None:
        self.fill()
        for future in self.results:
            indices = self.running.pop(future)
            rows = self.made(future.result()) if future.status == "finished" else self.died(indices, future)
            future.release()
            if rows:
                write(self.out, self.study, rows)
                self.tally.status.update(row["status"] for row in rows)
                report(self.tally)
            self.fill()

    def fill(self) -> None:
        self.alone = bool(self.suspects) and not self.running
        if self.alone:
            self.send(self.suspects.popleft())
        elif self.suspects:
            return
        while self.todo and not self.alone and len(self.running) < (1 + AHEAD) * self.capacity:
            share = max(1, len(self.todo) // (2 * self.capacity))  # smaller at the end: all workers end together
            self.send([self.todo.popleft() for _ in range(min(self.size, share, len(self.todo)))])

    def send(self, indices: list[int]) -> None:
        points = [(i, self.study.point(i)) for i in indices]
        future = self.client.submit(self.work, self.study, points, pure=False)
        self.running[future] = indices
        self.results.add(future)

    def made(self, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """Take rows that came home, and learn from their seconds how large chunks may be."""
        seconds = sum(row.get("seconds") or 0.0 for row in rows)
        self.tally.busy += seconds
        wanted = CHUNK * len(rows) / max(seconds, 1e-9)
        self.size = int(min(max(1.0, wanted), LARGEST, 4 * max(self.size, len(rows))))
        return rows

    def died(self, indices: list[int], future: Any) -> list[dict[str, Any]]:
        """Take apart a chunk whose worker died; a scene at which a worker dies twice alone is a row that says so."""
        if self.alone and len(indices) == 1:
            self.deaths[indices[0]] += 1
            if self.deaths[indices[0]] == 2:
                return [job.lost(self.study, indices[0], type(future.exception()).__name__)]
        self.suspects.extend([[i] for i in indices] if self.alone else [indices])
        return []


# --- results ----------------------------------------------------------------------------------------------------------


def write(out: Path, study: Study, rows: list[dict[str, Any]]) -> None:
    """Write rows as one Parquet file, whole or not at all."""
    import pyarrow
    from pyarrow import parquet

    first = rows[0]["index"]
    table = pyarrow.Table.from_pylist(rows, schema(study))
    with whole(out / "rows" / f"{first:08d}-{len(rows)}.parquet") as temporary:
        parquet.write_table(table, temporary)


def schema(study: Study) -> Any:
    """Return the columns of a study's rows, the same in every file."""
    import pyarrow as pa

    inputs = [(axis.name, pa.float64() if axis.numeric else pa.string()) for axis in study.axes]
    taken = {name for name, _ in inputs}
    columns = [("index", pa.int64()), *inputs]
    for names, kind in ((job.WORDS, pa.string()), (job.NUMBERS, pa.float64()), (job.COUNTS, pa.int64())):
        columns += [(name, kind) for name in names if name not in taken]
    return pa.schema(columns)


def files(out: Path) -> list[Path]:
    """Return the files of rows."""
    return sorted((out / "rows").glob("*.parquet"))


def done(out: Path) -> set[int]:
    """Return the indices of the scenes that have a row."""
    return {i for file in files(out) for i in column(file, "index")}


def statuses(out: Path) -> dict[str, int]:
    """Return how many rows have which status."""
    return dict(Counter(status for file in files(out) for status in column(file, "status")))


def column(file: Path, name: str) -> list[Any]:
    """Return one column of a file of rows."""
    from pyarrow import parquet

    return parquet.read_table(file, columns=[name])[name].to_pylist()


def frame(out: Path) -> Any:
    """Return all rows as a pandas.DataFrame, by index."""
    import pandas

    return pandas.concat([pandas.read_parquet(file) for file in files(out)]).set_index("index").sort_index()


# --- folder and cluster -----------------------------------------------------------------------------------------------


@contextmanager
def _alone(out: Path) -> Iterator[None]:
    """Keep a second call out of the folder while this one writes."""
    out.mkdir(parents=True, exist_ok=True)
    with (out / ".lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise Refused(f"{out}: another sweep is writing there") from None
        yield


def _same_study(study: Study, out: Path) -> None:
    """Keep the study beside its rows; raise Refused where another one is kept."""
    kept, told = out / "study.toml", study.to_toml()
    if kept.is_file() and _of_rows(kept.read_text(encoding="utf-8")) != _of_rows(told):
        raise Refused(f"{out} holds rows of another study; nothing was written; choose another folder with --out")
    (out / "rows").mkdir(exist_ok=True)
    write_text(kept, told)


def _of_rows(study: str) -> dict[str, Any]:
    """Return what the rows depend on."""
    return {k: v for k, v in tomllib.loads(study).items() if k not in ("title", "limit", "seconds")}


@contextmanager
def _client(workers: int | None, scheduler: str | None, scenes: int) -> Iterator[Any]:
    """Give a client of a running scheduler, or of worker processes on this machine, one thread each."""
    try:
        import dask
        import pyarrow  # noqa: F401
        from distributed import Client, LocalCluster
    except ImportError:
        raise Refused("sweep needs Dask and pyarrow: pip install 'cablefem[sweep]'") from None
    import logging
    import os

    if scheduler is not None:
        try:
            with Client(scheduler, timeout="5s") as client:
                client.wait_for_workers(1, timeout=60)
                yield client
        except (OSError, ValueError, TimeoutError) as error:
            raise Refused(f"--scheduler {scheduler}: {error or 'no answer'}") from None
        return
    # a chunk that kills its worker is taken apart here at once, not tried again whole
    calm = {"distributed.scheduler.allowed-failures": 0, "distributed.comm.timeouts.connect": "60s"}
    with dask.config.set(calm):
        cluster = LocalCluster(
            n_workers=min(workers or os.cpu_count() or 1, scenes), threads_per_worker=1, memory_limit=0,
            dashboard_address=":0", silence_logs=logging.CRITICAL,
        )  # fmt: skip
        with cluster, Client(cluster) as client:
            yield client


def _dashboard(client: Any) -> str | None:
    link = client.dashboard_link
    return link if link and "None" not in link else None
