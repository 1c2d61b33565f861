"""What the codec costs for one tick's frames, beside cantools on the same frames.

python -m bench.measure.codec_cost
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from typing import Any, Final, NamedTuple

from hil import compiled
from hil.errors import MissingExtraError
from hil.values import fields_of
from hil.wire.codec import Decoder, Encoder, iter_frames
from hil.wire.messages import (
    PULSE_CLOCK_US,
    ControllerTick,
    MachineCommand,
    Message,
    PistonSample,
    PlantTick,
    Pulse,
)

LIMIT_US: Final = 10.0
_TICKS: Final = 100
_REPEATS: Final = 300
_NAN: Final = float("nan")


class Cost(NamedTuple):
    """Microseconds for the six frames of one tick, the best of several passes."""

    what: str
    encode_us: float
    decode_us: float

    @property
    def total_us(self) -> float:
        """Both directions of work."""
        return self.encode_us + self.decode_us


def tick_messages(tick: int, *, fresh: bool) -> tuple[tuple[Message, ...], tuple[Message, ...]]:
    """Return the frames of a tick: two of the plant, four of the controller.

    Parameters: fresh : whether commands and pulses differ from those of the tick before
    """
    n = tick if fresh else 0
    return (
        (
            PlantTick(tick, 2, 0, 1200.0 + tick % 7, _NAN, _NAN),
            PistonSample(1e-6 * (tick % 15_000), 1e-3 * (tick % 1700)),
        ),
        (
            ControllerTick(tick, 4, 2),
            MachineCommand(2, 0.0, 810.0 - 0.01 * (n % 100), 1.0),
            Pulse(0, (n * 1000 + 417) % PULSE_CLOCK_US, 3618),
            Pulse(2, (n * 1000 + 917) % PULSE_CLOCK_US, 500),
        ),
    )


def _best(work: Callable[[], object]) -> float:
    """Return the shortest of many short passes: one that nothing else interrupted [us a tick]."""
    times = []
    for _ in range(_REPEATS):
        start_s = time.perf_counter()
        work()
        times.append(time.perf_counter() - start_s)
    return min(times) / _TICKS * 1e6


def ours(*, fresh: bool) -> Cost:
    """Cost of the project's own codec, protection included.

    Parameters: fresh : True for the worst case, False for commands that repeat as in a run
    """
    ticks = [tick_messages(tick, fresh=fresh) for tick in range(_TICKS)]
    encoders = (Encoder(), Encoder())
    batches = [
        (encoders[0].encode(plant), encoders[1].encode(controller)) for plant, controller in ticks
    ]

    def encode() -> None:
        plant_encoder, controller_encoder = Encoder(), Encoder()
        for plant, controller in ticks:
            plant_encoder.encode(plant)
            controller_encoder.encode(controller)

    def decode() -> None:
        plant_decoder, controller_decoder = Decoder("plant"), Decoder("controller")
        for plant, controller in batches:
            plant_decoder.decode(plant)
            controller_decoder.decode(controller)

    name = "hil.codec, all values new" if fresh else "hil.codec, commands repeat"
    return Cost(name, _best(encode), _best(decode))


def cantools_cost() -> Cost:
    """Cost of cantools' encode and decode of the same signals, without protection.

    Raises: MissingExtraError without cantools
    """
    try:
        import cantools
    except ImportError:
        raise MissingExtraError("cantools", "desk", "the comparison") from None
    database: Any = cantools.database.load_file(compiled.root() / "hil/wire/fpeg.dbc")
    ticks = [tick_messages(tick, fresh=True) for tick in range(_TICKS)]
    work = [
        (database.get_message_by_name(type(message).__name__), _fields(message))
        for tick in ticks
        for side in tick
        for message in side
    ]
    raw = [(message, message.encode(fields, strict=False)) for message, fields in work]

    def encode() -> None:
        for message, fields in work:
            message.encode(fields, strict=False)

    def decode() -> None:
        for message, data in raw:
            message.decode(data)

    return Cost("cantools, no protection", _best(encode), _best(decode))


def _fields(message: Message) -> dict[str, float]:
    """Return a message as cantools wants it; what is not a number is not on the wire."""
    values = {name: getattr(message, name) for name in fields_of(type(message))}
    carried = {name: value for name, value in values.items() if not math.isnan(value)}
    return {"e2e_crc": 0, "e2e_counter": 0, **carried}


def frames_of_tick() -> int:
    """Return how many frames a tick of this benchmark has."""
    batches = [Encoder().encode(side) for side in tick_messages(1, fresh=True)]
    return sum(1 for batch in batches for _ in iter_frames(batch))


def main() -> int:
    """Print the table; 1 when a tick as a run has it takes longer than it may."""
    costs = [ours(fresh=True), ours(fresh=False), cantools_cost()]
    print(f"{'one tick, ' + str(frames_of_tick()) + ' frames':<28} encode  decode   both  [us]")
    for cost in costs:
        print(f"{cost.what:<28}{cost.encode_us:7.2f} {cost.decode_us:7.2f} {cost.total_us:6.2f}")
    return 0 if costs[1].total_us <= LIMIT_US else 1


if __name__ == "__main__":
    sys.exit(main())
