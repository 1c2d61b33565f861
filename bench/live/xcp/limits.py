"""How much one packet holds."""

from typing import Final

MAX_CTO: Final = 255
"""Bytes of a command or its response."""

MAX_DTO: Final = 1400
"""Bytes of what a tick's values go in."""
