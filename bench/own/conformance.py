"""A law or an engine of one's own put through its paces: what the loops rely on, tried and told.

hil check law ./my_law.py
hil check engine ./my_engine.py
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from bench.own.energy import energy_findings
from bench.own.watching import Finding, findings_of, scenarios, tell
from controller.motion.fuelling import Fuelling
from controller.motion.law import NO_DEMAND
from controller.motion.own import own_source
from plant.engines.own.physics import OwnState, source_of


def law_findings(file: Path) -> list[Finding]:
    """Run a law through scenarios, twice, and say what it does of what is demanded.

    Raises: ConfigError when it cannot be loaded
    """
    cases = scenarios("controller.name", file)
    source = own_source(cases[0].controller)
    assert source is not None, "a file was given"
    return findings_of(source[0], ("step",), _held_of_law, cases)


def engine_findings(file: Path) -> list[Finding]:
    """Run an engine through scenarios, twice, and say what it does of what is demanded.

    Raises: ConfigError when it cannot be loaded, RunError when it fails by itself
    """
    cases = scenarios("plant.model", file)
    kind = source_of(cases[0].plant)[0]
    methods = ("advance", "turn", "light", "sensed")
    found = findings_of(kind, methods, OwnState, cases)
    return found + (energy_findings(cases[0]) if found[0].met else [])


def _held_of_law(state: Any) -> Fuelling:  # noqa: ANN401
    return Fuelling("own", state, NO_DEMAND, (0.0, 0.0))


def run(what: str, file: Path) -> int:
    """Say what a law or an engine does of what is demanded; 0 when all of it.

    Raises: ConfigError when it cannot be loaded
    """
    return tell(law_findings(file) if what == "law" else engine_findings(file))
