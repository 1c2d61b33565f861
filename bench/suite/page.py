"""suite.html: every run of a suite with its verdict, its figures, and the way to its report."""

from __future__ import annotations

import html
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from bench.report.page import table
from bench.web.page import own

_STYLE = """
td.met { color: var(--good); font-weight: 600; } td.bad { color: var(--bad); font-weight: 600; }
td.none { color: var(--soft); } table { margin-bottom: 8px; }
td small { color: var(--soft); display: block; font-weight: 400; }
td a { color: inherit; }
"""


class Row(NamedTuple):
    """One scenario: its verdict over each link that it was run over, with the way to its report."""

    label: str
    cells: Mapping[str, Mapping[str, Any]]


def page(
    title: str,
    rows: Sequence[Row],
    links: Sequence[str],
    requirements: Mapping[str, bool],
    at: Path,
) -> str:
    """Return the page.

    Parameters: rows : a cell has verdict, reason, wall_s, directory, report and figures
        at : where the page will be, since its links are relative to it
    """
    cells = [cell for row in rows for cell in row.cells.values()]
    met = sum(cell["verdict"] in ("met", "none") for cell in cells)
    badge = "met" if met == len(cells) else "bad"
    demanded = [(name, "met" if value else "not met") for name, value in requirements.items()]
    parts = [
        "<!doctype html><html lang=en><head><meta charset=utf-8>",
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{html.escape(title)}</title><style>{own('style.css')}{_STYLE}</style></head><body><main>",
        f"<header><div><h1>{html.escape(title)}</h1><p>{len(rows)} scenarios over ",
        f"{html.escape(', '.join(links))}</p></div>",
        f'<div class="badge {badge}">{met} of {len(cells)} met</div></header>',
        _verdicts(rows, links, at),
        table("Requirements", ("requirement", "verdict"), demanded) if demanded else "",
        "</main></body></html>\n",
    ]
    return "".join(parts)


def _verdicts(rows: Sequence[Row], links: Sequence[str], at: Path) -> str:
    head = "".join(f"<th>{html.escape(link)}</th>" for link in links)
    body = "".join(
        f"<tr><td>{html.escape(row.label)}</td>"
        + "".join(_cell(row.cells.get(link), at) for link in links)
        + "</tr>"
        for row in rows
    )
    return (
        f"<section><h2>Verdicts</h2><table><thead><tr><th>scenario</th>{head}</tr></thead>"
        f"<tbody>{body}</tbody></table></section>"
    )


def _cell(cell: Mapping[str, Any] | None, at: Path) -> str:
    if cell is None:
        return "<td></td>"
    verdict = str(cell["verdict"])
    kind = verdict if verdict in ("met", "none") else "bad"
    told = html.escape(verdict)
    if cell["directory"]:
        file = "report.html" if cell["report"] else "summary.json"
        target = os.path.relpath(Path(cell["directory"]) / file, at.parent)
        told = f'<a href="{html.escape(target)}">{told}</a>'
    why = "" if kind != "bad" else f"<small>{html.escape(str(cell['reason']))}</small>"
    settling = cell["figures"].get("settling_s")
    figure = "" if settling is None else f"<small>settling {settling * 1e3:.1f} ms</small>"
    return f'<td class="{kind}">{told}{why}{figure}</td>'
