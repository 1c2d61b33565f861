"""`--can-log`: the frames of a run as a log of the CAN world, through python-can's own writers."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from bench.run.directory import RunFiles
from hil import log as logs
from hil.config.resolved import Resolved
from hil.files import Output
from hil.log import Log
from hil.wire.busload import BITS_MAX
from hil.wire.codec import iter_frames

SUFFIXES: Final = (".log", ".asc", ".blf", ".csv", ".trc")
"""candump, Vector ASCII, Vector binary, comma-separated, PCAN trace."""


def output_of(path: Path, *, force: bool = False) -> Output:
    """Return the file of a CAN log; refuse one that could not be written after the run.

    Raises: ConfigError naming the accepted suffixes
    """
    file = Output("--can-log", path, force)
    file.check(*SUFFIXES)
    return file


def _timed(log: Log, begin_ns: int, frame_ns: int, order: int) -> Iterator[tuple[int, int, int]]:
    """Yield (time [ns], identifier, word): a tick's frames one after the other on the wire."""
    for _, t_ns, batch in log.frames("sent"):
        at_ns = begin_ns + t_ns + order * frame_ns
        for can_id, word in iter_frames(batch):
            at_ns += frame_ns
            yield at_ns, can_id, word


def write(file: Output, scenario: Resolved, files: RunFiles, begin_ns: int) -> int:
    """Write the frames that both processes sent; returns how many.

    In a tick the plant's frames come first, then the controller's, each as long after the other
    as the bus needs for it at the most.

    Parameters: begin_ns : start of the run since the epoch [ns]
    Raises: LogError, and as the file does when it cannot be written
    """
    import can

    frame_ns = round(1e9 * BITS_MAX / scenario.link.bitrate_bit_s)
    channel = scenario.link.bus_parts()[1] or scenario.link.kind
    count = 0
    with (
        file.writing() as beside,
        logs.open(files.plant_log) as plant,
        logs.open(files.controller_log) as controller,
        can.Logger(beside) as writer,
    ):
        both = heapq.merge(
            _timed(plant, begin_ns, frame_ns, 0), _timed(controller, begin_ns, frame_ns, 2)
        )
        for at_ns, can_id, word in both:
            writer.on_message_received(
                can.Message(
                    timestamp=at_ns * 1e-9, arbitration_id=can_id, is_extended_id=False,
                    data=word.to_bytes(8, "little"), channel=channel,
                )
            )  # fmt: skip
            count += 1
    return count
