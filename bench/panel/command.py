"""`hil panel`: which engine, which port, one line with the address."""

from __future__ import annotations

import webbrowser
from pathlib import Path

from bench.live.engines import engine_of
from bench.live.ports import bound
from bench.panel import server
from bench.panel.access import new_token
from bench.panel.session import Subject
from bench.run.directory import RunFiles
from hil.config.resolved import read_resolved
from hil.errors import ConfigError


def subject_of(run: Path | None) -> Subject:
    """Return the engine of a run, by its directory or a scenario's file; None: the one that runs.

    Raises: ConfigError when there is none, or several run; LinkError when none does
    """
    where = Path(engine_of(None).where) if run is None else run
    if where.is_file():
        return Subject(read_resolved(where), None)
    files = RunFiles(where)
    if not files.scenario.is_file():
        raise ConfigError(f"{where}: no run: scenario.json is missing; --run takes its file, too")
    return Subject(read_resolved(files.scenario), files)


def run(directory: Path | None, port: int, *, browser: bool) -> int:
    """Serve the panel of a run until interrupted; prints the address.

    Raises: ConfigError, LinkError
    """
    server.check_libraries()
    subject = subject_of(directory)
    listener, token = bound(port), new_token()
    address = server.address(listener, token)
    print(address, flush=True)
    if browser:
        webbrowser.open(address)
    server.serve(subject, listener, token)
    return 0
