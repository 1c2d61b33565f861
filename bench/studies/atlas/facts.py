"""What the thesis prints: one fact a number or testable statement, read from facts.csv.

The numbers with their conditions are the thesis's; which of them contradict each other stands in
`confidence`, the reason in `note`.
"""

from __future__ import annotations

import csv
import re
from functools import lru_cache
from pathlib import Path
from typing import Final, NamedTuple

FILE: Final = Path(__file__).with_name("facts.csv")
_GROUP: Final = re.compile(r"(?:A\d-)?[TFES]\d[\d.]*|A\d")
_CHAPTERS: Final = {"A1": "Appendix I", "A2": "Appendix II"}
SI: Final = {
    "": 1.0, "-": 1.0, "%": 1e-2, "mm": 1e-3, "mm/s": 1e-3, "mm/s2": 1e-3, "mm/s3": 1e-3,
    "cc": 1e-6, "l": 1e-3, "mg": 1e-6, "ms": 1e-3, "bar": 1e5, "kN": 1e3, "kV": 1e3, "kW": 1e3,
    "cycles/min": 1.0 / 60.0, "rpm": 1.0 / 60.0,
}  # fmt: skip
"""One printed unit in ours; a unit that is not named here is ours already."""


class Fact(NamedTuple):
    """A printed number or statement.

    kind: input (a setting), result (what a model, a rig or a run gave), claim (a statement)
    value: in the printed unit; None for a claim
    confidence: high, doubtful, or the facts that this one contradicts
    """

    id: str
    where: str
    kind: str
    model: str
    quantity: str
    value: float | None
    unit: str
    conditions: str
    how_read: str
    confidence: str
    note: str

    @property
    def group(self) -> str:
        """The figure, table, equation or section: T4.3, A1-F10, S5.2; A1 for running text."""
        found = _GROUP.match(self.id)
        assert found is not None
        return found[0]

    @property
    def chapter(self) -> str:
        """4 for T4.3, A1 for A1-F10."""
        return chapter_of(self.group)

    @property
    def contradicts(self) -> str:
        """The facts that cannot hold together with this one, as the table of facts names them."""
        prefix = "contradicts "
        return self.confidence.removeprefix(prefix) if prefix in self.confidence else ""


def chapter_of(group: str) -> str:
    """Return the chapter of a group: 4 of T4.3, A1 of A1-F10."""
    return group[:2] if group[:2] in _CHAPTERS else group[1]


def chapter_title(chapter: str) -> str:
    """Return how a chapter is called."""
    return _CHAPTERS.get(chapter, f"Chapter {chapter}")


@lru_cache(maxsize=1)
def facts() -> tuple[Fact, ...]:
    """Every fact, in the order of the thesis."""
    with FILE.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return tuple(_fact(row) for row in rows)


def _fact(row: dict[str, str]) -> Fact:
    value = float(row["value"]) if row["value"] else None
    return Fact(**{**row, "value": value})  # type: ignore[arg-type]


def printed(fact_id: str) -> float:
    """Return the printed number of a fact, in its printed unit."""
    for fact in facts():
        if fact.id == fact_id and fact.value is not None:
            return fact.value
    raise KeyError(fact_id)


def in_unit(fact: Fact, value: float) -> float:
    """Return a value of ours, in SI, in the printed unit of a fact."""
    return value / SI.get(fact.unit, 1.0)
