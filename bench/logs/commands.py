"""What the commands about logs do; bench/cli/logs.py only reads their arguments."""

from __future__ import annotations

import time
from pathlib import Path

from rich.console import Console
from rich.table import Table

from bench.report.quantities import bytes_text, thousands
from hil import log as logs
from hil.errors import ConfigError, printable
from hil.log import Log, Span
from hil.log.part import ALWAYS
from hil.log.records import FORMAT
from hil.log.segments import segments_before

_LATEST_S = (1 << 64) * 1e-9


def _span(start_s: float | None, end_s: float | None) -> Span:
    """Return the stretch of log time that two options ask for.

    Raises: ConfigError when it is none
    """
    if start_s is None and end_s is None:
        return ALWAYS
    start_s, end_s = start_s or 0.0, _LATEST_S if end_s is None else end_s
    if not 0.0 <= start_s <= end_s <= _LATEST_S:
        raise ConfigError(f"from {start_s:g} s to {end_s:g} s: accepted is 0 <= from <= to")
    return Span(round(start_s * 1e9), min(round(end_s * 1e9), ALWAYS.end_ns))


def _console() -> Console:
    return Console(highlight=False, markup=False, soft_wrap=True)


def replay(
    path: Path, config: Path | None, start_s: float | None, end_s: float | None,
    law: Path | None = None, engine: Path | None = None,
) -> int:  # fmt: skip
    """Replay a log; 0 when identical, 1 when not."""
    from bench.logs.replay import replay as replays
    from bench.logs.replay.outcome_table import show

    outcome = replays.replay_file(
        path, config, _span(start_s, end_s), replays.OwnFiles(law, engine)
    )
    with logs.open(path) as log:
        show(_console(), path, outcome, log)
    return 0 if outcome.identical else 1


def diff(first: Path, second: Path, *, timing: bool) -> int:
    """Compare two logs; 0 when they are the same, 1 when not."""
    from bench.logs.diff import compare
    from bench.logs.diff_text import show

    with logs.open(first) as a, logs.open(second) as b:
        found = compare(a, b, timing=timing)
    show(_console(), first, second, found)
    return 0 if found.same else 1


def what_if(
    directory: Path, start: str, assignments: list[str], duration_s: float | None,
    out: Path | None, law: Path | None = None, engine: Path | None = None,
) -> int:  # fmt: skip
    """Continue a run with other parameters and draw both."""
    from bench.logs.replay.replay import OwnFiles
    from bench.logs.what_if.comparison_table import show
    from bench.logs.what_if.continuation import Wish, continue_run

    console = _console()
    own = OwnFiles(law, engine)
    told = continue_run(directory, Wish(start, tuple(assignments), duration_s, out, own))
    show(console, told)
    return 0


def info(path: Path, *, verify: bool) -> int:
    """Tell all about a log."""
    with logs.open(path) as log:
        _show_info(_console(), log)
        if verify:
            _verify(_console(), [part.path for part in log.parts])
    return 0


def _show_info(console: Console, log: Log) -> None:
    run = log.metadata.get("run", {})
    files = [part.path for part in log.parts]
    size = sum(path.stat().st_size for path in files)
    chunks = sum(part.chunk_count for part in log.parts)
    messages = sum(part.messages for part in log.parts)
    process, scenario = run.get("process", "log"), run.get("scenario", "no scenario")
    console.print(printable(f"{log.path}: {process} of {scenario}"))
    rows = {
        "time": f"{log.start_ns * 1e-9:.3f} to {log.end_ns * 1e-9:.3f} s",
        "size": f"{bytes_text(size)} in {_files(log, files)}, {thousands(chunks)} chunks, "
        f"{thousands(messages)} messages",
        "run": ", ".join(f"{k} {v}" for k, v in run.items() if k not in {"process", "scenario"}),
        "ended": _ending(log),
        "format": _format(log),
        "versions": ", ".join(f"{k} {v}" for k, v in log.metadata.get("versions", {}).items()),
        "attached": ", ".join(
            f"{a.name} ({bytes_text(len(a.content))})" for a in log.attachments.values()
        ),
        "resumable": _resumable(log),
    }
    for title, text in rows.items():
        if text:
            console.print(f"  {title:<10}{printable(text)}")
    table = Table(box=None, padding=(0, 2, 0, 2), header_style="dim")
    table.add_column("topic")
    table.add_column("messages", justify="right")
    table.add_column("fields")
    for topic in log.topics.values():
        fields = ", ".join(f"{f.name} [{f.unit}]" if f.unit else f.name for f in topic.fields)
        told = printable(topic.coding.reason or fields)
        table.add_row(printable(topic.name), thousands(topic.messages), told)
    console.print(table)


def _files(log: Log, files: list[Path]) -> str:
    missing = ", earlier ones are gone" if log.continues else ""
    return f"{len(files)} segments{missing}" if len(files) > 1 or log.continues else "1 file"


def _format(log: Log) -> str:
    """Name the format of a log of ours that is older than today's."""
    if log.format in {None, FORMAT}:
        return ""
    return f"{log.format}, older than today's {FORMAT}: read and exported, but not replayed"


def _ending(log: Log) -> str:
    recorder = log.metadata.get("recorder", {})
    return ", ".join(v if k == "end" else f"{k} {v}" for k, v in recorder.items())


def _resumable(log: Log) -> str:
    count = log.topics["/snapshot"].messages if "/snapshot" in log.topics else 0
    return f"at {thousands(count)} snapshots" if count else "no snapshots: from its start only"


def _verify(console: Console, paths: list[Path]) -> None:
    """Check everything in the files of a log.

    Raises: LogError for the first that is not sound
    """
    from hil.log.verify import verify

    before_s = time.perf_counter()
    found = [verify(path) for path in paths]
    size = sum(one.size for one in found)
    rate = size / max(time.perf_counter() - before_s, 1e-9)
    console.print(f"  verified  {bytes_text(size)} of records ({bytes_text(rate)}/s): all sound")
    for path, one in zip(paths, found, strict=True):
        for note in one.notes:
            console.print(f"  note: {path}: {note}")


def export(
    path: Path,
    kind: str,
    out: Path | None,
    topics: list[str],
    start_s: float | None,
    end_s: float | None,
    *,
    force: bool = False,
) -> int:
    """Write a log as files of another kind."""
    from bench.logs.export import export as write

    span = _span(start_s, end_s)
    target = out or path.with_suffix(".mf4" if kind == "mf4" else f".{kind}")
    before_s = time.perf_counter()
    with logs.open(path) as log:
        done = write(log, kind, target, topics, span, force=force)
    taken_s = time.perf_counter() - before_s
    console = _console()
    for file in done.files:
        size = bytes_text(file.path.stat().st_size)
        console.print(f"  {file.path}: {thousands(file.messages)} messages, {size}")
    for line in done.skipped:
        console.print(f"  skipped {printable(line)}", style="yellow")
    total = sum(file.messages for file in done.files)
    console.print(f"{thousands(total)} messages in {taken_s:.1f} s ({total / taken_s:,.0f}/s)")
    return 0


def repair(path: Path, out: Path | None, *, force: bool = False) -> int:
    """Save what can be saved from a log, of each segment by itself."""
    from bench.logs.repair import repair as mend

    console = _console()
    done = mend(path, out, force=force)
    for line in done.lost:
        console.print(f"  lost: {printable(line)}", style="yellow")
    console.print(
        f"{done.out}: {thousands(done.messages)} messages of {thousands(done.chunks)} whole chunks,"
        f" {done.first_ns * 1e-9:.3f} to {done.last_ns * 1e-9:.3f} s, read back and sound"
    )
    if segments_before(path):
        console.print(f"  note: {path} has earlier segments, which were left as they are")
    return 0
