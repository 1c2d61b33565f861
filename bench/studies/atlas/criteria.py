"""How a fact is judged: tolerances and reasons, read from criteria.toml, and the verdict.

No tolerance there is wider than what an independent implementation of the equations reached.
"""

from __future__ import annotations

import math
from fnmatch import fnmatchcase
from functools import lru_cache
from pathlib import Path
from typing import Final, NamedTuple

from bench.studies.atlas.entry import Finding
from bench.studies.atlas.facts import Fact
from hil.toml import Tree, read_toml

FILE: Final = Path(__file__).with_name("criteria.toml")
PASS, DEVIATES, NOT_REPRODUCIBLE = "pass", "deviates", "not reproducible"
VERDICTS: Final = (PASS, DEVIATES, NOT_REPRODUCIBLE)
_EXACT: Final = 1e-9
"""Inputs are figures of a file; that is what a sum of two of them may lose."""
_MEASURES: Final = ("within", "within_absolute", "at_most", "at_least")


class Judged(NamedTuple):
    """A fact with its verdict: one element of atlas.json.

    thesis, ours: numbers in the printed unit; of a claim whether it holds
    deviation, tolerance: a share of the printed number, or its unit where `measure` says absolute;
        a bound has none
    """

    id: str
    kind: str
    quantity: str
    conditions: str
    where: str
    thesis: float | bool
    ours: float | bool | None
    unit: str
    deviation: float | None
    tolerance: float | None
    measure: str
    verdict: str
    command: str
    reason: str


@lru_cache(maxsize=1)
def criteria() -> dict[str, Tree]:
    """The tables of criteria.toml, each from patterns of facts to what is set for them."""
    return read_toml(FILE)


def looked_up(table: str, fact_id: str) -> float | str | None:
    """What a table sets for a fact: the entry whose pattern says most."""
    rows = criteria().get(table, {})
    matching = [pattern for pattern in rows if fnmatchcase(fact_id, pattern)]
    return rows[max(matching, key=len)] if matching else None


def judge(fact: Fact, finding: Finding | None, command: str) -> Judged:
    """Hold what was found against what is printed.

    Parameters: finding : None when nothing of ours can be held against it
    """
    cannot = looked_up("cannot", fact.id)
    if finding is None:
        if cannot is None:
            cannot = "nothing of ours is held against it"
        return _judged(fact, None, None, None, "", NOT_REPRODUCIBLE, "", str(cannot))
    if fact.value is None or isinstance(finding.ours, bool) or finding.ours is None:
        verdict = PASS if finding.ours is True else DEVIATES
        reason = _joined(finding.told, "" if verdict == PASS else _because(fact))
        return _judged(fact, finding.ours, None, None, "holds", verdict, command, reason)
    measure, tolerance = _measure(fact)
    deviation = _deviation(measure, finding.ours, fact.value)
    met = _met(measure, deviation, tolerance)
    shown = None if measure.startswith("at") else tolerance
    reason = _joined(finding.told, "" if met else _because(fact))
    return _judged(fact, finding.ours, deviation, shown, measure, PASS if met else DEVIATES,
                   command, reason)  # fmt: skip


def _measure(fact: Fact) -> tuple[str, float]:
    """By what a number is held against the printed one; an input has to be the same."""
    found = [(m, limit) for m in _MEASURES if (limit := looked_up(m, fact.id)) is not None]
    if not found:
        return ("within", _EXACT)
    measure, limit = found[0]
    return measure, float(limit)


def _deviation(measure: str, ours: float, thesis: float) -> float:
    if measure == "within" and thesis != 0.0:
        return ours / thesis - 1.0
    return ours - thesis


def _met(measure: str, deviation: float, tolerance: float) -> bool:
    if math.isnan(deviation):
        return False
    if measure == "at_most":
        return deviation <= tolerance
    if measure == "at_least":
        return deviation >= -tolerance
    return abs(deviation) <= tolerance


def _because(fact: Fact) -> str:
    told = looked_up("because", fact.id)
    if told is not None:
        return str(told)
    return f"contradicts {fact.contradicts}: {fact.note}" if fact.contradicts else ""


def _joined(*texts: str) -> str:
    return "; ".join(text for text in texts if text)


def _judged(
    fact: Fact, ours: float | bool | None, deviation: float | None, tolerance: float | None,
    measure: str, verdict: str, command: str, reason: str,
) -> Judged:  # fmt: skip
    thesis = True if fact.value is None else fact.value
    return Judged(
        fact.id, fact.kind, fact.quantity, fact.conditions, fact.where, thesis, ours, fact.unit,
        deviation, tolerance, measure, verdict, command, reason,
    )  # fmt: skip
