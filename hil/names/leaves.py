"""Leaves of a section of the configuration, read off its declaration: what one is and accepts."""

from __future__ import annotations

import re
import types
from collections.abc import Iterator
from inspect import cleandoc
from typing import Annotated, Any, Final, Literal, NamedTuple, Union, get_args, get_origin

from pydantic.fields import FieldInfo

from hil.config.base import OneOf, Section
from hil.errors import ConfigError
from hil.nearest import did_you_mean
from hil.wire.quantities import Scalar, shown

Value = Scalar | bool | None

_UNITS: Final = {
    "n_s_m_per_s": "N s/m/s", "n_s_m": "N s/m", "kg_s_m": "kg s/m", "kg_s": "kg/s", "m_s": "m/s",
    "j_kg_k": "J/(kg K)", "j_kg": "J/kg", "bit_s": "bit/s", "hz": "Hz", "pa": "Pa", "kg": "kg",
    "mm": "mm", "us": "us", "bytes": "B", "ticks": "ticks", "m": "m", "s": "s", "n": "N", "w": "W",
    "k": "K", "v": "V", "m2": "m2",
}  # fmt: skip
"""How a name ends, and the unit that says; the longest ending counts."""

_ENDING: Final = re.compile("(?:^|_)(" + "|".join(sorted(_UNITS, key=len, reverse=True)) + ")$")
_MEANING: Final = re.compile(r"^([a-z]\w*(?:, [a-z]\w*)*): ")
_KINDS: Final = {
    bool: "boolean",
    int: "whole number",
    float: "number",
    tuple: "list",
    dict: "table",
}
_ENDS: Final = {
    "ge": "ge", "gt": "gt", "le": "le", "lt": "lt", "min_length": "ge", "max_length": "le",
}  # fmt: skip
SETTING: Final = "setting"
"""Kind of what a class of the user's own declares: number, boolean or text."""

NONE: Final = "none"
"""What is given for a parameter to leave it open."""


class Parameter(NamedTuple):
    """One leaf of the configuration.

    kind: number, whole number, boolean, choice, text, list or table
    low, high: ends of the range, of a list that of its length, None where it is open; `outside`
        tells which of them do not belong to it
    default: None where it is open, or there is none because it is `required`
    live: whether a running engine takes a change of it
    """

    key: str
    kind: str
    unit: str
    low: float | None
    high: float | None
    outside: tuple[bool, bool]
    choices: tuple[str, ...]
    pattern: str
    default: Any
    optional: bool
    required: bool
    live: bool
    meaning: str

    @property
    def side(self) -> str:
        """Whose it is: plant, controller, or both."""
        head = self.key.partition(".")[0]
        return head if head in ("plant", "controller") else "both"

    @property
    def accepted(self) -> str:
        """What is accepted, in words; empty where anything of its kind is."""
        if self.choices:
            return ", ".join(self.choices)
        if self.pattern:
            return self.pattern
        if self.kind == "list":
            return "" if self.high is None else f"{self.low or 0:g} to {self.high:g} of them"
        if self.low is not None and self.low == self.high:
            return f"{self.low:g}"
        words = ("from", "above"), ("to", "below")
        ends = zip((self.low, self.high), self.outside, words, strict=True)
        return " ".join(f"{word[out]} {end:g}" for end, out, word in ends if end is not None)

    def checked(self, value: object) -> Value:
        """Return a value as the configuration holds it.

        Raises: ConfigError naming key, value and what is accepted
        """
        if self.optional and value in (None, NONE):
            return None
        if not self._fits(value):
            more = f", or {NONE}" if self.optional else ""
            what = f"{self.accepted or f'a {self.kind}'}{more}"
            hint = did_you_mean(value, self.choices)
            raise ConfigError(f"{self.key} = {shown(value)}; accepted: {what}{hint}")
        return float(value) if self.kind == "number" else value  # type: ignore[return-value, arg-type]

    def _fits(self, value: object) -> bool:
        if self.kind == SETTING:
            return isinstance(value, bool | str) or self._is_finite(value)
        if self.kind == "boolean" or isinstance(value, bool):
            return self.kind == "boolean" and isinstance(value, bool)
        if self.kind in ("number", "whole number"):
            whole = isinstance(value, int) or self.kind == "number"
            return whole and isinstance(value, int | float) and self._is_within(value)
        if not isinstance(value, str):
            return False
        fits = not self.pattern or re.search(self.pattern, value) is not None
        return fits and (not self.choices or value in self.choices)

    def _is_finite(self, value: object) -> bool:
        return isinstance(value, int | float) and value - value == 0.0

    def _is_within(self, value: float) -> bool:
        low, high = self.low, self.high
        above = low is None or (value > low if self.outside[0] else value >= low)
        below = high is None or (value < high if self.outside[1] else value <= high)
        return above and below and value - value == 0.0

    def table(self) -> dict[str, object]:
        """Return it as JSON tells it."""
        told = self._asdict() | {"side": self.side, "accepted": self.accepted}
        return {name: value for name, value in told.items() if name != "outside"}


def sections(section: type[Section], prefix: str = "") -> Iterator[tuple[str, type[Section]]]:
    """Yield (prefix of the keys, section) of a section and of those in it."""
    yield prefix, section
    for name, info in section.model_fields.items():
        inner, _ = _given(info)
        if _is_section(inner):
            yield from sections(inner, f"{prefix}{name}.")


def leaves(section: type[Section], prefix: str = "") -> Iterator[Parameter]:
    """Yield the parameters of a section and of those in it."""
    for inner_prefix, inner in sections(section, prefix):
        yield from own_leaves(inner, inner_prefix)


def own_leaves(section: type[Section], prefix: str = "") -> Iterator[Parameter]:
    """Yield the parameters of one section alone."""
    _, meanings = read_docstring(section.__doc__ or "")
    for name, info in section.model_fields.items():
        kind, constraints = _given(info)
        if not _is_section(kind):
            meaning = info.description or meanings.get(name, "")
            yield _leaf(f"{prefix}{name}", kind, constraints, info, section, meaning)


def _leaf(
    key: str, kind: Any, constraints: list[Any], info: FieldInfo, section: type[Section],  # noqa: ANN401
    meaning: str,
) -> Parameter:  # fmt: skip
    said = info.json_schema_extra if isinstance(info.json_schema_extra, dict) else {}
    told = _told(constraints)
    choices = tuple(map(str, get_args(kind))) if get_origin(kind) is Literal else told.choices
    name = "choice" if choices else _KINDS.get(get_origin(kind) or kind, "text")
    is_number = name in ("number", "whole number")
    unit = unit_of(key.rpartition(".")[2]) or (section.unit if is_number else "")
    default = info.get_default(call_default_factory=True) if not info.is_required() else None
    return Parameter(
        key, name, unit, told.low, told.high, told.outside, choices,
        told.pattern, default, _is_optional(info.annotation), info.is_required(),
        bool(said.get("live", section.live)), " ".join(meaning.split()),
    )  # fmt: skip


def unit_of(name: str) -> str:
    """Return the unit that a name ends with; empty where it ends with none."""
    ending = _ENDING.search(name)
    return _UNITS[ending[1]] if ending else ""


def setting(key: str) -> Parameter:
    """Return what is known of a setting that a user's own class declares; it checks its value."""
    return Parameter(
        key, SETTING, unit_of(key.rpartition(".")[2]), None, None, (False, False), (), "", None,
        optional=False,
        required=False, live=True, meaning="of one's own",
    )  # fmt: skip


class _Told(NamedTuple):
    """What the constraints of a field say."""

    low: float | None
    high: float | None
    outside: tuple[bool, bool]
    choices: tuple[str, ...]
    pattern: str


def _told(constraints: list[Any]) -> _Told:
    ends: dict[str, float] = {}
    choices: tuple[str, ...] = ()
    pattern = ""
    for constraint in constraints:
        if isinstance(constraint, OneOf):
            choices = constraint.names
        for name, end in _ENDS.items():
            if getattr(constraint, name, None) is not None:
                ends[end] = getattr(constraint, name)
        pattern = getattr(constraint, "pattern", None) or pattern
    low, high = ends.get("ge", ends.get("gt")), ends.get("le", ends.get("lt"))
    return _Told(low, high, ("gt" in ends, "lt" in ends), choices, pattern)


def _given(info: FieldInfo) -> tuple[Any, list[Any]]:
    """Return the kind of a value that is given, and all its constraints."""
    return _unwrapped(info.annotation, list(info.metadata))


def _unwrapped(annotation: Any, constraints: list[Any]) -> tuple[Any, list[Any]]:  # noqa: ANN401
    if get_origin(annotation) is Annotated:
        inner, *metadata = get_args(annotation)
        for one in metadata:
            constraints += one.metadata if isinstance(one, FieldInfo) else [one]
        return _unwrapped(inner, constraints)
    if get_origin(annotation) in (Union, types.UnionType):
        others = [kind for kind in get_args(annotation) if kind is not type(None)]
        if len(others) == 1:
            return _unwrapped(others[0], constraints)
    return annotation, constraints


def _is_optional(annotation: Any) -> bool:  # noqa: ANN401
    return type(None) in get_args(annotation)


def _is_section(kind: Any) -> bool:  # noqa: ANN401
    return isinstance(kind, type) and issubclass(kind, Section)


def read_docstring(text: str) -> tuple[str, dict[str, str]]:
    """Part a section's docstring into what it is for, and what its keys mean."""
    told: list[str] = []
    meanings: dict[str, str] = {}
    names: list[str] = []
    for line in filter(None, map(str.rstrip, cleandoc(text).splitlines())):
        found = _MEANING.match(line)
        if found:
            names = found[1].split(", ")
            meanings |= dict.fromkeys(names, line[found.end() :])
        elif names and line.startswith(" "):
            meanings |= {name: f"{meanings[name]} {line.strip()}" for name in names}
        else:
            names = []
            told.append(line)
    return "\n".join(told), meanings
