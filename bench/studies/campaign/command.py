"""`hil campaign`: run or go on with a campaign, tell what it came to."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from rich.console import Console

from bench.studies.campaign import config, page, table
from bench.studies.campaign import execution as campaigns
from hil.errors import ConfigError, MissingExtraError
from hil.files import Output

_MOST_SHARDS = 1000


def run(
    name: str, out: Path | None, scheduler: str | None, workers: int, runs: int | None,
    shard: str | None = None,
) -> int:  # fmt: skip
    """Run what is missing, then write table, worst runs and pictures; returns the exit code.

    Raises: HilError with the line that the user is told
    """
    for library in ("distributed", "pyarrow"):
        if find_spec(library) is None:
            raise MissingExtraError(library, "campaign", "a campaign")
    campaign = config.read(name)
    if runs is not None:
        campaign = campaign.model_copy(update={"runs": runs})
    directory = out or Path("runs") / f"campaign-{campaign.name}"
    console = Console(highlight=False)
    file = campaigns.run(campaign, directory, scheduler, workers, console, _shard(shard))
    if file is None:
        return 0
    rows = campaigns.rows_of(file, table.COLUMNS)
    written = Output("--out", directory / "table.md", force=True)
    written.write(table.table(campaign, rows))
    table.write_worst(campaign, rows, directory / "worst")
    if find_spec("uplot") is not None:
        page.write_page(campaign, rows, Output("--out", directory / "campaign.html", force=True))
    console.print(table.told(campaign, rows), soft_wrap=True, markup=False)
    console.print(f"{file}, table.md, campaign.html and worst/ beside it")
    return 0


def _shard(text: str | None) -> campaigns.Shard:
    """Read K/N.

    Raises: ConfigError
    """
    if text is None:
        return campaigns.WHOLE
    number, _, of = text.partition("/")
    if not (number.isdecimal() and of.isdecimal() and 1 <= int(number) <= int(of) <= _MOST_SHARDS):
        raise ConfigError(f"--shard {text}: accepted K/N, K from 1 to N, N up to {_MOST_SHARDS}")
    return campaigns.Shard(int(number), int(of))
