"""Names that a user chooses among, for a command line without time to read the configuration."""

from __future__ import annotations

from typing import Literal

ClockName = Literal["lockstep", "realtime"]
LinkName = Literal["zenoh", "can", "memory", "shm"]
