"""A run of two processes beside a test, steered and looked at while it goes on.

python -m bench.suite.background ASKED.json DIRECTORY      the run itself, until it is asked to end
"""

from __future__ import annotations

import contextlib
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from bench.live.steer import joined, set_parameters
from bench.run.checks.signals import source_of
from bench.run.directory import RunFiles
from bench.run.execution import execute, resolved
from bench.run.progress import Silent
from drivers.recorder.tap import Tap
from drivers.zenoh.sockets import Side, records_socket
from hil import compiled
from hil.config.load import read_scenario
from hil.config.resolved import read_resolved
from hil.config.scenario import Scenario
from hil.errors import ConfigError, LinkError, RunError
from hil.files import Output
from hil.wire.answers import CommandAnswer

_READY_S: Final = 20.0
_ENDED_S: Final = 15.0
_ANSWER_S: Final = 5.0
_LOOK_S: Final = 0.002
_SIDES: Final[tuple[Side, ...]] = ("plant", "controller")


class Background:
    """Both processes of a scenario in real time, and what their logs say as it is written."""

    def __init__(self, scenario: Scenario, directory: Path) -> None:
        self.t_s = 0.0
        self._rows: dict[tuple[str, str], Any] = {}
        self._taps: dict[Side, Tap] = {}
        self._stack = contextlib.ExitStack()
        asked = directory / "asked.json"
        Output("--out", asked, force=True).write(scenario.model_dump_json())
        module = ["-P", "-m", "bench.suite.background", str(asked), str(directory)]
        self._process = subprocess.Popen(
            [sys.executable, *module],
            env={**os.environ, "PYTHONPATH": str(compiled.root())},
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        self._stack.callback(self._end)
        with contextlib.ExitStack() as opening:
            opening.push(self._stack)
            self._join(RunFiles(directory))
            opening.pop_all()

    def _join(self, files: RunFiles) -> None:
        """Wait until both processes record, and take part.

        Raises: RunError when they do not, with what the run has said
        """
        end_s = time.monotonic() + _READY_S
        while True:
            try:
                config = read_resolved(files.scenario).link.zenoh
                for side in _SIDES:
                    if side not in self._taps:  # one may record before the other does
                        self._taps[side] = self._opened(Tap.join(records_socket(config, side)))
                break
            except (ConfigError, LinkError, OSError) as error:
                self._raise_if_ended()
                if time.monotonic() > end_s:
                    raise RunError(f"the run did not begin: {error}") from None
                time.sleep(_LOOK_S)
        self._operator = joined(files.directory, _SIDES)
        self._stack.callback(self._operator.close)
        while not self.t_s:
            self.step()

    def _opened(self, tap: Tap) -> Tap:
        self._stack.callback(tap.close)
        return tap

    def value(self, signal_name: str) -> float:
        """Return the newest value of a signal; nan while there is none.

        Raises: ConfigError when there is no such signal
        """
        source = source_of(signal_name)
        row = self._rows.get((source.side, source.topic))
        if row is None:
            return math.nan
        value = row[source.field]
        return float(value if source.item is None else value[source.item])

    def step(self) -> None:
        """Wait until something new is recorded.

        Raises: RunError when the run has ended
        """
        before_s, end_s = self.t_s, time.monotonic() + _ANSWER_S
        while self.t_s == before_s:
            self._raise_if_ended()
            if time.monotonic() > end_s:
                raise RunError(f"nothing was recorded for {_ANSWER_S:g} s")
            time.sleep(_LOOK_S)
            for side, tap in self._taps.items():
                for topic, rows in tap.rows(tap.read()).items():
                    if len(rows):
                        self._rows[side, topic] = rows[-1]
            if (truth := self._rows.get(("plant", "/truth"))) is not None:
                self.t_s = int(truth["t_ns"]) * 1e-9

    def order(self, command: Mapping[str, object], to: str) -> None:
        """Send a command, and wait for what becomes of it.

        Raises: ConfigError when it is refused, LinkError without an answer
        """
        self._refuse(self._operator.ask_all(command, (to,), _ANSWER_S))

    def set(self, values: Mapping[str, object]) -> None:
        """Change parameters in one transaction.

        Raises: ConfigError when they are refused, LinkError without an answer
        """
        self._refuse(set_parameters(self._operator, values, _ANSWER_S))

    @staticmethod
    def _refuse(answers: Sequence[CommandAnswer]) -> None:
        for answer in answers:
            if not answer.taken:
                raise ConfigError(answer.text)

    def close(self) -> None:
        """End both processes in order, their logs finished."""
        self._stack.close()

    def _end(self) -> None:
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM)
        try:
            self._process.communicate(timeout=_ENDED_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()

    def _raise_if_ended(self) -> None:
        if self._process.poll() is not None:
            said = self._process.stderr.read().strip() if self._process.stderr else ""
            raise RunError(f"the run has ended: {said or self._process.returncode}")


def main(asked: str, directory: str) -> int:
    """Run the scenario of a file into a directory, until it ends or is ended."""
    with resolved(read_scenario(Path(asked))) as scenario:
        ended = execute(scenario, RunFiles(Path(directory)), Silent())
    if ended.error is not None:
        print(ended.error, file=sys.stderr)
    return ended.exit_code


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
