"""`hil export`: a log as Parquet, CSV or MF4, block by block, so that any length will do."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np

from hil.errors import ConfigError, MissingExtraError
from hil.log import Log, Span
from hil.log.tables import column_units, columns

_ROW_GROUP = 65_536


class Exported(NamedTuple):
    """One file that was written."""

    path: Path
    messages: int


def library(name: str, purpose: str) -> Any:  # noqa: ANN401
    """Import an optional library.

    Raises: MissingExtraError
    """
    try:
        return importlib.import_module(name)
    except ImportError:
        raise MissingExtraError(name.partition(".")[0], "export", purpose) from None


def export(log: Log, kind: str, out: Path, topics: list[str], span: Span) -> list[Exported]:
    """Write the topics of a log; a directory with a file each, or one file for MF4.

    Raises: LogError for an unknown topic, ConfigError when it cannot be written,
        MissingExtraError without the library
    """
    chosen = topics or [name for name, info in log.topics.items() if info.messages]
    for name in chosen:
        log.units(name)  # tells an unknown topic
    try:
        if kind == "mf4":
            return _to_mf4(log, out, chosen, span)
        out.mkdir(parents=True, exist_ok=True)
        write: Callable[..., int] = {"parquet": _to_parquet, "csv": _to_csv}[kind]
        return [
            Exported(path, write(log, name, path, span))
            for name in chosen
            for path in (out / f"{name.strip('/').replace('/', '_')}.{kind}",)
        ]
    except OSError as error:
        raise ConfigError(f"{out}: {error.strerror or error}") from None


class _Batches(AbstractContextManager["_Batches"]):
    """Joins small blocks into row groups of a useful size for a pyarrow writer."""

    def __init__(self, open_writer: Callable[[Any], Any], units: dict[str, str]) -> None:
        self._arrow = library("pyarrow", "this export")
        self._open = open_writer
        self._units = units
        self._writer: Any = None
        self._waiting: list[Any] = []
        self._rows = 0
        self.messages = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self._flush()
        if self._writer is not None:
            self._writer.close()

    def add(self, block: dict[str, Any]) -> None:
        """Take one block of columns."""
        batch = self._arrow.record_batch(block)
        self._waiting.append(batch.cast(self._schema(batch.schema)))
        self._rows += batch.num_rows
        self.messages += batch.num_rows
        if self._rows >= _ROW_GROUP:
            self._flush()

    def _schema(self, schema: Any) -> Any:  # noqa: ANN401
        """Give each column its unit, where any reader finds it."""
        fields = [
            field.with_metadata({"unit": self._units[field.name]})
            if field.name in self._units
            else field
            for field in schema
        ]
        return self._arrow.schema(fields)

    def _flush(self) -> None:
        if self._waiting:
            table = self._arrow.Table.from_batches(self._waiting)
            if self._writer is None:
                self._writer = self._open(table.schema)
            self._writer.write_table(table)
            self._waiting, self._rows = [], 0


def _to_parquet(log: Log, topic: str, path: Path, span: Span) -> int:
    parquet = library("pyarrow.parquet", "export to Parquet")
    return _through_arrow(
        log, topic, span, lambda schema: parquet.ParquetWriter(path, schema, compression="zstd")
    )


def _to_csv(log: Log, topic: str, path: Path, span: Span) -> int:
    csv = library("pyarrow.csv", "export to CSV")
    return _through_arrow(
        log, topic, span, lambda schema: csv.CSVWriter(path, schema), as_text=True
    )


def _through_arrow(
    log: Log,
    topic: str,
    span: Span,
    open_writer: Callable[[Any], Any],
    *,
    as_text: bool = False,
) -> int:
    """Write a topic; an empty one leaves a file without rows."""
    with _Batches(open_writer, column_units(log, topic)) as batches:
        for block in columns(log, topic, span):
            batches.add(_printable(block) if as_text else block)
        return batches.messages


def _printable(block: dict[str, Any]) -> dict[str, Any]:
    """Bytes as hexadecimal digits."""
    return {
        name: [v.hex() if isinstance(v, bytes) else v for v in values]
        if isinstance(values, list)
        else values
        for name, values in block.items()
    }


def _to_mf4(log: Log, out: Path, topics: list[str], span: Span) -> list[Exported]:
    """One measurement file with a channel group a topic; text and frames have no place in it."""
    mdf = library("asammdf", "export to MF4")
    path = out if out.suffix == ".mf4" else out.with_name(f"{out.name}.mf4")
    path.parent.mkdir(parents=True, exist_ok=True)
    written = 0
    with mdf.MDF(version="4.10") as file:
        for topic in topics:
            if not log.topics[topic].layout.variable:
                written += _add_group(mdf, file, log, topic, span)
        file.save(path, overwrite=True)
    return [Exported(path, written)]


def _add_group(mdf: Any, file: Any, log: Log, topic: str, span: Span) -> int:  # noqa: ANN401
    units = column_units(log, topic)
    group, rows = None, 0
    for block in _wide_blocks(log, topic, span):
        t_s = block["t_ns"] * 1e-9
        rows += len(t_s)
        if group is None:
            group = len(file.groups)
            signals = [
                mdf.Signal(values, t_s, unit=units.get(name, ""), name=f"{topic[1:]}.{name}")
                for name, values in block.items()
            ]
            file.append(signals, acq_name=topic, common_timebase=True)
        else:
            file.extend(group, [(t_s, None), *((values, None) for values in block.values())])
    return rows


def _wide_blocks(log: Log, topic: str, span: Span) -> Iterator[dict[str, Any]]:
    """Join the blocks of a few hundred rows that a chunk gives."""
    waiting: list[dict[str, Any]] = []
    rows = 0
    for block in columns(log, topic, span):
        waiting.append(block)
        rows += len(block["t_ns"])
        if rows >= _ROW_GROUP:
            yield _joined(waiting)
            waiting, rows = [], 0
    if waiting:
        yield _joined(waiting)


def _joined(blocks: list[dict[str, Any]]) -> dict[str, Any]:
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
