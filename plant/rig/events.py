"""What the plant has to tell besides its state: one tuple an occurrence, with a stable code."""

from __future__ import annotations

from typing import Final, final

from hil.values import Value

AT_REST: Final = "at-rest"
IN_MOTION: Final = "in-motion"
CONTACT: Final = "contact"
VALVE_CONTACT: Final = "valve-contact"
MISFIRE: Final = "misfire"
DISTURBANCE: Final = "disturbance"
PULSE_REFUSED: Final = "pulse-refused"
ORDER_REFUSED: Final = "order-refused"
SAFE_STATE: Final = "safe-state"
SAFE_STATE_LEFT: Final = "safe-state-left"

CODES: Final = (
    AT_REST,
    IN_MOTION,
    CONTACT,
    VALVE_CONTACT,
    MISFIRE,
    DISTURBANCE,
    PULSE_REFUSED,
    ORDER_REFUSED,
    SAFE_STATE,
    SAFE_STATE_LEFT,
)


@final
class Event(Value):
    """An occurrence at its own instant, in nanoseconds since the start of the run."""

    __slots__ = ("t_ns", "code", "text")

    def __init__(self, t_ns: int, code: str, text: str) -> None:
        self.t_ns = t_ns
        self.code = code
        self.text = text
