"""A log as an MF4 file (ASAM MDF), through asammdf."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.logs.exported import Exported, Outcome, library
from bench.run import directory
from hil.files import Output
from hil.log import Log, Span
from hil.log.coding import UndecodableError
from hil.log.tables import column_units, timed_columns

_ROW_GROUP = 65_536


def to_mf4(log: Log, target: Output, topics: list[str], span: Span) -> Outcome:
    """One measurement file with a channel group a topic; text and frames have no place in it."""
    mdf = library("asammdf", "export to MF4")
    if target.path.suffix != ".mf4":
        target = target._replace(path=target.path.with_name(f"{target.path.name}.mf4"))
    directory.make_directory("--out", target.path.parent)
    target.check()
    written, skipped = 0, []
    with mdf.MDF(version="4.10") as file:
        for topic in topics:
            coding = log.topics[topic].coding
            try:
                if not coding.fixed:
                    reason = coding.reason or "messages that vary in size have no place in MF4"
                    raise UndecodableError(f"{topic}: {reason}")
                written += _add_group(mdf, file, log, topic, span)
            except UndecodableError as error:
                skipped.append(str(error).removeprefix(f"{log.path}: "))
        if topics and len(skipped) == len(topics):
            return Outcome([], skipped)
        with target.writing() as beside:
            file.save(beside, overwrite=True)
    return Outcome([Exported(target.path, written)], skipped)


def _add_group(mdf: Any, file: Any, log: Log, topic: str, span: Span) -> int:  # noqa: ANN401
    units = column_units(log, topic)
    group, rows = None, 0
    for times, block in _wide_blocks(log, topic, span):
        t_s = times * 1e-9
        rows += len(t_s)
        if group is None:
            group = len(file.groups)
            signals = [
                mdf.Signal(values, t_s, unit=units.get(name, ""), name=f"{topic.strip('/')}.{name}")
                for name, values in block.items()
            ]
            file.append(signals, acq_name=topic, common_timebase=True)
        else:
            file.extend(group, [(t_s, None), *((values, None) for values in block.values())])
    return rows


def _wide_blocks(log: Log, topic: str, span: Span) -> Iterator[tuple[NDArray[Any], dict[str, Any]]]:
    """Join the blocks of a few hundred rows that a chunk gives: log times, columns of numbers."""
    waiting: list[dict[str, Any]] = []
    rows = 0
    for times, block in timed_columns(log, topic, span):
        numbers = {name: _number(v) for name, v in block.items() if isinstance(v, np.ndarray)}
        waiting.append({"": times, "t_ns": times, **numbers})
        rows += len(times)
        if rows >= _ROW_GROUP:
            yield _joined(waiting)
            waiting, rows = [], 0
    if waiting:
        yield _joined(waiting)


def _number(values: NDArray[Any]) -> NDArray[Any]:
    return values.astype(np.uint8) if values.dtype == np.bool_ else values


def _joined(blocks: list[dict[str, Any]]) -> tuple[NDArray[Any], dict[str, Any]]:
    whole = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    return whole.pop(""), whole
