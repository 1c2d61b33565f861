"""Tables of the generated pages."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def table(titles: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown, ending with a line feed; columns in which nothing is are left."""
    kept = [row for row in rows if any(row)]
    filled = [i for i, _ in enumerate(titles) if any(row[i] for row in kept)]
    head = [[titles[i] for i in filled], ["---"] * len(filled)]
    lines = [*head, *([_cell(row[i]) for i in filled] for row in kept)]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def number(value: float) -> str:
    """Return a number as one writes it: 86400, 0.0015, 1e-07."""
    return str(int(value)) if float(value).is_integer() else f"{value:g}"


def _cell(text: str) -> str:
    return " ".join(text.replace("|", "\\|").split())
