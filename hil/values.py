"""Values of the hot path: final classes with slots, built whole and by name, never changed after.

A class derives from `Value`, is `@final`, and names its fields twice: in `__slots__`, which is what
the interpreter needs, and as the typed arguments of `__init__`, which is what the compiler makes
fields of a C structure of. It is an eighth of the cost of a NamedTuple there, and no dearer here.
Where `Value` is compiled, others may derive from it all the same; that costs no compiled one more.
tests/unit/test_value_classes.py holds them to all this.
"""

from __future__ import annotations

from typing import Any, Final, TypeVar

from mypy_extensions import mypyc_attr

NEVER: Final = 1 << 62
"""A tick that does not come, or an instant [ns]."""

_ValueT = TypeVar("_ValueT", bound="Value")


@mypyc_attr(allow_interpreted_subclasses=True, acyclic=True)
class Value:
    """The base of all values: equal when all fields are, and shown with their names."""

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(getattr(self, name) == getattr(other, name) for name in fields_of(type(self)))

    def __hash__(self) -> int:
        return hash(tuple(getattr(self, name) for name in fields_of(type(self))))

    def __repr__(self) -> str:
        kind = type(self)
        shown = ", ".join(f"{name}={getattr(self, name)!r}" for name in fields_of(kind))
        return f"{kind.__name__}({shown})"

    def __reduce__(self) -> tuple[Any, ...]:
        kind = type(self)
        return kind, tuple(getattr(self, name) for name in fields_of(kind))


def fields_of(kind: Any) -> tuple[str, ...]:  # noqa: ANN401
    """Return the names of a value class's fields, in the order of its `__init__`."""
    own = kind.__dict__  # an interpreted class inherits from the compiled `Value`, which has none
    names: tuple[str, ...] | None = own.get("__mypyc_attrs__")
    return kind.__slots__ if names is None else names  # a compiled class has lost its slots


def replace(value: _ValueT, **changes: Any) -> _ValueT:  # noqa: ANN401
    """Return a value that differs in the named fields: for the rare branch, not for every tick.

    Raises: TypeError for a name that is no field
    """
    kind: Any = type(value)
    fields = [changes.pop(name) if name in changes else getattr(value, name) for name in
              fields_of(kind)]  # fmt: skip
    if changes:
        raise TypeError(f"{kind.__name__} has no field {', '.join(changes)}")
    return kind(*fields)  # type: ignore[no-any-return]
