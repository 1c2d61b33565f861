"""How a wire message is declared: fields with width, scale, unit and range, bound to a CAN id.

Every frame is a 64-bit little-endian word: bits 0 to 7 the CRC and bits 8 to 11 the counter of
AUTOSAR E2E profile 2, then at most 52 bits of signals in the order of their declaration.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

from hil import compiled

PAYLOAD_START_BIT = 12
PAYLOAD_BITS = 52


@dataclass(frozen=True)
class Signal:
    """One field of a message: `kind` is "u" or "i" and a width in bits, value = raw * scale.

    `minimum`, `maximum` and the names of `values` narrow the range that the width allows;
    `only_when` names the value of the message's selector under which the field is on the wire
    (multiplexing).
    """

    kind: str
    scale: float = 1
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    values: Mapping[int, str] = field(default_factory=dict)
    selects: bool = False
    only_when: int | None = None

    @property
    def signed(self) -> bool:
        """Two's complement when true."""
        return self.kind[0] == "i"

    @property
    def bits(self) -> int:
        """Width on the wire."""
        return int(self.kind[1:])

    @property
    def raw_range(self) -> tuple[int, int]:
        """Smallest and largest raw value that is accepted, in either direction."""
        low, high = (-(1 << self.bits - 1), (1 << self.bits - 1) - 1)
        if not self.signed:
            low, high = 0, (1 << self.bits) - 1
        if self.minimum is not None:
            low = max(low, round(self.minimum / self.scale))
        if self.maximum is not None:
            high = min(high, round(self.maximum / self.scale))
        if self.values:
            high = min(high, max(self.values))
        return low, high


@dataclass(frozen=True)
class Placed:
    """A signal with its name, its place in the word and what its docstring says."""

    name: str
    signal: Signal
    start_bit: int
    is_float: bool


@dataclass(frozen=True)
class Layout:
    """Everything the codec, the DBC and the documentation need to know of one message."""

    name: str
    can_id: int
    sender: str
    receiver: str
    per_tick: int
    fields: tuple[Placed, ...]
    comment: str
    field_comments: Mapping[str, str]
    make: Callable[..., Any]

    @property
    def data_ids(self) -> bytes:
        """The 16 data identifiers of E2E profile 2, one a counter value, distinct by message.

        A wrong counter bit picks another identifier. These shifts keep it at least four bits from
        looking right, as the CRC does for the bits that it covers; most lists would allow two.
        """
        base = self.can_id * 37 + (self.can_id >> 8) & 0xFF
        return bytes(base ^ counter << 1 ^ counter << 2 for counter in range(16))


LAYOUTS: dict[int, Layout] = {}
_BY_CLASS: dict[type, Layout] = {}
MessageT = TypeVar("MessageT", bound=type)


def layout_of(message: type) -> Layout:
    """The layout that `@message` gave to a class."""
    return _BY_CLASS[message]


def most_of(message: type, field: str) -> float:
    """The largest value that a field carries, in its unit."""
    signal = next(p.signal for p in layout_of(message).fields if p.name == field)
    return float(signal.raw_range[1] * signal.scale)


def refusal(message: object, field: str) -> str:
    """Say what is wrong with a value: message, signal, value (an integer as one) and range."""
    layout = layout_of(type(message))
    signal = next(p.signal for p in layout.fields if p.name == field)
    low, high = (raw * signal.scale for raw in signal.raw_range)
    accepted = f"accepted {low:.10g} to {high:.10g} {signal.unit}".rstrip()
    return f"{layout.name}.{field} = {getattr(message, field)!r}: {accepted}"


def message(
    can_id: int, *, sender: str, receiver: str, per_tick: int = 1
) -> Callable[[MessageT], MessageT]:
    """Declare a value whose `__init__` takes `Annotated[..., Signal(...)]` as a wire message.

    `per_tick` is how many frames of it one tick carries at the most; bus load is computed from it.
    Nought is one that is sent now and then in the place of another.
    """

    def register(cls: MessageT) -> MessageT:
        if can_id in LAYOUTS:
            raise ValueError(f"{cls.__name__}: CAN id {can_id:#x} is {LAYOUTS[can_id].name}'s")
        hints, doc = _declared(cls)
        comment, field_comments = _comments(doc, hints)
        placed = _place(cls.__name__, hints)
        layout = Layout(
            cls.__name__, can_id, sender, receiver, per_tick, placed, comment, field_comments, cls
        )
        LAYOUTS[can_id] = _BY_CLASS[cls] = layout
        return cls

    return register


def _declared(cls: type) -> tuple[dict[str, Any], str]:
    """Hints of what `__init__` takes, and the docstring."""
    if not compiled.is_compiled(cls.__module__):
        hints = get_type_hints(vars(cls).get("__init__", cls), include_extras=True)
        return {name: hint for name, hint in hints.items() if name != "return"}, cls.__doc__ or ""
    source, scope = compiled.class_source(cls), vars(sys.modules[cls.__module__])
    made = next(node for node in source.body if isinstance(node, ast.FunctionDef))
    hints = {arg.arg: arg.annotation for arg in made.args.args if arg.annotation is not None}
    doc = ast.get_docstring(source) or ""
    return {name: eval(ast.unparse(hint), scope) for name, hint in hints.items()}, doc


def _place(owner: str, hints: Mapping[str, Any]) -> tuple[Placed, ...]:
    """Lay the signals out from bit 12; those under a selector share one place."""
    placed: list[Placed] = []
    next_bit = PAYLOAD_START_BIT
    shared_start: int | None = None
    for name, hint in hints.items():
        if get_origin(hint) is not Annotated:
            raise TypeError(f"{owner}.{name} has no Signal")
        base, signal = get_args(hint)[:2]
        if signal.only_when is not None:
            shared_start = next_bit if shared_start is None else shared_start
            start = shared_start
        else:
            start = next_bit
        placed.append(Placed(name, signal, start, base is float))
        next_bit = max(next_bit, start + signal.bits)
    if next_bit > PAYLOAD_START_BIT + PAYLOAD_BITS:
        raise ValueError(f"{owner} needs {next_bit - PAYLOAD_START_BIT} bits of 52")
    return tuple(placed)


def _comments(doc: str, names: Container[str]) -> tuple[str, dict[str, str]]:
    """Split a docstring into its first paragraph and its `name: text` lines."""
    lines = [line.strip() for line in doc.splitlines()]
    fields: dict[str, str] = {}
    head: list[str] = []
    current = ""
    for line in lines:
        name, colon, text = line.partition(": ")
        if colon and name in names:
            current = name
            fields[name] = text
        elif current and line:
            fields[current] += f" {line}"
        elif line and not fields:
            head.append(line)
    return " ".join(head), fields
