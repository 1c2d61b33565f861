"""Numbers in the words of the terminal."""

from __future__ import annotations

import re

from hil.errors import ConfigError

_UNITS = ("bytes", "KiB", "MiB", "GiB", "TiB")


def thousands(number: int) -> str:
    """Return a count with its digits in groups."""
    return f"{number:,}".replace(",", " ")


def bytes_text(size: float) -> str:
    """Return a size in the unit that suits it."""
    power = 0
    while size >= 1024.0 and power < len(_UNITS) - 1:
        size, power = size / 1024.0, power + 1
    return f"{size:.0f} {_UNITS[power]}" if power == 0 else f"{size:.1f} {_UNITS[power]}"


def size_of(text: str, flag: str) -> int:
    """Read a size: 256MiB, 10 GiB, 500MB, 1000000.

    Raises: ConfigError
    """
    found = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?)\s*(?:([KMGT])(i?)B|B|)", text.strip())
    if found is None:
        raise ConfigError(f"{flag} {text!r}: accepted is a size, as in 256MiB")
    number, prefix, binary = found.groups()
    base = 1024 if binary else 1000
    return int(float(number) * base ** (" KMGT".index(prefix) if prefix else 0))
