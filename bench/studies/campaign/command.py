"""`hil campaign`: run or go on with a campaign, tell what it came to."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from rich.console import Console

from bench.studies.campaign import config, table
from bench.studies.campaign import execution as campaigns
from hil.errors import MissingExtraError
from hil.files import Output


def run(name: str, out: Path | None, scheduler: str | None, workers: int, runs: int | None) -> int:
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
    file = campaigns.run(campaign, directory, scheduler, workers, console)
    rows = campaigns.rows_of(file)
    text = table.table(campaign, rows)
    Output("--out", directory / "table.md", force=True).write(text)
    table.write_worst(campaign, rows, directory / "worst")
    if find_spec("matplotlib") is not None:
        picture = table.draw_distributions(campaign, rows)
        Output("--out", directory / "distributions.svg", force=True).write(picture)
    console.print(text, soft_wrap=True, markup=False)
    console.print(f"{file}, table.md, distributions.svg and worst/ beside it")
    return 0
