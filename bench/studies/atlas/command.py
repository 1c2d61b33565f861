"""`hil atlas`: make the entries that are asked for, judge, write pages and atlas.json."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path

from rich.console import Console

from bench.run import directory as outdir
from bench.studies.atlas import pages
from bench.studies.atlas.criteria import DEVIATES, VERDICTS, Judged, judge
from bench.studies.atlas.entries import ENTRIES
from bench.studies.atlas.entry import Entry, Finding, Found
from bench.studies.atlas.facts import Fact, chapter_of, facts
from bench.studies.atlas.inputs import finding as input_finding
from bench.studies.atlas.run import run as make
from bench.studies.atlas.run import work
from hil.errors import ConfigError
from hil.files import Output

RESULTS, TIMES = "atlas.json", "times.json"

Rows = list[tuple[Fact, Judged]]


def run(names: Sequence[str], out: Path | None, *, quick: bool = False) -> int:
    """Make the atlas, or a part of it; returns the exit code: 1 when a deviation has no reason.

    Parameters: names : chapters (4, A1), figures and tables (F4.15, T4.3); none for all
    Raises: ConfigError for a name that there is not; RunError naming an entry that failed
    """
    chosen = chosen_facts(names)
    entries = [e for e in ENTRIES.values() if not names or _wanted(e, names, chosen)]
    directory = out or outdir.fresh("atlas")
    outdir.make_directory("--out", directory)
    console = Console(highlight=False)
    times: dict[str, float] = {}

    def told(name: str, wall_s: float) -> None:
        times[name] = wall_s
        console.print(f"{name}  {wall_s:.1f} s", markup=False)

    found = make(entries, directory / "parts", quick, told)
    rows = judged(chosen, entries, found)
    write(directory, rows, {e.id: e for e in entries}, found)
    if times:
        _file(directory, TIMES).write(json.dumps(times, indent=1) + "\n")
    return _tell(console, directory, rows)


def chosen_facts(names: Sequence[str]) -> list[Fact]:
    """The facts that are asked for.

    Raises: ConfigError naming what is accepted
    """
    known = {f.chapter for f in facts()} | {f.group for f in facts()} | set(ENTRIES)
    for name in names:
        if name not in known:
            chapters = ", ".join(sorted({f.chapter for f in facts()}))
            raise ConfigError(
                f"atlas {name!r}: accepted are chapters ({chapters}) and figures or tables such "
                "as F4.15, T4.3, A1-F10"
            )
    answered = {f.id for n in names if n in ENTRIES for f in ENTRIES[n].facts}
    return [f for f in facts()
            if not names or f.chapter in names or f.group in names or f.id in answered]  # fmt: skip


def _wanted(entry: Entry, names: Sequence[str], chosen: Sequence[Fact]) -> bool:
    if entry.id in names or chapter_of(entry.id) in names:
        return True
    return any(fnmatchcase(fact.id, pattern) for fact in chosen for pattern in entry.answers)


def judged(chosen: Sequence[Fact], entries: Sequence[Entry], found: Mapping[str, Found]) -> Rows:
    """Every fact with its verdict, in the order of the thesis."""
    answers: dict[str, tuple[Finding, str]] = {}
    for entry in entries:
        for name, finding in found[entry.id].findings.items():
            answers[name] = (finding, entry.told_command)
    return [
        (f, judge(f, *answers.get(f.id, (input_finding(f), f"hil atlas {f.group}"))))
        for f in chosen
    ]


def write(
    directory: Path, rows: Rows, entries: Mapping[str, Entry], found: Mapping[str, Found]
) -> None:
    """Write atlas.json, the overview and the chapters."""
    results = [verdict._asdict() for _, verdict in rows]
    _file(directory, RESULTS).write(json.dumps(results, indent=1, ensure_ascii=False) + "\n")
    _file(directory, "index.html").write(pages.index(rows))
    charts = {name: result.charts for name, result in found.items()}
    for chapter in pages.chapters_of(rows):
        page = pages.chapter_page(chapter, rows, entries, charts)
        _file(directory, pages.file_of(chapter)).write(page)


def results(names: Sequence[str]) -> Rows:
    """The results of some chapters, figures or tables, judged, made in this process.

    Raises: ConfigError, RunError, as `run`
    """
    chosen = [f for f in chosen_facts(names) if f.kind == "result"]
    entries = [e for e in ENTRIES.values() if _wanted(e, (), chosen)]
    return judged(chosen, entries, {e.id: work(e.id, False)[0] for e in entries})


def print_table(names: Sequence[str]) -> int:
    """Print the results of some figures; returns the exit code, as `run`."""
    from rich.table import Table

    rows = results(names)
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for title in ("fact", "what", "thesis", "ours", "unit", "deviation", "allowed", ""):
        left = title in {"fact", "what", "unit"}
        table.add_column(title, justify="left" if left else "right", no_wrap=title != "what")
    for fact, j in rows:
        table.add_row(j.id, fact.quantity, *pages.cells(j), j.verdict)
    console = Console(highlight=False, markup=False)
    console.print(table)
    return _code(console, rows)


def _file(directory: Path, name: str) -> Output:
    return Output("--out", directory / name, force=True)


def _tell(console: Console, directory: Path, rows: Rows) -> int:
    counts = {v: sum(1 for _, j in rows if j.verdict == v) for v in VERDICTS}
    console.print(f"{len(rows)} facts: " + ", ".join(f"{n} {v}" for v, n in counts.items()))
    console.print(f"{directory / 'index.html'}", markup=False)
    return _code(console, rows)


def _code(console: Console, rows: Rows) -> int:
    """Name the deviations that nothing explains; 1 when there are some."""
    unexplained = [j.id for _, j in rows if j.verdict == DEVIATES and not j.reason]
    for name in unexplained:
        console.print(f"{name}: deviates, and no reason is known", markup=False)
    return 1 if unexplained else 0
