"""`hil run A B C`: many scenarios one after the other, one verdict each, one exit code."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console

from bench import streams
from bench.api.runs import carry_out
from bench.judge.verdict import VERDICTS
from bench.run import directory as outdir
from bench.run.commands import RunOptions, check_report
from bench.run.resolve import resolve
from bench.run.scenarios import Found, read_cases
from bench.suite import outputs
from bench.suite.result import Result, exit_code, result_of
from hil.config.scenario import Scenario
from hil.errors import ConfigError, InterruptedRunError
from hil.files import Output

Changes = list[tuple[str, Any]]
_COLOURS = dict.fromkeys(VERDICTS, "red") | {"met": "green", "none": "yellow"}


class SuiteOptions(NamedTuple):
    """The options of `hil run` that are for suites; `out` is a directory of directories."""

    out: Path | None
    report: bool
    force: bool
    junit: Path | None = None
    as_json: bool = False


def of(options: RunOptions, junit: Path | None, *, as_json: bool) -> SuiteOptions:
    """Return the options of a suite.

    Raises: ConfigError for one that is of a single run
    """
    single = {"can-log": options.can_log, "panel": options.panel, "foxglove": options.foxglove}
    for name, value in single.items():
        if value is not None:
            raise ConfigError(f"--{name}: accepted with one scenario only")
    return SuiteOptions(options.out, options.report, options.force, junit, as_json)


def is_suite(names: Sequence[str], *, junit: Path | None, as_json: bool) -> bool:
    """Whether these names stand for more than one scenario, or are to be told as a suite.

    Raises: ConfigError when there is no such scenario
    """
    if len(names) > 1 or junit is not None or as_json:
        return True
    return len(read_cases(names[0])) > 1


def run(names: Sequence[str], changes: Changes, options: SuiteOptions) -> int:
    """Run every case of every name; write what was asked for; return the exit code of all.

    Raises: ConfigError before the first run when one of them cannot be read or written
    """
    check_report(wanted=options.report)
    found = [one for name in names for one in read_cases(name)]
    scenarios = [one.scenario(changes) for one in found]
    for scenario in scenarios:
        resolve(scenario)
    directory = options.out or outdir.fresh("suite")
    files = _outputs(directory, options)
    console = Console(highlight=False, quiet=options.as_json)
    streams.outlive()
    results: list[Result] = []
    try:
        for one, scenario, place in zip(found, scenarios, _places(directory, found), strict=True):
            results.append(_run_one(one, scenario, place, options))
            _tell(console, results[-1], len(results), len(found))
    finally:
        if results:
            _write(files, results)
    if options.as_json:
        print(outputs.json_text(results), end="")
    console.print(f"{_counted(results)}; {files['page'].path}", soft_wrap=True, markup=False)
    return exit_code(results)


def _outputs(directory: Path, options: SuiteOptions) -> dict[str, Output]:
    """Check all files that are to be written, before the work.

    Raises: ConfigError naming the option
    """
    outdir.make_directory("--out", directory)
    files = {"page": Output("--out", directory / "suite.html", options.force)}
    if options.junit is not None:
        files["junit"] = Output("--junit", options.junit, options.force)
    files["json"] = Output("--out", directory / "suite.json", options.force)
    for file in files.values():
        file.check()
    return files


def _places(directory: Path, found: Iterable[Found]) -> list[Path]:
    """A directory a case, by its name; two of one name are told apart."""
    places: list[Path] = []
    for one in found:
        name = "-".join(filter(None, (Path(one.label.partition("::")[0]).stem, one.case.name)))
        place, number = directory / name.replace("/", "_"), 2
        while place in places:
            place, number = directory / f"{name}-{number}", number + 1
        places.append(place)
    return places


def _run_one(found: Found, scenario: Scenario, place: Path, options: SuiteOptions) -> Result:
    """Run one case, in this process where that can be.

    Raises: InterruptedRunError
    """
    begin_s = time.monotonic()
    files = outdir.prepare(scenario.name, place, force=options.force)
    done = carry_out(scenario, files, report=options.report)
    if isinstance(done.ended.error, InterruptedRunError):
        raise done.ended.error
    return result_of(found.label, done.summary, place, time.monotonic() - begin_s)


def _tell(console: Console, result: Result, number: int, count: int) -> None:
    from rich.text import Text

    line = Text.assemble(
        (f"{number}/{count} ", "dim"), (f"{result.label} ", "bold"),
        (result.verdict, _COLOURS[result.verdict]), (f"  {result.wall_s:.1f} s", "dim"),
    )  # fmt: skip
    console.print(line, soft_wrap=True)
    for check in result.expectations:
        if not check["met"]:
            console.print(Text(f"    {check['name']}: {check['text']}"), soft_wrap=True)
    if result.verdict in ("fault", "blocked"):
        console.print(Text(f"    {result.reason}"), soft_wrap=True)


def _counted(results: Sequence[Result]) -> str:
    counts = {v: sum(r.verdict == v for r in results) for v in ("met", *VERDICTS)}
    return ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)


def _write(files: dict[str, Output], results: Sequence[Result]) -> None:
    from bench.suite.junit import document

    texts = {
        "page": lambda: outputs.html_page(results, files["page"].path),
        "json": lambda: outputs.json_text(results),
        "junit": lambda: document(results),
    }
    for name, file in files.items():
        file.write(texts[name]())
