"""A run without a process of its own: the same loops, logs and figures, in lockstep over memory."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

from bench.run.directory import RunFiles
from bench.run.execution import Ended
from bench.run.memory.pair import Pair
from hil.config.resolved import Resolved
from hil.errors import HilError
from hil.files import Output
from plant.status import raise_if_lost

_LOOK_EVERY: Final = 1000


def _nothing(_tick: int) -> None:
    """Look at nothing."""


def execute_here(
    scenario: Resolved, files: RunFiles, look: Callable[[int], None] = _nothing
) -> Ended:
    """Run a scenario in this thread and tell how it ended.

    Parameters: look : called with the tick reached, now and then

    Raises: ConfigError when it cannot begin
    """
    started, start_s = time.strftime("%Y-%m-%dT%H:%M:%S%z"), time.monotonic()
    Output("--out", files.scenario, force=True).write(scenario.model_dump_json(indent=1))
    error: HilError | None = None
    with Pair(scenario, files.directory) as pair:
        begin_s = time.perf_counter()
        while pair.tick < scenario.ticks:
            look(pair.advance(min(_LOOK_EVERY, scenario.ticks - pair.tick)))
        loop_s = time.perf_counter() - begin_s
        try:
            raise_if_lost(pair.plant)
        except HilError as lost:
            error = lost
    facts = {"loop": {"loop_s": loop_s, "ticks": pair.tick}}
    wall_s = time.monotonic() - start_s
    return Ended(facts, wall_s, started, error, error.exit_code if error else 0)
