"""What is left of a suite: JUnit file, JSON, page, and a table side by side on the terminal."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench.suite.page import Row, page
from bench.suite.result import Result, requirements

_SHORT = 46


def rows_of(results: Sequence[Result]) -> tuple[list[Row], list[str]]:
    """Return a row a scenario with its results by link, and the links in their order."""
    links = list(dict.fromkeys(result.link for result in results))
    labels = list(dict.fromkeys(result.label for result in results))
    by_label: dict[str, dict[str, Any]] = {label: {} for label in labels}
    for result in results:
        by_label[result.label][result.link] = result._asdict()
    return [Row(label, cells) for label, cells in by_label.items()], links


def html_page(results: Sequence[Result], at: Path, title: str = "Scenarios") -> str:
    """Return suite.html, to be written at a place."""
    rows, links = rows_of(results)
    return page(title, rows, links, requirements(results), at)


def document(results: Sequence[Result]) -> dict[str, Any]:
    """Return a suite for programs: all results, and every requirement."""
    runs = [{**r._asdict(), "requirements": r.requirements} for r in results]
    return {"schema": 1, "results": runs, "requirements": requirements(results)}


def json_text(results: Sequence[Result]) -> str:
    """Return the same as JSON."""
    return json.dumps(document(results), indent=1) + "\n"


def side_by_side(results: Sequence[Result]) -> list[str]:
    """Return a line a scenario: its verdict over each link, beside each other."""
    rows, links = rows_of(results)
    width = min(max((len(row.label) for row in rows), default=0), _SHORT)
    columns = [max(len(link), len("not met")) for link in links]
    heads = [f"{link:<{size}}" for link, size in zip(links, columns, strict=True)]
    lines = [f"{'':<{width}}  {'  '.join(heads)}".rstrip()]
    for row in rows:
        verdicts = [str(row.cells.get(link, {}).get("verdict", "-")) for link in links]
        told = "  ".join(f"{v:<{size}}" for v, size in zip(verdicts, columns, strict=True))
        lines.append(f"{_shortened(row.label):<{width}}  {told}".rstrip())
    return lines


def _shortened(label: str) -> str:
    return label if len(label) <= _SHORT else f"...{label[3 - _SHORT :]}"
