"""What one scenario of a suite came to, as plain values: for JUnit files, JSON, pages, tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from bench.judge.summary import Summary

FIGURES: Final = (
    "tdc_error_peak_mm", "settling_s", "tdc_sigma_mm", "frequency_final_hz", "misfires",
    "electric_power_mean_w", "contacts", "answered_next_tick_share", "plant_late_p99_us",
)  # fmt: skip
"""Figures of the summary that stand beside a verdict."""

_WORST: Final = ("fault", "not met", "blocked", "none", "met")
"""Verdicts of many runs: the first of these that one has is that of all."""

EXIT_CODES: Final = {"fault": 3, "not met": 1, "blocked": 4, "none": 0, "met": 0}


class Result(NamedTuple):
    """One run of a suite.

    label: NAME, FILE or FILE::CASE; link: over which it was run
    directory: of its logs, "" when they were not kept; report: whether there is a report in it
    requirements: names that its expectations carry, with whether all of them were met
    """

    label: str
    link: str
    verdict: str
    reason: str
    wall_s: float
    directory: str
    report: bool
    expectations: Sequence[Mapping[str, Any]]
    figures: Mapping[str, Any]

    @property
    def requirements(self) -> dict[str, bool]:
        """Every requirement that an expectation names, with whether all that name it were met."""
        found: dict[str, bool] = {}
        for check in self.expectations:
            if name := check["requirement"]:
                found[name] = found.get(name, True) and bool(check["met"])
        return found


def result_of(label: str, summary: Summary, directory: Path | None, wall_s: float) -> Result:
    """Take from a summary what a suite tells of its run."""
    figures = summary["figures"]
    return Result(
        label=label,
        link=str(summary["run"]["link"]),
        verdict=str(summary["verdict"]),
        reason=str(summary["exit_reason"]),
        wall_s=wall_s,
        directory="" if directory is None else str(directory),
        report=directory is not None and (directory / "report.html").is_file(),
        expectations=summary["expectations"],
        figures={key: figures[key] for key in FIGURES if figures.get(key) is not None},
    )


def exit_code(results: Sequence[Result]) -> int:
    """Return the exit code of all of them: a fault, else not met, else blocked, else nought."""
    verdicts = {result.verdict for result in results}
    return EXIT_CODES[next(v for v in _WORST if v in verdicts or v == _WORST[-1])]


def requirements(results: Sequence[Result]) -> dict[str, bool]:
    """Return every requirement of a suite, with whether all runs that carry it met it."""
    found: dict[str, bool] = {}
    for result in results:
        for name, met in result.requirements.items():
            found[name] = found.get(name, True) and met
    return found
