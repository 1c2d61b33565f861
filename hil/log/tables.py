"""Topics of a log as columns: for pandas, polars and the files that hand a log to other tools."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from hil.errors import MissingExtraError
from hil.log.part import ALWAYS, Span, TopicInfo

if TYPE_CHECKING:
    import pandas
    import polars

Columns = dict[str, Any]
_ROWS = 20_000


class Log(Protocol):
    """What is needed of a log; the reader's own class, which offers these frames, fulfils it."""

    topics: dict[str, TopicInfo]

    def blocks(self, topic: str, span: Span = ...) -> Iterator[NDArray[Any]]:
        """Yield the messages of a fixed-size topic as structured arrays."""

    def records(self, topic: str, span: Span = ...) -> Iterator[Any]:
        """Yield the messages of any topic as named tuples."""

    def units(self, topic: str) -> dict[str, str]:
        """Return the unit of each field that has one, or raise LogError: no such topic."""


def columns(log: Log, topic: str, span: Span = ALWAYS) -> Iterator[Columns]:
    """Yield a topic by blocks as {column: values}: numpy arrays, lists of str or bytes.

    A fixed array becomes one column an item: pulse_channel_0, pulse_channel_1, ...

    Raises: LogError when there is no such topic
    """
    if log.topics[topic].layout.variable if topic in log.topics else False:
        yield from _variable(log, topic, span)
        return
    for block in log.blocks(topic, span):
        found: Columns = {}
        for name in block.dtype.names or ():
            values = block[name]
            if values.ndim == 1:
                found[name] = np.ascontiguousarray(values)
            else:
                for item in range(values.shape[1]):
                    found[f"{name}_{item}"] = np.ascontiguousarray(values[:, item])
        yield found


def _variable(log: Log, topic: str, span: Span) -> Iterator[Columns]:
    """Collect records of varying size into blocks."""
    names = [field.name for field in log.topics[topic].fields]
    kinds = {field.name: field.type for field in log.topics[topic].fields}
    rows: list[Any] = []

    def block() -> Columns:
        fields = zip(names, zip(*rows, strict=True), strict=True)
        return {name: _column(kinds[name], values) for name, values in fields}

    for record in log.records(topic, span):
        rows.append(record)
        if len(rows) == _ROWS:
            yield block()
            rows.clear()
    if rows:
        yield block()


def _column(kind: str, values: tuple[Any, ...]) -> Any:  # noqa: ANN401
    return list(values) if kind in {"string", "uint8[]"} else np.array(values, dtype=kind)


def column_units(log: Log, topic: str) -> dict[str, str]:
    """Return the unit of every column that has one, in the names of `columns`."""
    found = {}
    for field in log.topics[topic].fields:
        if field.unit:
            count = field.type.partition("[")[2].rstrip("]")
            names = [f"{field.name}_{i}" for i in range(int(count))] if count else [field.name]
            found.update(dict.fromkeys(names, field.unit))
    return found


def _whole(log: Log, topic: str, span: Span) -> Columns:
    """Put the blocks of a topic together."""
    blocks = list(columns(log, topic, span))
    if not blocks:
        return {}
    whole: Columns = {}
    for name, first in blocks[0].items():
        parts = [block[name] for block in blocks]
        is_list = isinstance(first, list)
        whole[name] = [v for part in parts for v in part] if is_list else np.concatenate(parts)
    return whole


def pandas_frame(log: Log, topic: str, span: Span = ALWAYS) -> pandas.DataFrame:
    """Return a topic as a pandas frame, indexed by nothing, units in `attrs["units"]`."""
    try:
        import pandas  # noqa: PLC0415  # an extra
    except ImportError:
        raise MissingExtraError("pandas", "notebook", "a pandas frame") from None
    log.units(topic)
    frame = pandas.DataFrame(_whole(log, topic, span))
    frame.attrs["units"] = column_units(log, topic)
    return frame


def polars_frame(log: Log, topic: str, span: Span = ALWAYS) -> polars.DataFrame:
    """Return a topic as a polars frame; its units are those of `column_units`."""
    try:
        import polars  # noqa: PLC0415  # an extra
    except ImportError:
        raise MissingExtraError("polars", "notebook", "a polars frame") from None
    log.units(topic)
    return polars.DataFrame(_whole(log, topic, span))
