"""The `hil` command: scenarios, orchestration, figures, reports."""

from bench import interrupt as _interrupt
from bench import streams as _streams

_streams.reopen()
_interrupt.guard()  # before anything that takes its time

import hil as _hil  # noqa: E402, F401 (compiled modules must be found from the first import on)
