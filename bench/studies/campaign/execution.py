"""Campaigns: many seeded runs on a Dask cluster, in parts that a kill does not cost again.

DIR/campaign.json      what is run; another campaign does not go into the same directory
DIR/parts/*.parquet    finished parts, each written whole or not at all
DIR/results.parquet    all of them, by run; DIR/table.md; DIR/distributions.svg; DIR/worst/*.toml
"""

from __future__ import annotations

import json
import multiprocessing
import signal
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.run import directory as outdir
from bench.studies.campaign.config import Campaign, draw, scenario_of
from bench.studies.campaign.run import Row, run_many
from hil.errors import ConfigError, MissingExtraError, RunError
from hil.files import Output, read_regular

if TYPE_CHECKING:
    from rich.console import Console

PART = 20
"""Runs of a part: at most one part a worker is lost when a campaign is killed."""

_LOOKS, _LOOK_S = 8, 0.05
"""After an interrupt, for workers that are coming up."""

RESULTS = ("results.parquet", "table.md", "distributions.svg")
"""What is written anew each time that a campaign goes on in its directory, and in no other."""

AHEAD = 3
"""Parts a worker has waiting, so that it never waits for the driver."""


def run(
    campaign: Campaign, directory: Path, scheduler: str | None, workers: int, console: Console
) -> Path:
    """Run what is not there yet, then put the parts together; returns the results file.

    Raises: ConfigError when the directory holds another campaign; RunError when a worker failed
    """
    scenario_of(campaign, draw(campaign, 0))  # a key that is wrong is told before anything is made
    _claim(campaign, directory)
    parts = directory / "parts"
    parts.mkdir(exist_ok=True)
    for leftover in parts.glob(".part-*"):
        leftover.unlink()
    todo = [n for n in range(part_count(campaign)) if _part_file(parts, n) is None]
    if todo:
        with _cluster(scheduler, workers) as client, _bar(console, campaign, todo) as advance:
            for number, rows in _computed(client, campaign, todo):
                _write_part(parts, number, rows)
                advance(len(rows))
    return _merge(directory, parts, campaign)


def part_count(campaign: Campaign) -> int:
    """Number of parts of a campaign."""
    return -(-campaign.runs // PART)


def indices_of(campaign: Campaign, number: int) -> list[int]:
    """The runs of a part."""
    return list(range(number * PART, min((number + 1) * PART, campaign.runs)))


def _claim(campaign: Campaign, directory: Path) -> None:
    """Make the directory this campaign's, or see that it is."""
    outdir.make_directory("--out", directory)
    file = Output("--out", directory / "campaign.json")
    text = campaign.model_dump_json(indent=1)
    if not file.path.exists():
        outdir.claim("--out", directory, RESULTS, force=False)
        file.write(text)
    elif _known(file.path) != json.loads(text):
        raise ConfigError(f"{directory}: holds another campaign; choose another --out")


def _known(file: Path) -> object:
    """What a directory says it is of; nothing, when that cannot be read."""
    try:
        return json.loads(read_regular(file))
    except ValueError:
        return None


def _part_file(parts: Path, number: int) -> Path | None:
    """Return the file of a finished part; one that does not have the CRC in its name is none."""
    for file in _files_of(parts, number):
        with suppress(OSError):
            if file.stem.endswith(f"-{zlib.crc32(file.read_bytes()):08x}"):
                return file
    return None


def _files_of(parts: Path, number: int) -> list[Path]:
    return sorted(parts.glob(f"part-{number:05d}-*.parquet"))


@contextmanager
def _cluster(scheduler: str | None, workers: int) -> Iterator[Any]:
    """A client of the cluster at an address, or of one made here on loopback, its dashboard too."""
    try:
        import distributed
    except ImportError:
        raise MissingExtraError("dask.distributed", "campaign", "a campaign") from None
    library: Any = distributed  # its classes carry no types
    if scheduler is None:
        with _local_cluster(library, workers) as client:
            yield client
        return
    try:
        with library.Client(scheduler, timeout="10s") as client:
            yield client
    except ValueError as error:
        raise ConfigError(f"--scheduler {scheduler}: {error} (accepted: tcp://HOST:PORT)") from None
    except OSError as error:
        raise RunError(f"--scheduler {scheduler}: {error}") from None


@contextmanager
def _local_cluster(library: Any, workers: int) -> Iterator[Any]:  # noqa: ANN401
    """A client of workers on this machine; Ctrl-C is for this process and ends them at once."""
    import dask

    dask.config.set({"distributed.worker.daemon": True})
    # What is blocked while the cluster's thread begins stays so in all that it starts, unless the
    # library's own tracker, begun there, lets it through again.
    resource_tracker.ensure_running()
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        cluster = library.LocalCluster(
            n_workers=0, threads_per_worker=1, host="127.0.0.1",
            dashboard_address="127.0.0.1:0", silence_logs=50,
        )  # fmt: skip
        client = library.Client(cluster)
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    try:
        cluster.scale(workers)
        client.wait_for_workers(workers)
        yield client
    except KeyboardInterrupt:
        _abandon(client, cluster)
        raise
    client.close()
    cluster.close()


def _abandon(client: Any, cluster: Any) -> None:  # noqa: ANN401
    """End the workers of a campaign that goes on another time: an orderly end takes seconds."""
    client.status, cluster.shutdown_on_close = "closed", False
    cluster.loop.add_callback(cluster.loop.stop)  # it would start others in their place
    for _ in range(_LOOKS):  # one that is just being started is not listed yet
        for process in multiprocessing.active_children():
            process.kill()
        time.sleep(_LOOK_S)


def _computed(
    client: Any,  # noqa: ANN401
    campaign: Campaign,
    todo: list[int],
) -> Iterator[tuple[int, list[Row]]]:
    """Parts as they are finished; a few are always waiting, never all."""
    import distributed

    library: Any = distributed
    waiting = iter(todo)
    room = max(AHEAD * len(client.scheduler_info()["workers"]), AHEAD)

    def submit(number: int) -> Any:  # noqa: ANN401
        future = client.submit(run_many, campaign, indices_of(campaign, number), pure=False)
        numbers[future.key] = number
        return future

    numbers: dict[str, int] = {}
    pending = library.as_completed([submit(n) for _, n in zip(range(room), waiting, strict=False)])
    for future in pending:
        if future.status != "finished":
            raise RunError(f"part {numbers[future.key]} of the campaign: {future.exception()}")
        yield numbers[future.key], future.result()
        following = next(waiting, None)
        if following is not None:
            pending.add(submit(following))


@contextmanager
def _bar(console: Console, campaign: Campaign, todo: list[int]) -> Iterator[Any]:
    """A progress bar over runs, those of an earlier attempt done already."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    left = sum(len(indices_of(campaign, number)) for number in todo)
    columns = (TextColumn(campaign.name), BarColumn(), MofNCompleteColumn(), TextColumn("runs"),
               TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn())  # fmt: skip
    with Progress(*columns, console=console) as progress:
        task = progress.add_task("", total=campaign.runs, completed=campaign.runs - left)
        yield lambda count: progress.advance(task, count)


def _write_part(parts: Path, number: int, rows: list[Row]) -> None:
    """Write a part whole, its CRC-32 in its name, in the place of a damaged one."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    for damaged in _files_of(parts, number):
        damaged.unlink()
    stream = pa.BufferOutputStream()
    pq.write_table(pa.Table.from_pylist(rows), stream)
    data = stream.getvalue().to_pybytes()
    name = f"part-{number:05d}-{zlib.crc32(data):08x}.parquet"
    Output("--out", parts / name, force=True).write(data)


def _merge(directory: Path, parts: Path, campaign: Campaign) -> Path:
    """All parts in one file, ordered by run."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    files = [_part_file(parts, n) for n in range(part_count(campaign))]
    tables = [pq.read_table(file) for file in files if file is not None]
    merged = pa.concat_tables(tables, promote_options="permissive").sort_by("run")
    file = Output("--out", directory / "results.parquet", force=True)
    with file.writing() as beside:
        pq.write_table(merged, beside)
    return file.path


def rows_of(file: Path) -> list[Row]:
    """The results as rows."""
    import pyarrow.parquet as pq

    rows: list[Row] = pq.read_table(file).to_pylist()
    return rows
