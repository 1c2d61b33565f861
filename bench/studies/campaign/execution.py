"""Campaigns: many seeded runs on a Dask cluster, in parts that a kill does not cost again.

DIR/campaign.json      what is run; another campaign does not go into the same directory
DIR/parts/*.parquet    finished parts, each written whole or not at all
DIR/results.parquet    all of them, by run; DIR/table.md; DIR/campaign.html; DIR/worst/*.toml
"""

from __future__ import annotations

import multiprocessing
import signal
import time
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from multiprocessing import resource_tracker
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from bench.progress import Advance, progress
from bench.run import directory as outdir
from bench.studies.campaign.config import Campaign, draw, scenario_of
from bench.studies.campaign.run import Row, run_many
from bench.studies.campaign.stopping import Watch
from hil.config.check import check_json
from hil.errors import ConfigError, MissingExtraError, RunError
from hil.files import Output, read_regular

if TYPE_CHECKING:
    from rich.console import Console

PART, MOST_PARTS = 20, 1000
"""Runs of a part at least: at most one part a worker is lost when a campaign is killed."""

_LOOKS, _LOOK_S = 8, 0.05
"""After an interrupt, for workers that are coming up."""

RESULTS = ("results.parquet", "table.md", "campaign.html")
"""What is written anew each time that a campaign goes on in its directory, and in no other."""


class Shard(NamedTuple):
    """Which part of a campaign this machine runs: the first of so many is 1/so many."""

    number: int
    of: int


WHOLE = Shard(1, 1)

AHEAD = 3
"""Parts a worker has waiting, so that it never waits for the driver."""


def run(
    campaign: Campaign, directory: Path, scheduler: str | None, workers: int, console: Console,
    shard: Shard = WHOLE,
) -> Path | None:  # fmt: skip
    """Run what is not there yet, then put the parts together; returns the results file.

    A shard runs every so manieth part only; None as long as parts of others are not there.
    Raises: ConfigError when the directory holds another campaign; RunError when a worker failed
    """
    scenario_of(campaign, draw(campaign, 0))  # a key that is wrong is told before anything is made
    _claim(campaign, directory)
    parts = directory / "parts"
    parts.mkdir(exist_ok=True)
    for leftover in parts.glob(".part-*") if shard == WHOLE else ():  # others may be writing
        leftover.unlink()
    done = _finished(parts, range(part_count(campaign)))
    watch = _watch_of(campaign, done)
    todo = [n for n in range(part_count(campaign))
            if n % shard.of == shard.number - 1 and n not in done]  # fmt: skip
    if todo and watch.end is None:
        with _cluster(scheduler, workers) as client, _progress(campaign, todo) as advance:
            for number, rows in _computed(client, campaign, todo, watch):
                done[number] = _write_part(parts, number, rows)
                advance(len(rows))
                watch.take(number, rows)
    end = part_count(campaign) if watch.end is None else watch.end
    if campaign.stop is not None:
        console.print(f"{campaign.stop.figure}: {watch.told()}", soft_wrap=True, markup=False)
    done |= _finished(parts, [n for n in range(end) if n not in done])
    missing = sum(1 for n in range(end) if n not in done)
    if missing:
        console.print(f"shard {shard.number}/{shard.of} done; {missing} parts of others missing")
        return None
    return _merge(directory, [done[n] for n in range(end)], campaign)


def _watch_of(campaign: Campaign, done: dict[int, Path]) -> Watch:
    """The stopping rule with what is there already."""
    watch = Watch(campaign.stop, campaign.controllers)
    if campaign.stop is not None:
        columns = ["set_controller", campaign.stop.figure]
        for number, file in sorted(done.items()):
            watch.take(number, rows_of(file, columns))
    return watch


def part_size(campaign: Campaign) -> int:
    """Runs of a part: few, so that little is lost, but no more than a thousand parts or so."""
    return max(PART, -(-campaign.runs // MOST_PARTS))


def part_count(campaign: Campaign) -> int:
    """Number of parts of a campaign."""
    return -(-campaign.runs // part_size(campaign))


def indices_of(campaign: Campaign, number: int) -> list[int]:
    """The runs of a part."""
    size = part_size(campaign)
    return list(range(number * size, min((number + 1) * size, campaign.runs)))


def _claim(campaign: Campaign, directory: Path) -> None:
    """Make the directory this campaign's, or see that it is."""
    outdir.make_directory("--out", directory)
    file = Output("--out", directory / "campaign.json")
    text = campaign.model_dump_json(indent=1)
    if not file.path.exists():
        outdir.claim("--out", directory, RESULTS, force=False)
        file.write(text)
    elif check_json(Campaign, read_regular(file.path), str(file.path)) != campaign:
        raise ConfigError(f"{directory}: holds another campaign; choose another --out")


def _finished(parts: Path, numbers: Iterable[int]) -> dict[int, Path]:
    """Return the parts that are done; one that does not have the CRC in its name is none."""
    found = {}
    for number in numbers:
        for file in _files_of(parts, number):
            with suppress(OSError):
                if file.stem.endswith(f"-{zlib.crc32(file.read_bytes()):08x}"):
                    found[number] = file
    return found


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
    watch: Watch,
) -> Iterator[tuple[int, list[Row]]]:
    """Parts as they are finished, until enough is known; a few are always waiting, never all."""
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
        if watch.end is not None:
            return
        following = next(waiting, None)
        if following is not None:
            pending.add(submit(following))


def _progress(campaign: Campaign, todo: list[int]) -> AbstractContextManager[Advance]:
    """Progress over runs, those of an earlier attempt done already."""
    left = sum(len(indices_of(campaign, number)) for number in todo)
    return progress(campaign.name, campaign.runs, "runs", campaign.runs - left)


def _write_part(parts: Path, number: int, rows: list[Row]) -> Path:
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
    return parts / name


def _merge(directory: Path, files: Sequence[Path], campaign: Campaign) -> Path:
    """The parts in one file, ordered by run."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    tables = [pq.read_table(file) for file in files]
    merged = pa.concat_tables(tables, promote_options="permissive").sort_by("run")
    if merged.num_rows != min(len(files) * part_size(campaign), campaign.runs):
        raise ConfigError(f"{directory}: its parts are of another size; choose another --out")
    file = Output("--out", directory / "results.parquet", force=True)
    with file.writing() as beside:
        pq.write_table(merged, beside)
    return file.path


def rows_of(file: Path, columns: Sequence[str] | None = None) -> list[Row]:
    """The results as rows, with all columns or some."""
    import pyarrow.parquet as pq

    rows: list[Row] = pq.read_table(file, columns=columns and list(columns)).to_pylist()
    return rows
