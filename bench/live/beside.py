"""A server beside a run: a process of its own, which says in one line where it can be reached."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from hil.errors import ConfigError

_END_S: Final = 5.0


@contextlib.contextmanager
def beside(arguments: Sequence[str], directory: Path, port: int | None) -> Iterator[None]:
    """Have a command of `hil` serve a run while the body runs; nothing without a port.

    Its one line, the address, goes where this process prints.

    Raises: ConfigError when it does not begin
    """
    if port is None:
        yield
        return
    command = [*arguments, "--run", str(directory), "--port", str(port)]
    child = subprocess.Popen(
        [sys.executable, "-P", "-m", "bench.cli", *command],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip
    assert child.stdout is not None
    assert child.stderr is not None
    try:
        address = child.stdout.readline().strip()
        if not address:
            raise ConfigError(child.stderr.read().strip() or f"{arguments[0]} did not begin")
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
