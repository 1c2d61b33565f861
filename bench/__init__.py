"""The `hil` command: scenarios, orchestration, figures, reports."""
