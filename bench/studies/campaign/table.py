"""What a campaign came to: a table of distributions, the worst runs by name, and their pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bench.studies.campaign.config import Campaign, draw, tree_of
from bench.studies.campaign.run import Row
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
QUANTILES = (50, 95, 100)

COLUMNS = (
    "run", "set_controller", "lost", "mode", "note", "contacts", "misfires", "forced_misfires",
    *(key for key, _, _ in FIGURES),
)  # fmt: skip
"""All that table and pictures are made of."""

_LEGEND = (
    "Distributions: median / 95 % / worst of the runs that were not lost. Settling: `band` to"
    " max(0.1 mm, 3 sigma), `mean` of ten strokes to 0.1 mm; `unsettled`: runs not lost whose mean"
    " of ten never is inside."
)


def table(campaign: Campaign, rows: Sequence[Row]) -> str:
    """The table in Markdown: a line a law, distributions as median / 95 % / worst."""
    head = ["law", "runs", "lost", "with contact", "misfires (forced)", "unsettled"]
    head += [f"{title} [{key.rsplit('_', 1)[1]}]" for key, title, _ in FIGURES]
    lines = [f"# {campaign.name}: {len(rows)} runs of {campaign.duration_s:g} s, seed"
             f" {campaign.seed}", "", _line(head), _line(["---"] * len(head))]  # fmt: skip
    lines += [_line(_cells(law, _of(rows, law))) for law in campaign.controllers]
    lines += ["", _LEGEND, "", "## Worst runs", ""]
    lines += [_named(law, row, why) for law in campaign.controllers
              for row, why in worst(_of(rows, law))]  # fmt: skip
    return "\n".join(lines) + "\n"


def _of(rows: Sequence[Row], law: str) -> list[Row]:
    return [row for row in rows if row["set_controller"] == law]


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _cells(law: str, rows: list[Row]) -> list[str]:
    kept = [row for row in rows if not row["lost"]]
    unsettled = sum(1 for row in kept if math.isinf(row["settling_mean_ms"]))
    cells = [
        law, str(len(rows)), str(len(rows) - len(kept)),
        str(sum(1 for row in rows if row["contacts"])),
        f"{sum(r['misfires'] for r in rows)} ({sum(r['forced_misfires'] for r in rows)})",
        str(unsettled),
    ]  # fmt: skip
    return cells + [_spread([row[key] for row in kept], style) for key, _, style in FIGURES]


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


def _named(law: str, row: Row, why: str) -> str:
    figure = "lost: " + (row["note"] or row["mode"])
    if why != "lost":
        unit = why.rsplit("_", 1)[1]
        figure = f"{why.rsplit('_', 1)[0].replace('_', ' ')} {_shown(row[why], '{:.4g}')} {unit}"
    return f"- {law}, run {row['run']} ({figure}): `hil run worst/{row['run']:06d}.toml --force`"


def write_worst(campaign: Campaign, rows: Sequence[Row], directory: Path) -> None:
    """Write each worst run as a scenario that `hil run` takes."""
    directory.mkdir(exist_ok=True)
    for law in campaign.controllers:
        for row, _ in worst(_of(rows, law)):
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


def draw_distributions(campaign: Campaign, rows: Sequence[Row]) -> str:
    """Cumulative distributions of peak, settling and scatter, a line a law; as SVG."""
    from bench.report.style import WIDE, canvas, style, svg

    titles = {
        "peak_mm": "Peak TDC error  [mm]",
        "settling_mean_ms": "Settling of the mean of ten strokes  [ms]",
        "sigma_mm": "Scatter before the disturbance  [mm]",
    }
    with style():
        figure, panels = canvas(WIDE, 8.4, rows=3)
        for axes, (key, title) in zip(panels, titles.items(), strict=True):
            for law in campaign.controllers:
                values = [r[key] for r in _of(rows, law) if not math.isnan(r[key])]
                known = np.sort([v for v in values if math.isfinite(v)])
                share = np.arange(1, len(known) + 1) / max(len(values), 1)
                axes.step(known, share, where="post", label=law)
            axes.set_xlabel(title)
            axes.set_ylabel("share of runs")
            axes.set_ylim(0.0, 1.02)
        panels[0].set_title(f"{campaign.name}: {len(rows)} runs")
        panels[0].legend(loc="lower right")
        return svg(figure, transparent=False)
