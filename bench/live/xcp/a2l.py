"""The A2L file: every signal and parameter with its address, as calibration tools read it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from bench.live.xcp import if_data
from bench.live.xcp.addresses import TYPES, Place, places
from hil.names.leaves import Parameter
from hil.names.signals import Signal

_RANGES = {
    "bool": (0, 1), "uint8": (0, 255), "int8": (-128, 127), "uint16": (0, 65_535),
    "int16": (-32_768, 32_767), "uint32": (0, 2**32 - 1), "int32": (-(2**31), 2**31 - 1),
    "uint64": (0, 2**64 - 1), "int64": (-(2**63), 2**63 - 1),
}  # fmt: skip
_FLOAT = "-1.7976931348623157e+308 1.7976931348623157e+308"


DEFAULT_PORT: Final = 5555
"""That of the standard."""


def text(port: int = DEFAULT_PORT) -> str:
    """Return the file for a slave at a port."""
    body = "\n".join(line for place in places().values() for line in _entry(place))
    return f"""ASAP2_VERSION 1 71
/begin PROJECT fpeg_hil "Hardware-in-the-loop bench for a free-piston engine generator"
  /begin MODULE engine "Plant and controller"
    /begin MOD_COMMON "Little endian"
      BYTE_ORDER MSB_LAST
    /end MOD_COMMON
{if_data.a2ml()}
{if_data.text(port)}
    /begin RECORD_LAYOUT FLOAT64
      FNC_VALUES 1 FLOAT64_IEEE COLUMN_DIR DIRECT
    /end RECORD_LAYOUT
    /begin RECORD_LAYOUT BOOLEAN
      FNC_VALUES 1 UBYTE COLUMN_DIR DIRECT
    /end RECORD_LAYOUT
{body}
  /end MODULE
/end PROJECT
"""


def _entry(place: Place) -> Iterator[str]:
    if place.signal is not None:
        yield from _measurement(place, place.signal)
    elif place.parameter is not None:
        yield from _characteristic(place, place.parameter)


def _measurement(place: Place, signal: Signal) -> Iterator[str]:
    ends = _RANGES.get(signal.type)
    limits = _FLOAT if ends is None else f"{ends[0]} {ends[1]}"
    yield f"    /begin MEASUREMENT {identifier(signal.name)} {_quoted(signal.meaning)}"
    yield f"      {TYPES[signal.type]} NO_COMPU_METHOD 0 0 {limits}"
    yield f"      ECU_ADDRESS 0x{place.address:08X}"
    yield f"      DISPLAY_IDENTIFIER {identifier(signal.name)}"
    yield f"      PHYS_UNIT {_quoted(signal.unit)}"
    yield "    /end MEASUREMENT"


def _characteristic(place: Place, parameter: Parameter) -> Iterator[str]:
    boolean = parameter.kind == "boolean"
    low = 0 if boolean else parameter.low if parameter.low is not None else -1e308
    high = 1 if boolean else parameter.high if parameter.high is not None else 1e308
    layout = "BOOLEAN" if boolean else "FLOAT64"
    name = identifier(parameter.key)
    yield f"    /begin CHARACTERISTIC {name} {_quoted(parameter.meaning)}"
    yield f"      VALUE 0x{place.address:08X} {layout} 0 NO_COMPU_METHOD {low!r} {high!r}"
    yield f"      DISPLAY_IDENTIFIER {name}"
    yield f"      PHYS_UNIT {_quoted(parameter.unit)}"
    yield "    /end CHARACTERISTIC"


def identifier(name: str) -> str:
    """Return a name as the standard has it: a part of an array stands in brackets."""
    head, _, last = name.rpartition(".")
    return f"{head}[{last}]" if last.isdigit() else name


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
