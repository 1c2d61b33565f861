"""What an entry of the atlas is: which facts it answers, by what command, and what it draws."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fnmatch import fnmatchcase
from typing import NamedTuple

from bench.studies.atlas.facts import Fact, facts
from bench.web.chart import Chart


class Finding(NamedTuple):
    """What ours gives for one fact.

    ours: in the printed unit; of a claim whether it holds; None where our engine gives nothing
    told: what was measured of a claim, and anything else that the number needs to be understood
    """

    ours: float | bool | None
    told: str = ""


class Found(NamedTuple):
    """What an entry comes to: findings by fact, and what is drawn."""

    findings: Mapping[str, Finding]
    charts: tuple[Chart, ...] = ()


class Entry(NamedTuple):
    """A figure or table that is made again.

    answers: patterns of the facts that it has something to say about
    work: with a flag that asks for the short form
    command: what makes it again by itself, where that is not `hil atlas ID`
    weight: about how many seconds it takes: the heavy ones begin first
    """

    id: str
    title: str
    answers: tuple[str, ...]
    work: Callable[[bool], Found]
    command: str = ""
    weight: float = 1.0

    @property
    def told_command(self) -> str:
        """The command that makes it again."""
        return self.command or f"hil atlas {self.id}"

    @property
    def facts(self) -> tuple[Fact, ...]:
        """The facts that it answers."""
        return tuple(f for f in facts() if any(fnmatchcase(f.id, p) for p in self.answers))
