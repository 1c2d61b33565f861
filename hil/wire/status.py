"""How plant and controller say that they are, declared once: field, unit, how it is shown.

Each publishes its status as one JSON object ten times a second; what follows from this module are
the JSON and its reader, `hil status`, the progress line and a table in docs/commands.md.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated as A
from typing import Any, Final, NamedTuple, get_args, get_origin, get_type_hints

from hil.wire.quantities import Scalar

MAX_BYTES: Final = 4096
"""No status is longer."""

_MAX_CHARS: Final = 40
_MOST: Final = 1e15


class Shown(NamedTuple):
    """How a figure is shown: its label, and format and unit of its value."""

    label: str
    unit: str = ""
    form: str = ""

    def text(self, value: Scalar) -> str:
        """Return the value as text with its unit."""
        if isinstance(value, bool):
            return "yes" if value else "no"
        return f"{value:{self.form}} {self.unit}".rstrip()


Tick = A[int, Shown("tick")]
RunTimeS = A[float, Shown("time", "s", ".1f")]
TdcMm = A[float | None, Shown("TDC", "mm", ".3f")]
Changes = A[int, Shown("parameter changes")]
Reception = A[Mapping[str, int], Shown("frames")]


class ControllerStatus(NamedTuple):
    """How the controller is.

    mode: operating mode
    t_s: time since the start of the run
    tick: tick of the newest answer
    tdc_mm: last dead centre, from mid-stroke, as the controller sees it
    tdc_ref_mm: set point in force
    fuel_mg: fuel of the last finished stroke that could fire
    speed_hz: engine speed, by that stroke
    power_w: its mean electric power, as measured
    power_ref_w: target power within reach
    load_n_s_m: load coefficient that is asked for
    stale: ticks without a valid sample
    late_samples: samples that came after their tick was answered without them
    implausible_samples: intact samples that were not believed
    changes: of parameters that have come in force
    reception: what became of the frames, by kind
    """

    mode: A[str, Shown("mode")]
    t_s: RunTimeS
    tick: Tick
    tdc_mm: TdcMm
    tdc_ref_mm: A[float, Shown("set point", "mm", ".3f")]
    fuel_mg: A[float | None, Shown("fuel", "mg", ".3f")]
    speed_hz: A[float | None, Shown("speed", "Hz", ".2f")]
    power_w: A[float | None, Shown("power", "W", ".0f")]
    power_ref_w: A[float | None, Shown("target power", "W", ".0f")]
    load_n_s_m: A[float, Shown("load", "N s/m", ".1f")]
    stale: A[int, Shown("ticks without sample")]
    late_samples: A[int, Shown("late samples")]
    implausible_samples: A[int, Shown("implausible samples")]
    changes: Changes
    reception: Reception


class PlantStatus(NamedTuple):
    """How the plant is.

    t_s: time since the start of the run
    tick: tick under way
    tdc_mm: last dead centre, from mid-stroke, exactly
    late_us: from the tick's time to its wake-up
    late_max_us: the largest of these since the last status
    missed: ticks whose slot had passed
    answered: ticks that were answered
    used_tick: tick that the newest answer is to
    safe: whether the plant has gone to its safe state by itself
    contacts: contacts with a head
    changes: of parameters that have come in force
    reception: what became of the frames, by kind
    """

    t_s: RunTimeS
    tick: Tick
    tdc_mm: TdcMm
    late_us: A[int, Shown("late", "µs")]
    late_max_us: A[int, Shown("late at most", "µs")]
    missed: A[int, Shown("missed ticks")]
    answered: A[int, Shown("answers")]
    used_tick: A[int, Shown("newest answer, to tick")]
    safe: A[bool, Shown("safe state")]
    contacts: A[int, Shown("head contacts")]
    changes: Changes
    reception: Reception


DECLARED: Final[Mapping[str, type[ControllerStatus] | type[PlantStatus]]] = {
    "controller": ControllerStatus, "plant": PlantStatus,
}  # fmt: skip

Status = Mapping[str, Any]


class Figure(NamedTuple):
    """One declared field of a status."""

    kind: type
    shown: Shown


def _figures(declared: type[ControllerStatus] | type[PlantStatus]) -> dict[str, Figure]:
    hints = get_type_hints(declared, include_extras=True)
    found = {}
    for name, hint in hints.items():
        kind, shown = get_args(hint)
        if type(None) in get_args(kind):  # null until there is a value
            kind = get_args(kind)[0]
        found[name] = Figure(get_origin(kind) or kind, shown)
    return found


FIGURES: Final = {process: _figures(declared) for process, declared in DECLARED.items()}

SHOWN: Final = {
    name: figure.shown
    for figures in FIGURES.values() for name, figure in figures.items()
    if figure.kind is not Mapping
}  # fmt: skip
"""How each figure of either process is shown, in the order of a table of them."""


def write(status: Status) -> bytes:
    """Return a status as strict JSON: a number that is not one (no estimate yet) becomes null."""
    return json.dumps({name: finite_or_none(value) for name, value in status.items()}).encode()


def read(process: str, raw: bytes) -> dict[str, Any] | None:
    """Read a status from its bytes; what is not declared, or of another type, is left out.

    Returns: the figures by name, None for those without a value; None when it is no status at all
    """
    if process not in FIGURES or len(raw) > MAX_BYTES:
        return None
    try:
        table = json.loads(raw.decode("utf-8"))
    except (ValueError, RecursionError):
        return None
    if not isinstance(table, dict):
        return None
    figures = FIGURES[process]
    return {
        name: finite_or_none(value) for name, value in table.items()
        if name in figures and _fits(figures[name].kind, value)
    }  # fmt: skip


def finite_or_none(value: object) -> object:
    """Return the value, or None for nan and the infinities."""
    return None if isinstance(value, float) and value - value != 0.0 else value


def _is_count(name: str, count: object) -> bool:
    """Whether it is a counter with a name that can be shown."""
    fits = type(count) is int and abs(count) <= _MOST
    return fits and len(name) <= _MAX_CHARS and name.isprintable()


def _fits(kind: type, value: object) -> bool:
    """Whether a value can be one of a figure."""
    if value is None:
        return True
    if isinstance(value, bool) or kind is bool:
        return isinstance(value, bool) and kind is bool
    if isinstance(value, str):
        return kind is str and len(value) <= _MAX_CHARS and value.isprintable()
    if isinstance(value, dict):
        return kind is Mapping and all(map(_is_count, value, value.values()))
    if not isinstance(value, int | float) or (kind is int and not isinstance(value, int)):
        return False
    return kind in (int, float) and not abs(value) > _MOST
