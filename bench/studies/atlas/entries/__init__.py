"""The entries by chapter: each module has those of its own, in `ENTRIES`."""

from __future__ import annotations

from bench.studies.atlas.entries import (
    advantages,
    beijing,
    control,
    cycles,
    disturbances,
    gas,
    linear,
    literature,
    machines,
    motoring,
    part_load,
    sensitivity,
    starting,
    validation,
)
from bench.studies.atlas.entry import Entry

_MODULES = (
    literature,
    gas,
    machines,
    validation,
    motoring,
    cycles,
    advantages,
    part_load,
    linear,
    disturbances,
    sensitivity,
    control,
    starting,
    beijing,
)

ENTRIES: dict[str, Entry] = {entry.id: entry for module in _MODULES for entry in module.ENTRIES}
"""All of them by id, in the order of the thesis."""
