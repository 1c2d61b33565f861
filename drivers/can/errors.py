"""Error frames in words: what a CAN controller reports of itself and of the bus (Linux layout)."""

from __future__ import annotations

from typing import Final

ERROR_FLAG: Final = 1 << 29
CONTROLLER, PROTOCOL, NO_ACKNOWLEDGE, BUS_OFF, BUS_ERROR, RESTARTED, COUNTERS = (
    0x004, 0x008, 0x020, 0x040, 0x080, 0x100, 0x200,
)  # fmt: skip

_CLASSES: Final = {
    0x001: "transmission timed out",
    0x002: "arbitration lost",
    CONTROLLER: "controller problem",
    PROTOCOL: "protocol violation",
    0x010: "transceiver problem",
    NO_ACKNOWLEDGE: "no acknowledge",
    BUS_OFF: "bus-off",
    BUS_ERROR: "bus error",
    RESTARTED: "restarted",
}
_CONTROLLER: Final = {
    0x01: "receive overflow",
    0x02: "transmit overflow",
    0x04: "receive warning level",
    0x08: "transmit warning level",
    0x10: "receive error passive",
    0x20: "transmit error passive",
    0x40: "error active again",
}


def describe(can_id: int, data: bytes) -> tuple[str, str]:
    """Return (code, text) of an error frame, for the log."""
    found = [text for bit, text in _CLASSES.items() if can_id & bit]
    if can_id & CONTROLLER and len(data) > 1:
        found += [text for bit, text in _CONTROLLER.items() if data[1] & bit]
    if can_id & COUNTERS and len(data) > 7:
        found.append(f"transmit errors {data[6]}, receive errors {data[7]}")
    if can_id & BUS_OFF:
        code = "can-bus-off"
    elif can_id & RESTARTED:
        code = "can-restarted"
    else:
        code = "can-error"
    return code, ", ".join(found) or f"error class 0x{can_id & 0x1FFFFFFF:X}"
