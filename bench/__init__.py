"""The `hil` command: scenarios, orchestration, figures, reports."""

import hil as _hil  # noqa: F401 (compiled modules must be found from the first import on)
