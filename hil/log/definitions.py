"""ROS 2 message definitions, read: the fields of a topic, whoever wrote the log.

A definition may hold others behind lines of `=`, each with its name; a field of such a type becomes
its fields with dotted names (`pose.position.x`). Constants and default values are no bytes of a
message and are passed over.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import lru_cache

from hil.log.records import SCALARS, Field

_SEPARATOR = re.compile(r"^\s*={3,}\s*$", re.MULTILINE)
_NAMED = re.compile(r"\s*MSG:\s*(\S+)\s*")
_LINE = re.compile(r"(?P<kind>\S+)\s+(?P<name>[A-Za-z]\w*)(?P<rest>.*)")
_COMMENT = re.compile(r"#\s*(?:\[([^\]]*)\]\s*)?(.*)")
_KIND = re.compile(r"(?P<base>[\w/]+)(?:<=\d+)?(?P<array>\[(?:(?P<most><=)?(?P<count>\d*))\])?")
_OTHER_NAMES = {"byte": "uint8", "char": "uint8", "wstring": "wstring", "string": "string"}
_TIME = (Field("int32", "", "s", "sec"), Field("uint32", "", "ns", "nanosec"))
_BUILT_IN = {"builtin_interfaces/Time": _TIME, "builtin_interfaces/Duration": _TIME}
# IDL knows no empty structure, so a nested message without fields has this byte.
_FILLED = (Field("uint8", "", "", "structure_needs_at_least_one_member"),)
_DEEPEST = 32
_MOST_FIELDS = 4096

Types = dict[str, tuple[Field, ...]]


@lru_cache(maxsize=64)  # every log of a campaign or suite has the same ones
def parse_definition(text: str, package: str = "") -> tuple[Field, ...]:
    """Return the fields of a definition, those of nested types with dotted names.

    The types are scalars, arrays (`float64[3]`, `float64[]`) and strings, and arrays of other
    messages (`geometry_msgs/Point[]`), whose fields are not told.

    Raises: ValueError when a line is no field, or a type is not described
    """
    own, *others = _SEPARATOR.split(text.removeprefix("\ufeff"))
    types: Types = dict(_BUILT_IN)
    for part in others:
        name = _NAMED.match(part)
        if name is None:
            raise ValueError("a definition without its name (MSG: package/Name)")
        short = _short(name[1])
        types[short] = _lines(part[name.end() :], short.partition("/")[0])
    return tuple(_with_own_names(_flat(_lines(own, package), types, "", 0)))


def _lines(text: str, package: str) -> tuple[Field, ...]:
    """Return the fields that the lines of one definition declare."""
    fields = []
    for line in text.splitlines():
        bare = line.strip()
        if not bare or bare.startswith("#"):
            continue
        match = _LINE.fullmatch(bare)
        if match is None:
            raise ValueError(f"no field definition: {bare!r}")
        rest = match["rest"].strip()
        if rest.startswith("="):
            continue
        comment = _COMMENT.search(rest)
        unit, meaning = (comment[1] or "", comment[2]) if comment else ("", "")
        fields.append(Field(_kind(match["kind"], package), meaning, unit, match["name"]))
    return tuple(fields)


def _kind(text: str, package: str) -> str:
    """Return a type in one spelling: bounds left out, the package before the name of a message."""
    match = _KIND.fullmatch(text)
    if match is None:
        raise ValueError(f"type {text!r}: accepted are scalars, strings, messages and their arrays")
    base = _OTHER_NAMES.get(match["base"], match["base"])
    if base not in SCALARS and base not in _OTHER_NAMES.values():
        base = _short(base if "/" in base else f"{package}/{base}")
    if match["array"] is None:
        return base
    return f"{base}[]" if match["most"] or not match["count"] else f"{base}[{match['count']}]"


def _short(name: str) -> str:
    """Return `geometry_msgs/Point` for geometry_msgs/msg/Point."""
    package, _, rest = name.partition("/")
    return f"{package}/{rest.rpartition('/')[2]}"


def _flat(fields: tuple[Field, ...], types: Types, prefix: str, depth: int) -> Iterator[Field]:
    """Yield the fields with those of nested types in their place."""
    if depth > _DEEPEST:
        raise ValueError(f"types nested more than {_DEEPEST} deep")
    for field in fields:
        base, array, _ = field.type.partition("[")
        if "/" in base and base not in types:
            accepted = ", ".join(SCALARS)
            raise ValueError(f"type {base!r}: accepted are {accepted} and what it defines")
        if "/" in base and not array:
            below = types[base] or _FILLED
            yield from _flat(below, types, f"{prefix}{field.name}.", depth + 1)
        else:
            yield field._replace(name=prefix + field.name)


def _with_own_names(fields: Iterator[Field]) -> Iterator[Field]:
    """Give a field whose name is taken another one: x, x_2."""
    seen: set[str] = set()
    for field in fields:
        name, number = field.name, 2
        while name in seen:
            name, number = f"{field.name}_{number}", number + 1
        seen.add(name)
        if len(seen) > _MOST_FIELDS:
            raise ValueError(f"more than {_MOST_FIELDS} fields")
        yield field._replace(name=name)
