"""The table of all attacks, and docs/trust.md, which is made of it."""

from __future__ import annotations

import platform
import random
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from rich.console import Console

from bench.dev.markdown import table
from bench.trust import damage, floods, kills, stops
from bench.trust.attack import Attack, Field, Tally
from bench.trust.victims import let_hear
from drivers.system.log import git_hash
from hil.files import Output

ALL: Final = (
    Attack("kills", "SIGKILL to any process of a run, at any moment, over every link",
           "nothing left running, no next start blocked, one line and its exit code, the reason in"
           " the logs, at most 100 ms missing", kills.kill),
    Attack("stops", "SIGINT, SIGTERM, SIGHUP at any moment", "130 and one line within 3 s",
           stops.interrupt),
    Attack("stops", "SIGSTOP of plant or controller for 10 to 500 ms",
           "met in spite of it, or blocked: no fault of the controller", stops.stop),
    Attack("floods", "messages on every key, as fast as they go",
           "a stop comes through within 3 s, nothing left running", floods.flood),
    Attack("truncations", "a log cut anywhere",
           "refused; repaired to a sound beginning of what it was", damage.cut),
    Attack("bit flips", "one bit of a log flipped anywhere",
           "seen by --verify, or no reader uses it", damage.flip),
    Attack("full disks", "no room for a log in mid-run",
           "one line with the file's name, exit code 3, both logs sound", damage.run_out_of_room),
)  # fmt: skip

_OTHERS: Final = (
    ("AUTOSAR E2E, profile 2",
     "damage, loss, repetition, insertion and wrong order of a message are told to the receiver by"
     " CRC, counter and data identifier; what follows is the application's",
     "the same on every frame ([messages.md](messages.md)); what follows is here too: the safe"
     " state within 10 ms"),
    ("PX4 failsafe table",
     "each loss (link, position, battery) has a configured reaction and a delay; the vehicle"
     " decides by itself and says which failsafe is active",
     "one reaction, the safe state, decided by each side by itself; `cause` says why, and whose"
     " doing it was"),
    ("Klipper shutdown",
     "a microcontroller that hears nothing or misses a deadline turns its outputs to their safe"
     " value until a restart; the host says why in one line",
     "pulses end by themselves, outputs fall, the run ends and its one line says why"),
)  # fmt: skip


def run(out: Output | None, *, quick: bool, seed: int = 1) -> int:
    """Make every attack, print the table, and write the page; 0 when nothing was lost."""
    if out is not None:
        out.check(".md")
    console = Console(highlight=False)
    let_hear()
    begin_s = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="hil-trust-") as place:
        field = Field(
            Path(place), quick, random.Random(seed), lambda line: console.print(line, style="dim")
        )
        rows = [(attack, attack.tries(field)) for attack in ALL]
    _print(console, rows)
    if out is not None:
        out.write(_page(rows, time.monotonic() - begin_s))
    return int(any(tally.lost for _, tally in rows))


def _print(console: Console, rows: Sequence[tuple[Attack, Tally]]) -> None:
    from rich.table import Table

    shown = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for title in ("attack", "", "tried", "survived", "lost", "noted"):
        shown.add_column(title)
    for attack, tally in rows:
        counts = (str(n) for n in (tally.tried, tally.survived, len(tally.lost)))
        shown.add_row(attack.kind, attack.does, *counts, tally.noted)
    console.print(shown)
    for _, tally in rows:
        for line in tally.lost:
            console.print(f"lost: {line}", style="red", soft_wrap=True)


def _page(rows: Sequence[tuple[Attack, Tally]], took_s: float) -> str:
    titles = ("attack", "what is done", "what has to hold", "tried", "survived", "lost", "noted")
    cells = [
        (attack.kind, attack.does, attack.promise, str(tally.tried), str(tally.survived),
         str(len(tally.lost)), tally.noted)
        for attack, tally in rows
    ]  # fmt: skip
    lines = [
        "# Trust\n",
        "What the bench promises, attacked. Made by `hil check trust --out docs/trust.md --force`;"
        " the short form, `--quick`, is part of what must hold before a change lands.\n",
        table(titles, cells),
    ]
    where = f"Python {platform.python_version()}, {platform.system()} {platform.release()}"
    lines.append(f"{git_hash()}, {where}, {took_s / 60:.0f} minutes.\n")
    lost = [f"- {attack.does}: {line}" for attack, tally in rows for line in tally.lost]
    if lost:
        lines += ["## Lost\n", *lost, ""]
    beside = table(("", "promise", "here"), _OTHERS)
    return "\n".join([*lines, "## What others promise\n", beside])
