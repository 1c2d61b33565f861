"""Replay of a log from a rig that holds sensor and actuator topics, and nothing of the link.

Each row of /sensor is put into frames as the plant would have sent them; what the controller
answers is compared with /actuator.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

from bench.logs.replay.differences import Difference, same
from bench.logs.replay.loops import ReplayedController
from bench.logs.replay.outcome import Found, Outcome
from bench.logs.replay.turn import Turn
from hil.config.resolved import Resolved
from hil.log import Log, Span, topics
from hil.log.records import PAYLOAD_OFFSET
from hil.wire.codec import Encoder
from hil.wire.fields import layout_of
from hil.wire.messages import SLOW_ORDER, PistonSample, PlantTick

_NAN = float("nan")
_NEEDED = ("x_m", "v_m_s")
_SLOW = {
    placed.signal.only_when: placed.name
    for placed in layout_of(PlantTick).fields
    if placed.signal.only_when is not None
}
_STAMPS = {"tick", "t_ns", "answers_tick"}

Row = dict[str, Any]


def replay_rig(log: Log, scenario: Resolved, span: Span) -> Outcome:
    """Feed /sensor to the controller, from its initial state, and compare /actuator.

    Raises: LogError when /sensor lacks position or speed
    """
    _check(log)
    loop = ReplayedController(scenario)
    period_ns = scenario.loop.period_ns
    encoder = Encoder()
    answers = _answers(log, period_ns)
    before_s = time.process_time()
    first, ticks, different, found = -1, 0, 0, None
    row: Row | None = None
    for sensor in _rows(log, "/sensor", span):
        tick = _tick(sensor, period_ns)
        if tick < loop.next_tick():
            raise log.error(f"cannot be replayed: /sensor goes back to tick {tick}")
        first = tick if first < 0 else first
        ticks += 1
        replayed = _actuator_of(loop.turn(_turn(encoder, sensor, tick)))
        while row is None or _tick(row, period_ns) < tick:
            row = next(answers, None)
            if row is None:
                break
        if row is None or _tick(row, period_ns) != tick:
            continue
        differences = _differences(row, replayed, tick, tick * period_ns)
        different += bool(differences)
        if differences and found is None:
            found = Found(tick, tuple(differences), ())
    cpu_s = time.process_time() - before_s
    if not ticks:
        raise log.error("has no tick that could be replayed")
    return Outcome(
        "controller", first, ticks, different, found, (), _notes(log),
        ticks / scenario.loop.rate_hz, cpu_s,
    )  # fmt: skip


def _check(log: Log) -> None:
    if "/sensor" not in log.topics:
        raise log.error("cannot be replayed: it has neither /frames/received nor /sensor")
    names = {field.name for field in log.topics["/sensor"].fields}
    for name in _NEEDED:
        if name not in names:
            raise log.error(f"cannot be replayed: /sensor has no {name}")
    if not names & {"tick", "t_ns"}:
        raise log.error("cannot be replayed: /sensor has neither tick nor t_ns")


def _rows(log: Log, topic: str, span: Span) -> Iterator[Row]:
    for block in log.blocks(topic, span):
        names = block.dtype.names or ()
        for values in block.tolist():
            yield dict(zip(names, values, strict=True))


def _answers(log: Log, period_ns: int) -> Iterator[Row]:
    if "/actuator" in log.topics:
        yield from _rows(log, "/actuator", Span())


def _tick(row: Row, period_ns: int) -> int:
    tick: int = row["tick"] if "tick" in row else round(row["t_ns"] / period_ns)
    return tick


def _turn(encoder: Encoder, row: Row, tick: int) -> Turn:
    """Make the turn of a sample; a row without a fresh one is a tick without a batch."""
    batches: tuple[bytes, ...] = ()
    if row.get("status", topics.SAMPLE_FRESH) == topics.SAMPLE_FRESH:
        slow = SLOW_ORDER[tick % len(SLOW_ORDER)]
        values = [_NAN, _NAN, _NAN]
        given = row.get(_SLOW[slow], 0.0)
        values[slow] = given if given == given else 0.0  # noqa: PLR0124  # nan: not measured
        head = PlantTick(tick & 0xFFFFFFFF, 2, slow, *values)
        batches = (encoder.encode((head, PistonSample(row["x_m"], row["v_m_s"]))),)
    return Turn(tick, tick, 0, (0,) * 64, tick, batches, None, None, b"")


def _actuator_of(records: bytes) -> Row:
    """Decode the last /actuator of a turn."""
    layout, length = topics.ACTUATOR.layout, PAYLOAD_OFFSET + topics.ACTUATOR.layout.size
    head = topics.ACTUATOR.pack(*(0,) * 7, 0, (0,) * 4, (0,) * 4, (0,) * 4)[:11]
    start = records.rfind(head)
    values = layout.unpack(records[start + PAYLOAD_OFFSET : start + length])
    return dict(zip((field.name for field in layout.fields), values, strict=True))


def _differences(row: Row, replayed: Row, tick: int, t_ns: int) -> list[Difference]:
    units = {field.name: field.unit for field in topics.ACTUATOR.layout.fields}
    found = []
    for name, value in row.items():
        then = tuple(value) if hasattr(value, "__len__") and not isinstance(value, str) else value
        if name not in _STAMPS and name in replayed and not same(then, replayed[name]):
            difference = Difference(
                tick, t_ns, "/actuator", name, then, replayed[name], units[name]
            )
            found.append(difference)
    return found


def _notes(log: Log) -> tuple[str, ...]:
    """Tell what such a replay cannot know."""
    notes = ["no /frames/received: samples are put into frames again, to the wire's resolution"]
    names = {field.name for field in log.topics["/sensor"].fields}
    absent = [name for name in ("tick", "status", *_SLOW.values()) if name not in names]
    if absent:
        notes.append(f"/sensor has no {', '.join(absent)}")
    if "/actuator" not in log.topics:
        return (*notes, "no /actuator: there is nothing to compare the answers with")
    there = {field.name for field in log.topics["/actuator"].fields}
    missing = [f.name for f in topics.ACTUATOR.layout.fields if f.name not in there]
    if missing:
        notes.append(f"/actuator has no {', '.join(missing)}: not compared")
    for name, what in (("/command", "operator commands"), ("/snapshot", "the state at the start")):
        if name not in log.topics or not log.topics[name].messages:
            notes.append(f"no {name}: {what} cannot be known")
    return tuple(notes)
