"""`hil export`: a log as Parquet, CSV or MF4, block by block, so that any length will do."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from bench.logs.export_mf4 import to_mf4
from bench.logs.exported import Exported, Outcome, library
from bench.run import directory
from hil.errors import LogError
from hil.files import Output
from hil.log import Log, Span
from hil.log.coding import UndecodableError
from hil.log.records import SCALARS
from hil.log.tables import column_kinds, column_units, columns

_ROW_GROUP = 65_536
_LONGEST_STEM = 120


def export(
    log: Log, kind: str, out: Path, topics: list[str], span: Span, *, force: bool = False
) -> Outcome:
    """Write the topics of a log; a directory with a file each, or one file for MF4.

    A topic that is not decoded is left out and told.

    Raises: LogError for an unknown topic, ConfigError when it cannot be written or nothing can
        be exported, MissingExtraError without the library
    """
    chosen = topics or [name for name, info in log.topics.items() if info.messages]
    for name in chosen:
        log.units(name)  # tells an unknown topic
    inputs = tuple(part.path for part in log.parts)
    target = Output("--out", out, force, inputs)
    if kind == "mf4":
        done = to_mf4(log, target, chosen, span)
    else:
        done = _to_directory(log, kind, target, chosen, span)
    if done.skipped and not done.files:
        raise LogError(f"{log.path}: nothing exported: {'; '.join(done.skipped)}")
    return done


def _to_directory(log: Log, kind: str, target: Output, topics: list[str], span: Span) -> Outcome:
    """Write a file a topic."""
    write: Callable[..., int] = {"parquet": _to_parquet, "csv": _to_csv}[kind]
    if kind == "parquet":
        library("pyarrow", "this export")
    stems = _stems(topics)
    files = {t: target._replace(path=target.path / f"{stems[t]}.{kind}") for t in topics}
    directory.make_directory("--out", target.path)
    for file in files.values():
        file.check()
    done = Outcome([], [])
    for name, file in files.items():
        try:
            if reason := log.topics[name].coding.reason:
                raise UndecodableError(f"{log.path}: {name}: {reason}")
            with file.writing() as beside:
                rows = write(log, name, beside, span)
            done.files.append(Exported(file.path, rows))
        except UndecodableError as error:
            done.skipped.append(str(error).removeprefix(f"{log.path}: "))
    return done


def _stems(topics: list[str]) -> dict[str, str]:
    """Return a file name for each topic, no two the same: frames_sent, frames_sent_2."""
    found: dict[str, str] = {}
    for name in topics:
        plain = re.sub(r"[^\w.-]+", "_", name.strip("/"))[:_LONGEST_STEM].strip(".") or "topic"
        stem, number = plain, 2
        while stem in found.values():
            stem, number = f"{plain}_{number}", number + 1
        found[name] = stem
    return found


class _Batches(AbstractContextManager["_Batches"]):
    """Joins small blocks into row groups of a useful size for a pyarrow writer."""

    def __init__(self, open_writer: Callable[[Any], Any], schema: Any) -> None:  # noqa: ANN401
        self._arrow = library("pyarrow", "this export")
        self._open = open_writer
        self._schema = schema
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
        arrays = [
            self._arrow.array(block[field.name], field.type, from_pandas=False)
            for field in self._schema
        ]
        batch = self._arrow.record_batch(arrays, schema=self._schema)
        self._waiting.append(batch)
        self._rows += batch.num_rows
        self.messages += batch.num_rows
        if self._rows >= _ROW_GROUP:
            self._flush()

    def _flush(self) -> None:
        if self._writer is None:
            self._writer = self._open(self._schema)
        if self._waiting:
            self._writer.write_table(self._arrow.Table.from_batches(self._waiting))
            self._waiting, self._rows = [], 0


def _arrow_type(arrow: Any, kind: str) -> Any:  # noqa: ANN401
    """Return what a column of a ROS type is to Arrow."""
    base = kind.partition("[")[0]
    if kind in SCALARS:
        return arrow.from_numpy_dtype(np.dtype(kind))
    if "/" in base or kind in {"string", "wstring"}:
        return arrow.string()
    if kind == "uint8[]":
        return arrow.binary()
    return arrow.list_(_arrow_type(arrow, base))


def _arrow_schema(log: Log, topic: str) -> Any:  # noqa: ANN401
    """Return the columns of a topic, each with its unit where any reader finds it."""
    arrow, units = library("pyarrow", "this export"), column_units(log, topic)
    return arrow.schema(
        arrow.field(
            name, _arrow_type(arrow, kind),
            metadata={"unit": units[name]} if name in units else None,
        )
        for name, kind in column_kinds(log, topic).items()
    )  # fmt: skip


def _to_parquet(log: Log, topic: str, path: Path, span: Span) -> int:
    parquet = library("pyarrow.parquet", "export to Parquet")
    with _Batches(
        lambda schema: parquet.ParquetWriter(path, schema, compression="zstd"),
        _arrow_schema(log, topic),
    ) as batches:
        for block in columns(log, topic, span):
            batches.add(block)
    return batches.messages


def _to_csv(log: Log, topic: str, path: Path, span: Span) -> int:
    """Write a topic as text, which takes no library; texts stand in quotes."""
    names, rows = list(column_kinds(log, topic)), 0
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, quoting=csv.QUOTE_NONNUMERIC, lineterminator="\n")
        writer.writerow(names)
        for block in columns(log, topic, span):
            found = [_printable(block[name]) for name in names]
            writer.writerows(zip(*found, strict=True))
            rows += len(found[0])
    return rows


def _printable(values: Any) -> list[Any]:  # noqa: ANN401
    """Bytes as hexadecimal digits, lists as JSON, switches as 0 and 1."""
    if isinstance(values, list):
        return [_text_of(value) for value in values]
    numbers: list[Any] = values.tolist()
    return [*map(int, numbers)] if values.dtype == np.bool_ else numbers


def _text_of(value: Any) -> str:  # noqa: ANN401
    if isinstance(value, bytes):
        return value.hex()
    return value if isinstance(value, str) else json.dumps(value)
