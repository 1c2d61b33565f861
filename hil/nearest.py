"""What somebody may have meant who wrote a name that there is not."""

from __future__ import annotations

from collections.abc import Collection

_MOST, _LIKENESS = 3, 0.6


def nearest(given: str, known: Collection[str], likeness: float = _LIKENESS) -> list[str]:
    """Return the known names most like the given one, the likest first; none below a likeness.

    Of keys with dots those are meant that end in the same name, if there are such.
    """
    from difflib import get_close_matches  # noqa: PLC0415 - of no use to a command that goes well

    wanted, by_plain = _plain(given), {_plain(name): name for name in known}
    found = get_close_matches(wanted, by_plain, _MOST, likeness)
    last = wanted.rpartition(".")[2]
    by_last = {name.rpartition(".")[2]: name for name in by_plain if "." in name}
    for end in [last] if last in by_last else get_close_matches(last, by_last, 1, likeness):
        same = [name for name in by_plain if name.endswith(f".{end}")]
        found = get_close_matches(wanted, same, _MOST, 0.0)
    return [by_plain[name] for name in found]


def did_you_mean(given: object, known: Collection[str]) -> str:
    """Return `; did you mean a or b?` for the end of a refusal, or nothing."""
    names = nearest(given, known) if isinstance(given, str) else []
    return f"; did you mean {' or '.join(names)}?" if names else ""


def listed(given: object, known: Collection[str]) -> str:
    """Return the known names for the end of a refusal, and which of them may have been meant."""
    return f"{', '.join(known) or 'none'}{did_you_mean(given, known)}"


def _plain(name: str) -> str:
    """The same for `Load_Decrease` and `load-decrease`."""
    return name.lower().replace("_", "-")
