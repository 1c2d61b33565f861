"""The pages: an overview with the headline, and a page a chapter."""

from __future__ import annotations

import html
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Final

from bench.report.page import small_tile
from bench.studies.atlas.criteria import DEVIATES, NOT_REPRODUCIBLE, VERDICTS, Judged
from bench.studies.atlas.entry import Entry
from bench.studies.atlas.facts import Fact, chapter_of, chapter_title
from bench.studies.atlas.titles import title_of
from bench.web.chart import Chart
from bench.web.chart_plot import plot_of
from bench.web.page import Page

_STYLE: Final = """
nav a { margin-right: 10px; }
a { color: var(--motion); }
th.number { text-align: right; }
td.number { text-align: right; }
.verdict { font-weight: 600; white-space: nowrap; }
.verdict.pass { color: var(--good); }
.verdict.deviates { color: var(--bad); }
.verdict.not-reproducible { color: var(--soft); }
section.entry { margin-top: 34px; }
section.entry h2 { margin-bottom: 2px; }
.command { margin: 0 0 10px; }
td small { color: var(--soft); display: block; }
"""
_COLUMNS: Final = ("", "what", "thesis", "ours", "unit", "deviation", "allowed", "verdict, reason")
_NUMBERS: Final = {"thesis", "ours", "deviation", "allowed"}

Rows = Sequence[tuple[Fact, Judged]]


def file_of(chapter: str) -> str:
    """Return the name of a chapter's page."""
    return f"chapter-{chapter}.html"


def chapters_of(rows: Rows) -> list[str]:
    """The chapters that have facts, in their order."""
    return list(dict.fromkeys(fact.chapter for fact, _ in rows))


def index(rows: Rows) -> str:
    """The overview: how many pass, deviate, cannot be made; by chapter; and every deviation."""
    lines = "".join(_chapter_line(c, [r for r in rows if r[0].chapter == c])
                    for c in chapters_of(rows))  # fmt: skip
    head = "".join(f'<th class="number">{html.escape(v)}</th>' for v in ("facts", *VERDICTS))
    body = [
        _tiles(rows),
        f'<section><table><thead><tr><th>chapter</th>{head}</tr></thead><tbody>{lines}</tbody>'
        "</table></section>",
        _kinds(rows),
        *(_listed(rows, verdict) for verdict in (DEVIATES, NOT_REPRODUCIBLE)),
    ]  # fmt: skip
    told = "Every number and statement that the thesis prints, made again and judged."
    return _page(Page("Atlas of the thesis"), "Atlas of the thesis", told, _nav(rows), body)


def chapter_page(
    chapter: str, rows: Rows, entries: Mapping[str, Entry], charts: Mapping[str, Sequence[Chart]]
) -> str:
    """A chapter: each figure and table with what is drawn and what is judged of it."""
    mine = [row for row in rows if row[0].chapter == chapter]
    groups: dict[str, list[tuple[Fact, Judged]]] = {}
    for row in mine:
        groups.setdefault(row[0].group, []).append(row)
    for name in entries:
        if chapter_of(name) == chapter:
            groups.setdefault(name, [])
    page = Page(chapter_title(chapter))
    sections = [_section(page, name, part, entries.get(name), charts.get(name, ()))
                for name, part in groups.items()]  # fmt: skip
    told = " · ".join(f"{n} {v}" for v, n in _counts(mine).items())
    return _page(page, chapter_title(chapter), told, _nav(rows), sections)


def _section(
    page: Page, name: str, rows: Rows, entry: Entry | None, charts: Sequence[Chart]
) -> str:
    title = entry.title if entry is not None else title_of(name)
    command = "" if entry is None else f'<p class="command"><code>{entry.told_command}</code></p>'
    drawn = "".join(page.row([plot_of(chart) for chart in charts[n : n + 2]])
                    for n in range(0, len(charts), 2))  # fmt: skip
    return (
        f'<section class="entry" id="{name}"><h2>{html.escape(f"{_label(name)} · {title}")}</h2>'
        f"{command}{drawn}{_table(rows)}</section>"
    )


def _label(name: str) -> str:
    """Fig 4.10, Table 4.3, eq. 5.36, Section 5.2."""
    inner = name.removeprefix("A1-").removeprefix("A2-")
    kinds = {"F": "Figure ", "T": "Table ", "E": "Equation ", "S": "Section "}
    if inner[:1] in kinds and inner[1:2].isdigit():
        return kinds[inner[0]] + inner[1:]
    return "Text"


def _table(rows: Rows) -> str:
    if not rows:
        return ""
    head = "".join(f"<th{_kind(c)}>{c}</th>" for c in _COLUMNS)
    body = "".join(_row(fact, judged) for fact, judged in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _kind(column: str) -> str:
    return ' class="number"' if column in _NUMBERS else ""


def cells(j: Judged) -> tuple[str, str, str, str, str]:
    """Thesis, ours, unit, deviation and tolerance of a fact, as text."""
    unit = j.unit if j.unit != "-" else ""
    return _value(j.thesis), _value(j.ours), unit, _deviation(j), _allowed(j)


def _row(fact: Fact, j: Judged) -> str:
    what = html.escape(j.quantity) + (
        f"<small>{html.escape(j.conditions)}</small>" if j.conditions else ""
    )
    thesis, ours, unit, deviation, allowed = cells(j)
    shown = [
        f"<td>{j.id.removeprefix(fact.group).lstrip('-')}</td><td>{what}</td>",
        *(f'<td class="number">{text}</td>' for text in (thesis, ours)),
        f"<td>{html.escape(unit)}</td>",
        *(f'<td class="number">{text}</td>' for text in (deviation, allowed)),
        f'<td><span class="verdict {j.verdict.replace(" ", "-")}">{j.verdict}</span>'
        f"<small>{html.escape(j.reason)}</small></td>",
    ]
    return f'<tr id="{j.id}">{"".join(shown)}</tr>'


def _value(value: float | bool | None) -> str:
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "holds" if value else "does not"
    return f"{value:.4g}" if abs(value) < 1e4 else f"{value:g}"


def _deviation(j: Judged) -> str:
    if j.deviation is None or (j.kind == "input" and j.deviation == 0.0):
        return ""
    return f"{j.deviation:+.1%}" if j.measure == "within" else f"{j.deviation:+.3g}"


def _allowed(j: Judged) -> str:
    if j.measure in {"at_most", "at_least"}:
        return j.measure.replace("_", " ")
    if j.tolerance is None or j.kind == "input":
        return ""
    return f"{j.tolerance:.3g}" if j.measure == "within_absolute" else f"{j.tolerance:.1%}"


def _counts(rows: Rows) -> Counter[str]:
    counted = Counter(judged.verdict for _, judged in rows)
    return Counter({verdict: counted[verdict] for verdict in VERDICTS})


def _tiles(rows: Rows) -> str:
    counts = _counts(rows)
    tiles = [small_tile("printed facts", str(len(rows)), "", "numbers and statements")]
    tiles += [
        small_tile(v, str(n), "", f"{100.0 * n / max(len(rows), 1):.0f} %")
        for v, n in counts.items()
    ]
    return f'<section class="tiles">{"".join(tiles)}</section>'


def _chapter_line(chapter: str, rows: Rows) -> str:
    counts = _counts(rows)
    cells = "".join(f'<td class="number">{n}</td>' for n in (len(rows), *counts.values()))
    title = f'<a href="{file_of(chapter)}">{chapter_title(chapter)}</a>'
    return f"<tr><td>{title}</td>{cells}</tr>"


def _kinds(rows: Rows) -> str:
    """The same counts by kind of fact."""
    lines = ""
    for kind, told in (("result", "results: numbers that came out of a model, a rig or a run"),
                       ("claim", "claims: statements that can be tested"),
                       ("input", "inputs: settings, of which ours are the same")):  # fmt: skip
        part = [row for row in rows if row[0].kind == kind]
        cells = "".join(
            f'<td class="number">{n}</td>' for n in (len(part), *_counts(part).values())
        )
        lines += f"<tr><td>{told}</td>{cells}</tr>"
    head = "".join(f'<th class="number">{html.escape(v)}</th>' for v in ("facts", *VERDICTS))
    return (f"<section><h2>By kind</h2><table><thead><tr><th></th>{head}</tr></thead><tbody>"
            f"{lines}</tbody></table></section>")  # fmt: skip


def _listed(rows: Rows, verdict: str) -> str:
    """Every fact of a verdict with its reason."""
    lines = "".join(
        f'<tr><td><a href="{file_of(fact.chapter)}#{judged.id}">{judged.id}</a></td>'
        f'<td>{html.escape(judged.quantity)}</td><td class="number">{_value(judged.thesis)}</td>'
        f'<td class="number">{_value(judged.ours)}</td><td>{html.escape(judged.reason)}</td></tr>'
        for fact, judged in rows if judged.verdict == verdict
    )  # fmt: skip
    head = ('<th></th><th>what</th><th class="number">thesis</th><th class="number">ours</th>'
            "<th>why</th>")  # fmt: skip
    return (f"<section><h2>{verdict.capitalize()}</h2><table><thead><tr>{head}</tr></thead><tbody>"
            f"{lines}</tbody></table></section>")  # fmt: skip


def _nav(rows: Rows) -> str:
    links = [("index.html", "Overview")]
    links += [(file_of(c), chapter_title(c)) for c in chapters_of(rows)]
    return "<nav>" + "".join(f'<a href="{f}">{t}</a>' for f, t in links) + "</nav>"


def _page(page: Page, title: str, told: str, nav: str, body: Sequence[str]) -> str:
    head = f"<header><div><h1>{html.escape(title)}</h1><p>{html.escape(told)}</p></div></header>"
    return page.html("".join([f"<style>{_STYLE}</style>", nav, head, *body]))
