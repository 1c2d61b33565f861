"""report.html: one file that needs nothing else, for people."""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from typing import Any

from bench.judge.figures import RunData
from bench.judge.summary import Summary
from bench.judge.verdict import VERDICTS
from bench.report import cylinders, plots_control, plots_motion, plots_own
from bench.report.curves.traces import Traces, read_traces
from bench.report.page import TILES, Tile, small_tile, table
from bench.run.directory import RunFiles
from bench.web.page import Page, controls
from bench.web.plot import TIME, Plot
from hil.files import Output

_MAX_EVENTS = 300


def write_report(data: RunData, summary: Summary, files: RunFiles) -> None:
    """Draw and write the report of a run.

    Raises: MissingExtraError when the plotting library is not installed
    """
    Output("report", files.report, force=True).write(document(data, summary, files))


def document(data: RunData, summary: Summary, files: RunFiles, extra: str = "") -> str:
    """Return the report as one page.

    Parameters: extra : a script that the page runs after its own

    Raises: MissingExtraError when the plotting library is not installed
    """
    traces = read_traces(data, files)
    page = Page(summary["scenario"])
    body = [
        _head(summary),
        _fault(summary),
        _tiles(summary),
        _expectations(summary),
        '<section class="pictures">',
        controls(TIME, plots_motion.marks_of(data)),
        *_plots(page, data, traces, plots_own.told(data, traces, files)),
        "</section>",
        cylinders.section(page, data.scenario, files),
        _events(data),
        _all_figures(summary),
        _configuration(data, summary),
    ]
    return page.html("".join(body), extra)


def save_picture(data: RunData, files: RunFiles, file: Output) -> None:
    """Write the overview alone as an SVG file, as the documentation shows it.

    Raises: MissingExtraError when matplotlib is not installed
    """
    from bench.report.picture import overview
    from bench.report.style import style, svg

    with style():
        text = svg(overview(data, read_traces(data, files)), transparent=False)
    file.write(text)


def _plots(page: Page, data: RunData, traces: Traces, own: Sequence[Plot]) -> list[str]:
    """Every plot that the run has something to show in, laid out in rows."""
    rows: list[Sequence[Plot | None]] = [
        [plots_motion.position(data, traces)],
        [plots_motion.dead_centres(data)],
        [plots_motion.tdc_error(data)],
        [plots_motion.phase(data, traces), plots_motion.fuel(data, traces)],
        *([plot] for plot in (*plots_control.loops(data, traces), *own)),
        [plots_motion.pressures(data, traces)],
        *([plot] for plot in plots_motion.machine(data, traces)),
    ]
    if traces.lateness:
        over_time = plots_control.lateness_over_time(data, traces)
        rows.append([plots_control.lateness_histogram(data), over_time])
    return [page.row(row) for row in rows]


def _head(summary: Summary) -> str:
    """Name, what was run, and the verdict."""
    name = html.escape(summary["scenario"])
    run = summary["run"]
    facts = [run["model"], run["prototype"].upper(), run["controller"], run["link"], run["clock"]]
    facts += [f"{run['rate_hz']} Hz", f"{run['duration_s']:g} s", f"seed {run['seed']}"]
    verdict = summary["verdict"]
    badge = f'<span class="badge {verdict.replace(" ", "-")}">{VERDICTS[verdict]}</span>'
    return (
        f"<header><div><h1>{name}</h1><p>{html.escape(summary['description'])}</p>"
        f'<p class="facts">{html.escape(" · ".join(map(str, facts)))}</p></div>{badge}</header>'
    )


def _fault(summary: Summary) -> str:
    """Why there is no verdict, or why the run went to its safe state."""
    told = summary["cause"] or ""
    if summary["verdict"] in {"fault", "blocked"}:
        told = summary["exit_reason"]
    elif told not in summary["exit_reason"]:
        told = ""
    return f'<p class="fault">{html.escape(told)}</p>' if told else ""


def _tiles(summary: Summary) -> str:
    """The figures that one looks for first."""
    cells = []
    for tile in TILES:
        text = _tile(tile, summary)
        if text:
            cells.append(text)
    return f'<section class="tiles">{"".join(cells)}</section>'


def _tile(tile: Tile, summary: Summary) -> str:
    figures = summary["figures"]
    value = figures.get(tile.key)
    if value is None:
        return ""
    shown = tile.format.format(value * tile.factor)
    extra = figures.get(tile.extra_key) if tile.extra_key else None
    more = "" if extra is None else tile.extra.format(extra)
    return small_tile(tile.title, shown, tile.unit, more)


def _expectations(summary: Summary) -> str:
    checks = summary["expectations"]
    if not checks:
        return ""
    items = "".join(
        f'<li class="{"yes" if check["met"] else "no"}"><b>{html.escape(check["name"])}</b> '
        f"{html.escape(check['text'])}</li>"
        for check in checks
    )
    return f'<section class="checks"><ul>{items}</ul></section>'


def _events(data: RunData) -> str:
    lines = data.happenings.lines
    rows = [
        (f"{line.t_ns * 1e-9:.6f}", line.source, line.severity, line.code, line.text)
        for line in lines[:_MAX_EVENTS]
    ]
    left_out = data.happenings.left_out + max(len(lines) - _MAX_EVENTS, 0)
    title = "Events" if not left_out else f"Events (the first ones; {left_out} more in the logs)"
    if not rows:
        return "<section><h2>Events</h2><p>None were logged.</p></section>"
    return table(title, ("t [s]", "process", "severity", "code", "what"), rows, "events")


def _all_figures(summary: Summary) -> str:
    rows = [(key, _number(value)) for key, value in summary["figures"].items()]
    every = table("Every figure", ("key in summary.json", "value"), rows, "figures")
    return f"<details><summary>Every figure</summary>{every}</details>"


def _number(value: Any) -> str:  # noqa: ANN401
    if value is None:
        return "–"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _configuration(data: RunData, summary: Summary) -> str:
    """The whole configuration, how the processes ran, and the versions."""
    parts = {
        "Configuration": data.scenario.model_dump(mode="json", exclude_none=True),
        "Processes": summary["run"].get("processes", {}),
        "Versions": summary["versions"],
    }
    return "".join(
        f"<details><summary>{title}</summary>"
        f"<pre>{html.escape(json.dumps(content, indent=2, ensure_ascii=False))}</pre></details>"
        for title, content in parts.items()
    )
