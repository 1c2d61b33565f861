"""Topics of a log as columns: for pandas, polars and the files that hand a log to other tools."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from hil.errors import MissingExtraError
from hil.log.part import ALWAYS, Span, TopicInfo
from hil.log.records import SCALARS, Field

if TYPE_CHECKING:
    import pandas
    import polars

Columns = dict[str, Any]
_ROWS = 20_000
_MOST_COLUMNS = 64


class Log(Protocol):
    """What is needed of a log; the reader's own class, which offers these frames, fulfils it."""

    topics: dict[str, TopicInfo]

    def timed_blocks(
        self, topic: str, span: Span = ...
    ) -> Iterator[tuple[NDArray[Any], NDArray[Any]]]:
        """Yield (log times, messages) of a fixed-size topic as structured arrays."""

    def timed_records(self, topic: str, span: Span = ...) -> Iterator[tuple[int, Any]]:
        """Yield (log time, message) of any topic, messages as named tuples."""

    def units(self, topic: str) -> dict[str, str]:
        """Return the unit of each field that has one, or raise LogError: no such topic."""


def columns(log: Log, topic: str, span: Span = ALWAYS) -> Iterator[Columns]:
    """Yield a topic by blocks as {column: values}: numpy arrays, lists of str, bytes or lists.

    A fixed array becomes one column an item: pulse_channel_0, pulse_channel_1, ...; a topic
    without `t_ns` gets one, from the time at which its messages were logged.

    Raises: LogError when there is no such topic, UndecodableError when it is not decoded
    """
    for times, block in timed_columns(log, topic, span):
        yield block if "t_ns" in block else {"t_ns": times, **block}


def timed_columns(
    log: Log, topic: str, span: Span = ALWAYS
) -> Iterator[tuple[NDArray[Any], Columns]]:
    """Yield (log times [ns], columns of the topic's own fields) by blocks."""
    log.units(topic)  # tells an unknown topic
    fields = log.topics[topic].fields
    if not log.topics[topic].coding.fixed:
        yield from _variable(log, topic, span)
        return
    for times, rows in log.timed_blocks(topic, span):
        found: Columns = {}
        for field in fields:
            found.update(_columns_of(field, rows[field.name]))
        yield times, found


def _variable(log: Log, topic: str, span: Span) -> Iterator[tuple[NDArray[Any], Columns]]:
    """Collect records of varying size into blocks."""
    records = log.timed_records(topic, span)
    while rows := list(islice(records, _ROWS)):
        found: Columns = {}
        values = zip(*(row for _, row in rows), strict=True)
        for field, column in zip(log.topics[topic].fields, values, strict=True):
            found.update(_columns_of(field, column))
        yield np.array([t_ns for t_ns, _ in rows], np.uint64), found


def _columns_of(field: Field, values: Any) -> Iterator[tuple[str, Any]]:  # noqa: ANN401
    """Yield the columns of one field: those of a fixed array, or its own."""
    (name, kind), *rest = _names_of(field)
    if rest or name != field.name:
        for item, (own, _) in enumerate(_names_of(field)):
            yield own, _column(kind, [row[item] for row in values])
    elif isinstance(values, np.ndarray) and values.ndim > 1:
        yield name, values.tolist()
    else:
        yield name, _column(kind, values)


def _column(kind: str, values: Any) -> Any:  # noqa: ANN401
    return np.ascontiguousarray(values, dtype=kind) if kind in SCALARS else list(values)


def _names_of(field: Field) -> list[tuple[str, str]]:
    """Return (name, type) of the columns that a field becomes; a long array stays one."""
    base, array, count = field.type.rstrip("]").partition("[")
    if not array or not count:
        return [(field.name, field.type)]
    if "/" in base or not 0 < int(count) <= _MOST_COLUMNS:
        return [(field.name, f"{base}[]")]
    return [(f"{field.name}_{item}", base) for item in range(int(count))]


def column_kinds(log: Log, topic: str) -> dict[str, str]:
    """Return the ROS type of every column, in the names and the order of `columns`."""
    found = {n: kind for field in log.topics[topic].fields for n, kind in _names_of(field)}
    return found if "t_ns" in found else {"t_ns": "uint64", **found}


def column_units(log: Log, topic: str) -> dict[str, str]:
    """Return the unit of every column that has one, in the names of `columns`."""
    fields = log.topics[topic].fields
    return {name: field.unit for field in fields if field.unit for name, _ in _names_of(field)}


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
