"""Golden runs: small recorded runs that plant and controller of today must repeat bit by bit.

`hil golden` replays them. `hil golden --update` is the only way to change them: it runs each one
anew, prints by how much every signal differs from what was recorded, and replaces the files.
"""

from __future__ import annotations

import math
import shutil
import tempfile
from collections.abc import Iterable
from pathlib import Path

from rich.console import Console

from bench.dev.golden_cases import CASES, Order, scenario_for
from bench.logs.diff import Comparison, compare
from bench.logs.replay.replay import replay_file
from bench.run import directory as outdir
from bench.run.memory.pair import Pair
from hil import log as logs
from hil.config.resolved import Resolved
from hil.errors import LogError
from hil.log.part import ALWAYS

PROCESSES = ("plant", "controller")
ORIGIN = "golden"


def check(directory: Path) -> int:
    """Replay all golden runs; 0 when each is repeated bit by bit, 1 when not.

    Raises: LogError when there is none
    """
    from bench.logs.replay.outcome_table import show

    console = Console(highlight=False, markup=False, soft_wrap=True)
    paths = sorted(directory.glob("*/*.mcap"))
    if not paths:
        raise LogError(f"{directory}: no golden runs; `hil golden --update` records them")
    different = 0
    for path in paths:
        outcome = replay_file(path, None, ALWAYS)
        different += not outcome.identical
        with logs.open(path) as log:
            show(console, path, outcome, log)
    return 1 if different else 0


def update(directory: Path) -> int:
    """Record all golden runs anew and tell what has changed; files that agree stay as they are.

    Raises: ConfigError when the directory cannot be written
    """
    outdir.make_directory("--directory", directory)
    console = Console(highlight=False, markup=False, soft_wrap=True)
    with tempfile.TemporaryDirectory(prefix="hil-golden-") as scratch:
        for case in CASES:
            new = Path(scratch) / case.name
            new.mkdir()
            record(scenario_for(case), new, case.orders)
            for process in PROCESSES:
                _replace(console, new / f"{process}.mcap", directory / case.name)
    return 0


def record(scenario: Resolved, out: Path, orders: Iterable[Order] = ()) -> None:
    """Run a scenario in memory and lockstep, with both logs; both sides hear the orders."""
    waiting = sorted(orders, key=lambda order: order.at_s)
    with Pair(scenario, out) as pair:
        for order in waiting:
            pair.advance(max(math.ceil(order.at_s * scenario.loop.rate_hz) - pair.tick, 0))
            pair.order(order.command, ORIGIN)
        pair.advance(scenario.ticks - pair.tick)


def _replace(console: Console, new: Path, directory: Path) -> None:
    old = directory / new.name
    found = _compared(old, new)
    if found is not None and found.same and not _reconfigured(found):
        console.print(f"{old}: unchanged")
        return
    outdir.make_directory("--directory", directory)
    shutil.copyfile(new, old)
    if found is None:
        console.print(f"{old}: new")
        return
    _tell(console, old, found)


def _reconfigured(found: Comparison) -> bool:
    """Whether a key has another value; one that is new, with its default, changes nothing."""
    return any(before is not None for _, before, _ in found.configuration)


def _compared(old: Path, new: Path) -> Comparison | None:
    """Compare with what was recorded before; None when there is none that can be read."""
    if not old.exists():
        return None
    try:
        with logs.open(old) as a, logs.open(new) as b:
            return compare(a, b)
    except LogError:
        return None


def _tell(console: Console, path: Path, found: Comparison) -> None:
    """Print the numeric difference of every signal that has changed."""
    first = "" if found.first is None else f", first at tick {found.first.tick}"
    console.print(f"{path}: changed{first}")
    for key, old, new in found.configuration:
        console.print(f"  {key}: {old} -> {new}")
    for gap in found.topics:
        for name, field in gap.fields.items():
            console.print(
                f"  {gap.topic} {name}: {field.rows} of {gap.common} values, "
                f"by {field.largest:.6g} at the most"
            )
        others = gap.different if not gap.fields else 0
        if others or gap.only_a or gap.only_b:
            console.print(f"  {gap.topic}: {others} differ, {gap.only_a} gone, {gap.only_b} new")
