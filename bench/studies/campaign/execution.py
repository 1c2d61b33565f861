"""Campaigns: many seeded runs on a Dask cluster, in parts that a kill does not cost again.

DIR/campaign.json      what is run; another campaign does not go into the same directory
DIR/parts/*.parquet    finished parts, each written whole or not at all
DIR/results.parquet    all of them, by run; DIR/table.md; DIR/distributions.svg; DIR/worst/*.toml
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.studies.campaign.config import Campaign, draw, scenario_of
from bench.studies.campaign.run import Row, run_many
from hil.errors import ConfigError, MissingExtraError, RunError

if TYPE_CHECKING:
    from rich.console import Console

PART = 20
"""Runs of a part: at most one part a worker is lost when a campaign is killed."""

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
    for leftover in parts.glob("*.tmp"):
        leftover.unlink()
    todo = [n for n in range(part_count(campaign)) if not _part_file(parts, n).exists()]
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
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"--out {directory}: {error.strerror}") from None
    file = directory / "campaign.json"
    text = campaign.model_dump_json(indent=1)
    if not file.exists():
        file.write_text(text, encoding="utf-8")
    elif json.loads(file.read_text(encoding="utf-8")) != json.loads(text):
        raise ConfigError(f"{directory}: holds another campaign; choose another --out")


def _part_file(parts: Path, number: int) -> Path:
    return parts / f"part-{number:05d}.parquet"


@contextmanager
def _cluster(scheduler: str | None, workers: int) -> Iterator[Any]:
    """A client of the cluster at an address, or of one made here on loopback, its dashboard too."""
    try:
        import dask
        import distributed
    except ImportError:
        raise MissingExtraError("dask.distributed", "campaign", "a campaign") from None
    library: Any = distributed  # its classes carry no types
    if scheduler is not None:
        try:
            with library.Client(scheduler, timeout="10s") as client:
                yield client
        except ValueError as error:
            raise ConfigError(
                f"--scheduler {scheduler}: {error} (accepted: tcp://HOST:PORT)"
            ) from None
        except OSError as error:
            raise RunError(f"--scheduler {scheduler}: {error}") from None
        return
    dask.config.set({"distributed.worker.daemon": True})
    with (
        library.LocalCluster(
            n_workers=workers, threads_per_worker=1, host="127.0.0.1",
            dashboard_address="127.0.0.1:0", silence_logs=50,
        ) as cluster,
        library.Client(cluster) as client,
    ):  # fmt: skip
        yield client


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
    """Write a part whole: under another name first."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    file = _part_file(parts, number)
    unfinished = file.with_suffix(".tmp")
    pq.write_table(pa.Table.from_pylist(rows), unfinished)
    unfinished.rename(file)


def _merge(directory: Path, parts: Path, campaign: Campaign) -> Path:
    """All parts in one file, ordered by run."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    tables = [pq.read_table(_part_file(parts, n)) for n in range(part_count(campaign))]
    merged = pa.concat_tables(tables, promote_options="permissive").sort_by("run")
    file = directory / "results.parquet"
    unfinished = directory / "results.tmp"
    pq.write_table(merged, unfinished)
    unfinished.rename(file)
    return file


def rows_of(file: Path) -> list[Row]:
    """The results as rows."""
    import pyarrow.parquet as pq

    rows: list[Row] = pq.read_table(file).to_pylist()
    return rows
