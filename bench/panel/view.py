"""`hil view`: the report of a run with its logs behind it, so that a zoom shows every sample."""

from __future__ import annotations

import asyncio
import webbrowser
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

import numpy as np

from bench.judge.figures import read_run
from bench.judge.summary import read_run_facts, summarise
from bench.live.ports import bound
from bench.panel import server
from bench.panel.access import Guard, new_token
from bench.panel.signals import Source, columns, thinned
from bench.panel.viewers import grouped
from bench.report.curves.lines import pulse_lanes, read_pulses
from bench.report.document import document
from bench.run import directory as outdir
from bench.run.directory import RunFiles
from bench.web.columns import TIME_STEP_S, Columns
from bench.web.page import own
from hil import log as logs
from hil.config.resolved import read_resolved
from hil.log import Log, Span

_MOST_POINTS: Final = 8_000
_MOST_PULSES_S: Final = 20.0
_MARGIN_S: Final = 0.05


def run(directory: Path, port: int, *, browser: bool) -> int:
    """Serve the report of a finished run until interrupted; prints the address.

    Raises: ConfigError when it is no run, LogError, MissingExtraError
    """
    server.check_libraries()
    files = outdir.opened(directory)
    data = read_run(read_resolved(files.scenario), files)
    page = document(data, summarise(data, read_run_facts(files)), files, own("view.js"))
    listener, token = bound(port), new_token()
    address = server.address(listener, token)
    print(address, flush=True)
    if browser:
        webbrowser.open(address)
    guarded = Guard(application(page, files), token, listener.getsockname()[1])
    server.run_until_interrupted(guarded, listener)
    return 0


def application(page: str, files: RunFiles) -> Any:  # noqa: ANN401
    """Return the application that serves a report and windows of its logs (ASGI)."""
    from starlette.applications import Starlette
    from starlette.responses import HTMLResponse, JSONResponse, Response
    from starlette.routing import Route

    async def report(_request: Any) -> Response:  # noqa: ANN401
        return HTMLResponse(page)

    async def window(request: Any) -> Response:  # noqa: ANN401
        asked = request.query_params
        try:
            low_s, high_s = float(asked["from"]), float(asked["to"])
        except (KeyError, ValueError):
            return Response("from and to are times [s]\n", 400)
        names = asked.get("signals", "").split(",")
        return JSONResponse(await asyncio.to_thread(window_of, files, names, low_s, high_s))

    return Starlette(routes=[Route("/", report), Route("/window", window)])


def window_of(files: RunFiles, names: Iterable[str], low_s: float, high_s: float) -> dict[str, Any]:
    """Return signals and pulses of a window, as arrays for a page.

    Returns: packed columns; `signals` has the numbers of the columns of times and values by name,
        `lanes` those of openings and closings by line
    """
    low_ns, high_ns = (round(max(t, 0.0) * 1e9) for t in (low_s - _MARGIN_S, high_s + _MARGIN_S))
    span = Span(low_ns, max(high_ns, low_ns))
    packed, found = Columns(), dict[str, tuple[int, int]]()
    lanes: dict[str, tuple[int, int]] = {}
    with logs.open(files.plant_log) as plant, logs.open(files.controller_log) as controller:
        for key, members in grouped(names).items():
            log = plant if key.startswith("plant.") else controller
            for name, source in members:
                t_s, y = _read(log, key, source, span)
                found[name] = packed.add(t_s, TIME_STEP_S), packed.add(y)
        if high_s - low_s <= _MOST_PULSES_S and "/actuator" in plant.topics:
            for lane in pulse_lanes(read_pulses(plant, [(span.start_ns, span.end_ns)])):
                ends = packed.add(lane.start, TIME_STEP_S), packed.add(lane.end, TIME_STEP_S)
                lanes[lane.label] = ends
    return {**packed.packed(), "signals": found, "lanes": lanes}


def _read(log: Log, key: str, source: Source, span: Span) -> Any:  # noqa: ANN401
    """Times and values of one signal, its extremes where there are too many."""
    topic = f"/{key.partition('.')[2].replace('.', '/')}"
    if topic not in log.topics:
        return np.empty((2, 0))
    parts = [columns(block, [source]) for block in log.blocks(topic, span)]
    whole = np.concatenate(parts, axis=1) if parts else np.empty((2, 0))
    inside = (whole[0] >= span.start_ns * 1e-9) & (whole[0] <= span.end_ns * 1e-9)
    return thinned(whole[:, inside], _MOST_POINTS)
