"""What a campaign came to: a table of distributions, and the worst runs by name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap
from typing import Any

from bench.report.text_table import text_table
from bench.studies.campaign.config import Campaign, draw, tree_of
from bench.studies.campaign.run import NOT_BEGUN, Row
from hil.files import Output

WORST = 3
"""Runs named for each law, by peak and by settling."""

FIGURES = (
    ("peak_mm", "peak", "{:.2f}"),
    ("settling_band_ms", "settling, band", "{:.0f}"),
    ("settling_mean_ms", "settling, mean", "{:.0f}"),
    ("sigma_mm", "sigma", "{:.3f}"),
    ("fuel_sigma_mg", "fuel sigma", "{:.3f}"),
)
HEAD = (
    "law", "runs", "not begun", "lost", "with contact", "misfires (forced)", "unsettled",
    *(f"{title} [{key.rsplit('_', 1)[1]}]" for key, title, _ in FIGURES),
)  # fmt: skip
_COUNTS = len(HEAD) - len(FIGURES)
QUANTILES = (50, 95, 100)

COLUMNS = (
    "run", "set_controller", "lost", "mode", "note", "contacts", "misfires", "forced_misfires",
    *(key for key, _, _ in FIGURES),
)  # fmt: skip
"""All that table and pictures are made of."""

LEGEND = (
    "Distributions: median / 95 % / worst of the runs that were not lost. Settling: `band` to"
    " max(0.1 mm, 3 sigma), `mean` of ten strokes to 0.1 mm; `unsettled`: runs not lost whose mean"
    " of ten never is inside."
)


def table(campaign: Campaign, rows: Sequence[Row]) -> str:
    """The table in Markdown: a line a law, distributions as median / 95 % / worst."""
    lines = [f"# {title(campaign, rows)}", "", _line(HEAD), _line(["---"] * len(HEAD))]
    lines += [_line(cells(law, of_law(rows, law))) for law in campaign.controllers]
    lines += ["", LEGEND, "", "## Worst runs", ""]
    lines += [f"- {told}: `{command}`" for told, command in worst_runs(campaign, rows)]
    return "\n".join(lines) + "\n"


def told(campaign: Campaign, rows: Sequence[Row]) -> str:
    """The same for a terminal: a block a law, since its row would be too long for one."""
    lines = [title(campaign, rows), *wrap(LEGEND, 80)]
    for law in campaign.controllers:
        found = dict(zip(HEAD, cells(law, of_law(rows, law)), strict=True))
        counts = ", ".join(f"{name} {found[name]}" for name in HEAD[1:_COUNTS])
        spreads = text_table([(f"  {name}", found[name]) for name in HEAD[_COUNTS:]])
        lines += ["", f"{law}: {counts}", spreads]
    lines += ["", "worst runs"]
    for name, command in worst_runs(campaign, rows):
        lines += [f"  {name}", f"    {command}"]
    return "\n".join(lines)


def title(campaign: Campaign, rows: Sequence[Row]) -> str:
    """Name, size and seed of a campaign."""
    return f"{campaign.name}: {len(rows)} runs of {campaign.duration_s:g} s, seed {campaign.seed}"


def of_law(rows: Sequence[Row], law: str) -> list[Row]:
    """The runs of one law."""
    return [row for row in rows if row["set_controller"] == law]


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def cells(law: str, rows: list[Row]) -> list[str]:
    """A row of the table."""
    begun = [row for row in rows if row["mode"] != NOT_BEGUN]
    kept = [row for row in begun if not row["lost"]]
    unsettled = sum(1 for row in kept if math.isinf(row["settling_mean_ms"]))
    counts = [
        law, str(len(rows)), str(len(rows) - len(begun)), str(len(begun) - len(kept)),
        str(sum(1 for row in rows if row["contacts"])),
        f"{sum(r['misfires'] for r in rows)} ({sum(r['forced_misfires'] for r in rows)})",
        str(unsettled),
    ]  # fmt: skip
    return counts + [_spread([row[key] for row in kept], style) for key, _, style in FIGURES]


def _spread(values: list[float], style: str) -> str:
    """Quantiles by rank, so that what never settled counts as the worst."""
    known = sorted(v for v in values if not math.isnan(v))
    if not known:
        return "-"
    ranks = [min(math.ceil(q / 100.0 * len(known)), len(known)) - 1 for q in QUANTILES]
    return " / ".join(_shown(known[max(rank, 0)], style) for rank in ranks)


def _shown(value: float, style: str) -> str:
    return "never" if math.isinf(value) else style.format(value)


def worst(rows: list[Row]) -> list[tuple[Row, str]]:
    """The runs that a reader should look at: lost ones first, then by peak, then by settling."""
    lost = [(row, "lost") for row in rows if row["lost"]][:WORST]
    kept = [row for row in rows if not row["lost"]]

    def rank(key: str) -> list[tuple[Row, str]]:
        known = [row for row in kept if not math.isnan(row[key])]
        known.sort(key=lambda row: (-row[key], row["run"]))
        return [(row, key) for row in known[:WORST]]

    chosen: dict[int, tuple[Row, str]] = {}
    for row, why in lost + rank("peak_mm") + rank("settling_mean_ms"):
        chosen.setdefault(row["run"], (row, why))
    return list(chosen.values())


def worst_runs(campaign: Campaign, rows: Sequence[Row]) -> list[tuple[str, str]]:
    """What each of the worst runs did, and the command that runs it again."""
    return [_named(law, row, why) for law in campaign.controllers
            for row, why in worst(of_law(rows, law))]  # fmt: skip


def _named(law: str, row: Row, why: str) -> tuple[str, str]:
    figure = "lost: " + (row["note"] or row["mode"])
    if why != "lost":
        unit = why.rsplit("_", 1)[1]
        figure = f"{why.rsplit('_', 1)[0].replace('_', ' ')} {_shown(row[why], '{:.4g}')} {unit}"
    number = row["run"]
    return f"{law}, run {number} ({figure})", f"hil run worst/{number:06d}.toml --force"


def write_worst(campaign: Campaign, rows: Sequence[Row], directory: Path) -> None:
    """Write each worst run as a scenario that `hil run` takes."""
    directory.mkdir(exist_ok=True)
    for law in campaign.controllers:
        for row, _ in worst(of_law(rows, law)):
            tree = tree_of(campaign, draw(campaign, row["run"]))
            tree["name"] = f"{campaign.name}-{row['run']:06d}"
            tree.setdefault("link", {})["kind"] = "memory"
            file = Output("--out", directory / f"{row['run']:06d}.toml", force=True)
            file.write(to_toml(tree))


def to_toml(tree: dict[str, Any]) -> str:
    """A tree of tables, numbers, strings, booleans and lists as TOML; None is left out."""
    lines: list[str] = []
    _put(lines, (), tree)
    return "\n".join(lines).lstrip("\n") + "\n"


def _put(lines: list[str], path: tuple[str, ...], tree: dict[str, Any]) -> None:
    plain = {k: v for k, v in tree.items() if not isinstance(v, dict) and v is not None}
    if path and (plain or not tree):
        lines += ["", f"[{'.'.join(path)}]"]
    lines += [f"{key} = {_literal(value)}" for key, value in plain.items()]
    for key, value in tree.items():
        if isinstance(value, dict):
            _put(lines, (*path, key), value)


def _literal(value: Any) -> str:  # noqa: ANN401
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_literal, value)) + "]"
    text = str(value).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{text}"'
