"""`hil panel`, and the panel beside a run: which engine, which port, one line with the address."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import webbrowser
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from bench.live.engines import engine_of
from bench.panel import server
from bench.panel.access import new_token
from bench.panel.session import Subject
from bench.run.directory import RunFiles
from hil.config.resolved import read_resolved
from hil.errors import ConfigError

_END_S: Final = 5.0


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
    listener, token = server.bound(port), new_token()
    address = server.address(listener, token)
    print(address, flush=True)
    if browser:
        webbrowser.open(address)
    server.serve(subject, listener, token)
    return 0


@contextlib.contextmanager
def beside(directory: Path, port: int | None) -> Iterator[None]:
    """Have the panel of a run served by a process of its own while the body runs.

    Its one line, the address, goes where this process prints. Nothing is served without a port.

    Raises: ConfigError when it does not begin
    """
    if port is None:
        yield
        return
    arguments = ["panel", "--run", str(directory), "--port", str(port), "--no-browser"]
    child = subprocess.Popen(
        [sys.executable, "-P", "-m", "bench.cli", *arguments],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip
    assert child.stdout is not None
    assert child.stderr is not None
    try:
        address = child.stdout.readline().strip()
        if not address:
            raise ConfigError(child.stderr.read().strip() or "the panel did not begin")
        print(address, flush=True)
        yield
    finally:
        child.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            child.wait(_END_S)
        if child.poll() is None:
            child.kill()
        child.stdout.close()
        child.stderr.close()
