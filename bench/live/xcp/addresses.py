"""Which address stands for which signal or parameter: read off the two registries, in order."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from functools import cache
from typing import Final, NamedTuple

from hil.log.records import SCALARS
from hil.names.leaves import Parameter
from hil.names.parameters import parameters
from hil.names.signals import Signal, signals

_SIGNALS_AT: Final = 0x1000_0000
_PARAMETERS_AT: Final = 0x2000_0000
STRIDE: Final = 8
"""Every value has eight bytes to itself."""

TYPES: Final = {
    "bool": "UBYTE", "uint8": "UBYTE", "int8": "SBYTE", "uint16": "UWORD", "int16": "SWORD",
    "uint32": "ULONG", "int32": "SLONG", "uint64": "A_UINT64", "int64": "A_INT64",
    "float32": "FLOAT32_IEEE", "float64": "FLOAT64_IEEE",
}  # fmt: skip
"""The standard's name of each type of a signal."""


class Place(NamedTuple):
    """A value at an address: its struct code and size, and which signal or parameter it is."""

    address: int
    code: str
    size: int
    signal: Signal | None = None
    parameter: Parameter | None = None

    def pack(self, value: float) -> bytes:
        """Return a value as it lies there."""
        return struct.pack(f"<{self.code}", value if self.code in "fd" else int(value))

    def unpack(self, data: bytes) -> float | bool:
        """Return the value of bytes that lie there."""
        value: float = struct.unpack(f"<{self.code}", data)[0]
        boolean = self.parameter is not None and self.parameter.kind == "boolean"
        return bool(value) if boolean else value


@cache
def places() -> Mapping[int, Place]:
    """Return all values by their addresses: numbers of signals, and live parameters."""
    found: dict[int, Place] = {}
    for number, signal in enumerate(s for s in signals().values() if s.is_number):
        code, size = SCALARS[signal.type]
        address = _SIGNALS_AT + number * STRIDE
        found[address] = Place(address, code, size, signal=signal)
    tuned = [p for p in parameters().values() if p.live and p.kind in ("number", "boolean")]
    for number, parameter in enumerate(tuned):
        code, size = ("B", 1) if parameter.kind == "boolean" else ("d", 8)
        address = _PARAMETERS_AT + number * STRIDE
        found[address] = Place(address, code, size, parameter=parameter)
    return found


def address_of(name: str) -> int:
    """Return the address of a signal or parameter by its name.

    Raises: KeyError
    """
    for address, place in places().items():
        known = place.signal.name if place.signal else place.parameter and place.parameter.key
        if known == name:
            return address
    raise KeyError(name)
