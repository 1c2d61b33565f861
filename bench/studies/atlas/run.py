"""Entries on all cores, each result a file: what is there already is not made again.

DIR/parts/ID.json   findings and drawings of an entry, with what they were made from
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from pathlib import Path
from typing import Any

from bench.studies.atlas.entries import ENTRIES
from bench.studies.atlas.entry import Entry, Finding, Found
from bench.studies.pool import worker_pool
from bench.web.chart import Chart, Level, Series
from hil import compiled
from hil.errors import HilError, RunError
from hil.files import Output, read_regular

PACKAGES = ("hil", "plant", "controller", "bench")
"""What an entry depends on: their sources and figures are part of a result's fingerprint."""

ENTRIES_MODULE = "bench.studies.atlas.entries"
"""Imported once, not by every worker."""

Told = Callable[[str, float], None]


def fingerprint(quick: bool) -> str:
    """Return what results were made from: another one makes them stale."""
    digest = hashlib.sha256(b"quick" if quick else b"whole")
    for package in PACKAGES:
        for path in sorted((compiled.root() / package).rglob("*")):
            if path.suffix in {".py", ".toml", ".csv"}:
                digest.update(f"{path.name}\0".encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()


def run(
    entries: Sequence[Entry], parts: Path, quick: bool, told: Told, workers: int | None = None
) -> dict[str, Found]:
    """Make the entries that are not there yet; returns the results of all, by id.

    Raises: RunError naming the entry that failed
    """
    parts.mkdir(exist_ok=True)
    made_from = fingerprint(quick)
    found = {e.id: f for e in entries if (f := _kept(_part(parts, e.id), made_from)) is not None}
    todo = sorted((e for e in entries if e.id not in found), key=lambda e: (-e.weight, e.id))
    for entry, result, wall_s in _computed(todo, quick, workers or os.cpu_count() or 1):
        _keep(_part(parts, entry.id), made_from, result)
        found[entry.id] = result
        told(entry.id, wall_s)
    return found


def _part(parts: Path, name: str) -> Path:
    return parts / f"{name}.json"


def _computed(
    todo: Sequence[Entry], quick: bool, workers: int
) -> Iterator[tuple[Entry, Found, float]]:
    """Results as they come."""
    if not todo:
        return
    with worker_pool(min(workers, len(todo)), preload=[ENTRIES_MODULE]) as pool:
        pending = {pool.submit(work, entry.id, quick): entry for entry in todo}
        while pending:
            finished, _ = wait(pending, return_when=FIRST_COMPLETED)
            for future in finished:
                entry = pending.pop(future)
                yield (entry, *_result(entry, future))


def _result(entry: Entry, future: Future[tuple[Found, float]]) -> tuple[Found, float]:
    try:
        return future.result()
    except HilError as error:
        raise RunError(f"{entry.id}: {error}") from None


def work(name: str, quick: bool) -> tuple[Found, float]:
    """Make one entry; returns its result and the time that it took.

    Raises: RunError when it answers other facts than it says
    """
    entry = ENTRIES[name]
    begun = time.perf_counter()
    found = entry.work(quick)
    expected = {fact.id for fact in entry.facts}
    if set(found.findings) != expected:
        wrong = ", ".join(sorted(set(found.findings) ^ expected))
        raise RunError(f"answers other facts than it says: {wrong}")
    plain = {name: Finding(_plain(f.ours), f.told) for name, f in found.findings.items()}
    return Found(plain, found.charts), time.perf_counter() - begun


def _plain(value: Any) -> float | bool | None:  # noqa: ANN401
    """A number or truth of numpy's as Python's own; nan is none."""
    if value is None or type(value).__name__ in {"bool", "bool_"}:
        return None if value is None else bool(value)
    return None if math.isnan(value) else float(value)


def _keep(path: Path, made_from: str, found: Found) -> None:
    content = {
        "made_from": made_from,
        "findings": {name: list(finding) for name, finding in sorted(found.findings.items())},
        "charts": [_tree(chart) for chart in found.charts],
    }
    Output("--out", path, force=True).write(json.dumps(content) + "\n")


def _kept(path: Path, made_from: str) -> Found | None:
    """A result that is there, whole and made from what is there now."""
    if not path.is_file():
        return None
    try:
        content = json.loads(read_regular(path))
        if content["made_from"] != made_from:
            return None
        findings = {name: Finding(*row) for name, row in content["findings"].items()}
        return Found(findings, tuple(map(_chart, content["charts"])))
    except (ValueError, KeyError, TypeError):
        return None


def _tree(chart: Chart) -> dict[str, Any]:
    return chart._asdict() | {
        "series": [curve._asdict() for curve in chart.series],
        "levels": [level._asdict() for level in chart.levels],
    }


def _chart(tree: dict[str, Any]) -> Chart:
    curves = tuple(
        Series(s["label"], tuple(s["x"]), tuple(s["y"]), s["mark"]) for s in tree["series"]
    )
    levels = tuple(Level(**level) for level in tree["levels"])
    return Chart(**{**tree, "series": curves, "levels": levels})
