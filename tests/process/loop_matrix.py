"""Every scenario, model with every law, prototype and kind of event, each as one run in memory.

python loop_matrix.py DIRECTORY    prints {name of the run: what its logs held, or why none began}
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from hashlib import blake2b
from itertools import product
from pathlib import Path
from typing import Any

import hil.log
from bench.dev import golden
from bench.fmu import export
from bench.run import scenarios
from bench.run.resolve import resolve
from controller.motion.laws import LAWS
from hil import compiled
from hil.config.engine.models import OWN_MODELS
from hil.config.prototypes import PROTOTYPES
from hil.errors import HilError
from hil.wire.commands import BY_KIND

MODELS = OWN_MODELS
EVENTS = {
    "load-scale": {"value": 0.9},
    "efficiency": {"low": 0.95},
    "misfire": {"count": 1},
    "pre-ignition": {"at_stroke_fraction": 0.9},
    "sensor-fault": {"signal": "x", "duration_s": 0.004, "substitute": "offset", "value": 0.001},
    "start": {},
    "stop": {},
    "set-point": {"tdc_ref_m": 0.0152},
    "law": {"law": "predictive"},
    "emergency-stop": {},
    "mark": {"text": "here"},
}
"""One of every kind of event, the plant's and the operator's."""

_NEEDS = {"pre-ignition": [("plant.ignition.work", "map")]}
"""What else there has to be for an event of a kind."""

_LOCKSTEP = [("link.kind", "memory"), ("loop.clock", "lockstep")]
_SHORT = [("run.duration_s", 0.5)]
_STEP = [*_SHORT, ("events.load.at_s", 0.2)]


Changes = list[tuple[str, Any]]


def runs(directory: Path) -> dict[str, tuple[str, Changes]]:
    """Return every run of the matrix: its scenario, by name or path, and what is changed in it."""
    whole = {path.stem: (path.stem, []) for path in scenarios.packaged()}
    engines = {name: ("load-decrease", [*changes, *_STEP]) for name, changes in _engines(directory)}
    return {**whole, **engines, **dict(_with_event(directory))}


def _engines(directory: Path) -> Iterator[tuple[str, Changes]]:
    """Every model under every law, every prototype, and units of both versions."""
    for model, law in product(MODELS, LAWS):
        yield f"{model}, {law}", [("plant.model", model), ("controller.name", law)]
    for prototype, model in product(PROTOTYPES, ("harmonic", "two-stroke", "four-stroke")):
        changes = [("plant.prototype", prototype), ("plant.model", model)]
        yield f"{prototype}, {model}", changes
    for version in (2, 3):
        unit = export.export(directory / f"{version}.fmu", "nonlinear", "nu", version).path
        yield f"FMI {version}", [("plant.model", f"fmu:{unit}")]


def _with_event(directory: Path) -> Iterator[tuple[str, tuple[str, Changes]]]:
    """Every kind of event, at the very start and later."""
    for (kind, fields), at_s in product(EVENTS.items(), (0.0, 0.2)):
        path = directory / f"{kind}-{at_s:g}.toml"
        event = {"kind": kind, "at_s": at_s, **fields}
        lines = [f"{key} = {json.dumps(value)}\n" for key, value in event.items()]
        path.write_text(f"[events.this]\n{''.join(lines)}")
        yield f"{kind} at {at_s:g} s", (str(path), [*_SHORT, *_NEEDS.get(kind, [])])


def outcome(scenario: str, changes: Changes, out: Path) -> str:
    """Run it, and return a digest of all its records; or the line that refused it."""
    out.mkdir(parents=True)
    try:
        golden.record(resolve(scenarios.read(scenario, [*changes, *_LOCKSTEP])), out)
    except HilError as error:
        return f"{type(error).__name__}: {error}"
    total = blake2b(digest_size=10)
    for process in golden.PROCESSES:
        with hil.log.open(out / f"{process}.mcap") as log:
            total.update(b"".join(log.raw()))
    return total.hexdigest()


def main(directory: Path) -> None:
    """Run them all; a traceback is for whoever started this."""
    directory.mkdir(parents=True)
    told: dict[str, bool | str] = {"compiled": compiled.in_force()}
    for place, (name, (scenario, changes)) in enumerate(runs(directory).items()):
        told[name] = outcome(scenario, changes, directory / str(place))
    print(json.dumps(told, indent=1))


if __name__ == "__main__":
    assert set(EVENTS) == set(BY_KIND)
    main(Path(sys.argv[1]))
