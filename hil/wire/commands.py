"""Every command, declared once: kind, addressee, fields with unit and range.

On the command key a command is one JSON object, `{"kind": "set-point", "tdc_ref_m": 0.015}`; in a
scenario the same table with a time, an event. The configuration's ranges that mean the same, and
docs/commands.md, follow from this module.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

from hil.errors import ConfigError
from hil.nearest import listed
from hil.wire import quantities
from hil.wire.quantities import Choice, Field, FieldError, Name, Number, Scalar, shown, value_of

CONTROLLER, PLANT = "controller", "plant"

MAX_BYTES: Final = 16_384
"""No command is longer."""

_MAX_KEY: Final = 60
_NO_FIELDS: Final[Mapping[str, Scalar]] = MappingProxyType({})


def _nothing_more(_fields: Mapping[str, Scalar]) -> str:
    return ""


class Declaration(NamedTuple):
    """A command; `check` returns what is wrong with fields that are each in their range."""

    kind: str
    to: str
    meaning: str
    fields: tuple[Field, ...] = ()
    check: Callable[[Mapping[str, Scalar]], str] = _nothing_more


AT_S: Final = Number("at_s", "s", 0.0, 1e6, "time of an event in the run")
_FRACTION: Final = Number(
    "at_stroke_fraction", "1", 0.0, 1.0, "instant in the first stroke that starts from then on", 0.0
)
_DEAD_CENTRE: Final = _FRACTION._replace(high=0.0, meaning="misfires are at dead centres")
_ON_THE_WAY: Final = _FRACTION._replace(low=0.01, default=0.85, meaning="instant in that stroke")
_UNTIL_S: Final = Number("until_s", "s", 0.0, 1e6, "end, as time in the run", optional=True)

TDC_REF_M: Final = Number(
    "tdc_ref_m", "m", 0.001, 0.05, "set point of the dead centres, from mid-stroke",
    optional=True, parameter="controller.tdc_ref_m",
)  # fmt: skip
TARGET_POWER_W: Final = Number(
    "target_power_w", "W", 0.0, 10_000.0, "electric power that is wanted",
    optional=True, parameter="controller.supervisory.target_power_w",
)  # fmt: skip
LAW: Final = Name(
    "law", "its name; which there are the controller knows", parameter="controller.name"
)


def _says_something(fields: Mapping[str, Scalar]) -> str:
    given = TDC_REF_M.name in fields or TARGET_POWER_W.name in fields
    return "" if given else "a set-point needs tdc_ref_m or target_power_w"


def _is_a_range(fields: Mapping[str, Scalar]) -> str:
    low, high = fields["low"], fields["high"]
    return f"low must not exceed high = {high:g}" if low > high else ""  # type: ignore[operator]


DECLARED: Final = (
    Declaration("start", CONTROLLER, "start the engine; leads out of the safe state, too"),
    Declaration("stop", CONTROLLER, "stop the engine"),
    Declaration(
        "set-point", CONTROLLER, "change set points, one or both", (TDC_REF_M, TARGET_POWER_W),
        _says_something,
    ),
    Declaration("law", CONTROLLER, "let another law go on from here", (LAW,)),
    Declaration("emergency-stop", CONTROLLER, "go to the safe state at once, and stay there"),
    Declaration("mark", CONTROLLER, "put a mark into the log", (quantities.LINE,)),
    Declaration(
        "load-scale", PLANT, "the load in force is a multiple of the commanded one",
        (Number("value", "1", 0.0, 10.0, "factor"), _FRACTION, _UNTIL_S),
    ),
    Declaration(
        "efficiency", PLANT, "combustion efficiency, drawn anew for each combustion",
        (
            Number("low", "1", 0.0, 1.0, "least of the uniform distribution", 0.95),
            Number("high", "1", 0.0, 1.0, "most of it", 1.0), _FRACTION, _UNTIL_S,
        ),
        _is_a_range,
    ),
    Declaration(
        "misfire", PLANT, "the next combustions fail",
        (
            Number("count", "1", 1, 1000, "how many", 1, whole=True),
            Choice("cause", ("spark", "fuel"), "what is missing", "spark"), _DEAD_CENTRE,
        ),
    ),
    Declaration("pre-ignition", PLANT, "a compressed charge lights itself", (_ON_THE_WAY,)),
    Declaration(
        "sensor-fault", PLANT, "a sensor's signal is replaced",
        (
            Choice("signal", ("x", "v", "power", "p_left", "p_right"),
                   "position, velocity, electric power, pressures"),
            Choice("substitute", ("hold", "value", "offset"), "last value, or `value`, or added",
                   "hold"),
            Number("value", "m, m/s, W or Pa", -1e8, 1e8, "substitute or offset", 0.0),
            Number("duration_s", "s", 1e-6, 1e6, "how long"), _FRACTION,
        ),
    ),
)  # fmt: skip
BY_KIND: Final = {declared.kind: declared for declared in DECLARED}

BY_PARAMETER: Final = {
    field.parameter: (declared.kind, field.name)
    for declared in DECLARED for field in declared.fields if field.parameter
}  # fmt: skip
"""Parameters that can be changed while the engine runs, with the command that does it."""


class OperatorCommand(NamedTuple):
    """One command whose fields are in their ranges, defaults filled in."""

    kind: str
    fields: Mapping[str, Scalar] = _NO_FIELDS
    origin: str = "scenario"

    @property
    def to(self) -> str:
        """Who acts on it."""
        return BY_KIND[self.kind].to

    def number(self, name: str) -> float | None:
        """A field that is a number; None when it was not given."""
        value = self.fields.get(name)
        return None if isinstance(value, str) else value

    def text(self, name: str) -> str | None:
        """A field that is a name; None when it was not given."""
        value = self.fields.get(name)
        return value if isinstance(value, str) else None

    def table(self) -> dict[str, Scalar]:
        """Return it as the key carries it."""
        return {"kind": self.kind, **self.fields}

    def describe(self) -> str:
        """What was commanded, in one line."""
        words = [
            f"{name}={value if isinstance(value, str) else format(value, 'g')}"
            for name, value in self.fields.items()
        ]
        return " ".join([self.kind, *words, f"from {self.origin}"])


class TimedCommand(NamedTuple):
    """A command with a time: an entry of a scenario's [events]."""

    at_s: float
    command: OperatorCommand

    @property
    def kind(self) -> str:
        """Which command."""
        return self.command.kind

    @property
    def to(self) -> str:
        """Who acts on it."""
        return self.command.to

    def number(self, name: str) -> float:
        """A field that is a number and has been given, or has a default.

        Raises: KeyError
        """
        value = self.command.fields[name]
        assert not isinstance(value, str)
        return value

    def text(self, name: str) -> str:
        """A field that is a name and has been given, or has a default.

        Raises: KeyError
        """
        return str(self.command.fields[name])

    def table(self) -> dict[str, Scalar]:
        """Return it as it stands in a scenario."""
        return {"kind": self.kind, "at_s": self.at_s, **self.command.fields}


def read(table: Mapping[str, object], origin: str) -> OperatorCommand:
    """Check a command given as a table; a value of None is one that was not given.

    Raises: ValueError with a line that says what is wrong and what is accepted
    """
    declared = _declared(table)
    return OperatorCommand(declared.kind, _fields(declared, table, declared.fields), origin)


def read_event(table: object, others: tuple[str, ...] = ()) -> TimedCommand:
    """Check an entry of a scenario's [events]; only the plant's may leave its time out.

    Raises: ValueError as `read` does
    """
    if not isinstance(table, Mapping):
        raise ValueError(f"must be a table with a kind: {', '.join((*BY_KIND, *others))}")
    declared = _declared(table, others)
    at = AT_S._replace(default=0.0 if declared.to == PLANT else None)
    fields = _fields(declared, table, (at, *declared.fields))
    at_s = float(fields.pop(AT_S.name))
    return begun_at(at_s, OperatorCommand(declared.kind, fields))


def _declared(table: Mapping[str, object], others: tuple[str, ...] = ()) -> Declaration:
    kind = table.get("kind")
    if not isinstance(kind, str) or kind not in BY_KIND:
        raise FieldError(f"kind must be one of {listed(kind, (*BY_KIND, *others))}")
    return BY_KIND[kind]


def _fields(
    declared: Declaration, table: Mapping[str, object], accepted: tuple[Field, ...]
) -> dict[str, Scalar]:
    """The fields of a table, each checked, defaults filled in."""
    known = {field.name: field for field in accepted}
    for name, value in table.items():
        if name not in known and name != "kind" and value is not None:
            word = name if name.isascii() and name.isidentifier() else shown(name)
            names = listed(name, ("kind", *known))
            raise FieldError(f"{word[:_MAX_KEY]}: unknown key; accepted here: {names}")
    fields = {name: value for name, field in known.items()
              if (value := value_of(field, table.get(name))) is not None}  # fmt: skip
    if wrong := declared.check(fields):
        raise ValueError(wrong)
    return fields


def begun_at(at_s: float, command: OperatorCommand) -> TimedCommand:
    """Give a command its time.

    Raises: ValueError when it ends before
    """
    until_s = command.number(_UNTIL_S.name)
    if until_s is not None and until_s <= at_s:
        raise ValueError(f"until_s must be greater than at_s = {at_s:g}")
    return TimedCommand(at_s, command)


def parse(raw: bytes, origin: str, to: str = CONTROLLER) -> OperatorCommand | None:
    """Read a command from its bytes.

    Returns: the command; None when it is not for this addressee. What is for nobody the
        controller refuses, so that it is told once.

    Raises: ConfigError with one line that says what is wrong and what is accepted
    """
    table: Mapping[str, object] = {}
    try:
        table = _table(raw)
        return read(table, origin) if to == _addressee(table) else None
    except ValueError as error:
        if to != CONTROLLER and not table:
            return None
        raise ConfigError(f"command from {origin}: {error}") from None


def _addressee(table: Mapping[str, object]) -> str:
    kind = table.get("kind")
    return BY_KIND[kind].to if isinstance(kind, str) and kind in BY_KIND else CONTROLLER


def write(command: OperatorCommand) -> bytes:
    """Return a command as the key carries it; `parse` reads it back."""
    return encode(command.table())


def encode(table: Mapping[str, object]) -> bytes:
    """Return a table as the key carries it, whether it is a command or not."""
    return json.dumps(dict(table)).encode()


def _table(raw: bytes) -> Mapping[str, object]:
    """The JSON object of some bytes; empty when they are other JSON.

    Raises: ValueError when they are none
    """
    if len(raw) > MAX_BYTES:
        raise ValueError(f"not JSON of at most {MAX_BYTES} bytes")
    try:
        table = json.loads(raw.decode("utf-8"))
    except (ValueError, RecursionError):
        raise ValueError("not JSON in UTF-8") from None
    return table if isinstance(table, dict) else {}
