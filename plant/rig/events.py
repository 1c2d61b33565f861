"""What the plant has to tell besides its state: one tuple an occurrence, with a stable code."""

from __future__ import annotations

from typing import NamedTuple

AT_REST = "at-rest"
IN_MOTION = "in-motion"
CONTACT = "contact"
MISFIRE = "misfire"
DISTURBANCE = "disturbance"
PULSE_REFUSED = "pulse-refused"
ORDER_REFUSED = "order-refused"
SAFE_STATE = "safe-state"
SAFE_STATE_LEFT = "safe-state-left"

CODES = (
    AT_REST,
    IN_MOTION,
    CONTACT,
    MISFIRE,
    DISTURBANCE,
    PULSE_REFUSED,
    ORDER_REFUSED,
    SAFE_STATE,
    SAFE_STATE_LEFT,
)


class Event(NamedTuple):
    """An occurrence at its own instant, in nanoseconds since the start of the run."""

    t_ns: int
    code: str
    text: str
