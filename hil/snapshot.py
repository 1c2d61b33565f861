"""States as text and back, exactly: what a log needs so that a run can be resumed from it.

A state is a tree of values (hil/values.py) or NamedTuples of numbers; its text is JSON, in which a
float is the shortest decimal that reads back as the same 64 bits. The classes are not in the text:
they are those of the type hints, so nothing in a file decides what is built from it. Only where a
hint leaves a choice (a union, Any) is the class named, and then it must be one already loaded.
"""

from __future__ import annotations

import ast
import json
import sys
import types
from collections.abc import Callable, Hashable, Iterator
from enum import IntEnum
from functools import cache
from operator import attrgetter
from typing import Any, Final, NamedTuple, Union, get_args, get_origin, get_type_hints

from mypy_extensions import i64

from hil import compiled
from hil.errors import LogError
from hil.values import Value, fields_of

_SCALARS = (bool, int, float, str, type(None))


class _Form(NamedTuple):
    """How a hint is written and read; None where the JSON value is the value itself."""

    write: Callable[[Any], Any] | None
    read: Callable[[Any], Any] | None


_AS_IS = _Form(None, None)
_ENCODE: Final = json.JSONEncoder(separators=(",", ":"), check_circular=False).encode


def dumps(state: Any) -> str:  # noqa: ANN401
    """Return a value as text.

    Raises: TypeError when a field is of a kind that cannot be written exactly
    """
    kind: Any = type(state)
    form = _form(kind)
    return _ENCODE(state if form.write is None else form.write(state))


def loads(kind: Hashable, text: str) -> Any:  # noqa: ANN401
    """Return the state of that class that the text holds.

    Raises: LogError when the text is of another class, or of one that has changed since
    """
    form = _form(kind)
    try:
        tree = json.loads(text)
        return tree if form.read is None else form.read(tree)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        name, why = getattr(kind, "__name__", kind), str(error) or type(error).__name__
        raise LogError(f"a snapshot that is no {name} of today: {why}") from None


@cache
def _form(hint: Hashable) -> _Form:
    """Return how values of a hint are written and read."""
    plain = _plain(hint)
    if plain is not None:
        return plain
    origin = get_origin(hint)
    if origin in (Union, types.UnionType):
        return _union(get_args(hint))
    if origin is tuple:
        return _tuple(get_args(hint))
    if _is_value(hint):
        return _named(hint)
    kinds = "numbers, strings, bytes, tuples, values and NamedTuples"
    raise TypeError(f"{hint} has no exact text: {kinds} have")


def _plain(hint: Hashable) -> _Form | None:
    """A hint that needs no look inside: a number, a text, bytes, an IntEnum, or anything."""
    if hint in _SCALARS or hint is i64:
        return _AS_IS
    if hint is bytes:
        return _Form(bytes.hex, bytes.fromhex)
    if hint is Any:
        return _Form(_write_any, _read_any)
    if isinstance(hint, type) and issubclass(hint, IntEnum):
        return _Form(None, hint)
    return None


def _is_value(kind: object) -> bool:
    if not isinstance(kind, type):
        return False
    return issubclass(kind, Value) or (issubclass(kind, tuple) and hasattr(kind, "_fields"))


def _hints(kind: Any) -> dict[str, Any]:  # noqa: ANN401
    """The type of each field; compiled classes have lost theirs, which are read from the source."""
    if not compiled.is_compiled(kind.__module__):
        return get_type_hints(kind.__init__ if issubclass(kind, Value) else kind)
    scope, found = vars(sys.modules[kind.__module__]), compiled.class_source(kind)
    return {name: eval(ast.unparse(annotation), scope) for name, annotation in _annotations(found)}


def _annotations(kind: ast.ClassDef) -> Iterator[tuple[str, ast.expr]]:
    """The fields of a class: a NamedTuple's own, or the arguments of a value's `__init__`."""
    for node in kind.body:
        if isinstance(node, ast.AnnAssign):
            yield ast.unparse(node.target), node.annotation
        elif isinstance(node, ast.FunctionDef) and node.name == "__init__":
            yield from ((a.arg, a.annotation) for a in node.args.args if a.annotation is not None)


def _named(kind: Any) -> _Form:  # noqa: ANN401
    """A value: the list of its fields."""
    hints = _hints(kind)
    is_value = issubclass(kind, Value)
    names: tuple[str, ...] = fields_of(kind) if is_value else kind._fields
    forms = [_form(hints[name]) for name in names]
    writers = [(i, form.write) for i, form in enumerate(forms) if form.write is not None]
    readers = [form.read for form in forms]

    row = _row_of(names) if is_value else tuple

    def write(value: Any) -> Any:  # noqa: ANN401
        fields = list(row(value))
        for place, writer in writers:
            fields[place] = writer(fields[place])
        return fields

    def read(tree: Any) -> Any:  # noqa: ANN401
        if not isinstance(tree, list) or len(tree) != len(names):
            raise ValueError(f"{kind.__name__} has the fields {', '.join(names)}")
        return kind(*(v if r is None else r(v) for r, v in zip(readers, tree, strict=True)))

    if not writers:
        return _Form(row if is_value else None, read)
    return _Form(write, read)


def _row_of(names: tuple[str, ...]) -> Callable[[Any], tuple[Any, ...]]:
    """Return what takes all fields of a value at once."""
    if len(names) > 1:
        return attrgetter(*names)
    return lambda value: tuple(getattr(value, name) for name in names)


def _tuple(arguments: tuple[Any, ...]) -> _Form:
    """A plain tuple, of one kind of item or of a fixed row of kinds."""
    if len(arguments) == 2 and arguments[1] is Ellipsis:
        item = _form(arguments[0])
        write, read = item
        return _Form(
            None if write is None else lambda value: [write(v) for v in value],
            tuple if read is None else lambda tree: tuple(read(v) for v in tree),
        )
    forms = [_form(argument) for argument in arguments]
    writers, readers = [f.write for f in forms], [f.read for f in forms]
    return _Form(
        lambda value: _each(writers, value) if any(writers) else value,
        lambda tree: tuple(_each(readers, tree)),
    )


def _each(functions: list[Callable[[Any], Any] | None], values: Any) -> list[Any]:  # noqa: ANN401
    pairs = zip(functions, values, strict=True)
    return [value if function is None else function(value) for function, value in pairs]


def _union(arguments: tuple[Any, ...]) -> _Form:
    """One of several: told by None or a plain value, else by the name of the class."""
    kinds = [a for a in arguments if a not in _SCALARS]
    if not kinds:
        return _AS_IS
    if len(kinds) > 1 or len(kinds) + (type(None) in arguments) < len(arguments):
        return _choice({kind.__name__: kind for kind in kinds if _is_value(kind)}, kinds)
    write, read = _form(kinds[0])
    return _Form(
        None if write is None else lambda value: None if value is None else write(value),
        None if read is None else lambda tree: None if tree is None else read(tree),
    )


def _choice(named: dict[str, Any], kinds: list[Any]) -> _Form:
    """Several values: {name: fields}."""
    if len(named) != len(kinds):
        raise TypeError(f"a choice of {kinds} has no exact text")
    forms = {name: _form(kind) for name, kind in named.items()}

    def write(value: Any) -> Any:  # noqa: ANN401
        name = type(value).__name__
        if name not in forms:
            return value
        writer = forms[name].write
        return {name: value if writer is None else writer(value)}

    def read(tree: Any) -> Any:  # noqa: ANN401
        if not isinstance(tree, dict):
            return tree
        ((name, fields),) = tree.items()
        reader = forms[name].read
        return fields if reader is None else reader(fields)

    return _Form(write, read)


def _write_any(value: Any) -> Any:  # noqa: ANN401
    if isinstance(value, _SCALARS) and not isinstance(value, IntEnum):
        return value
    if type(value) is tuple:
        return [_write_any(item) for item in value]
    kind: Any = type(value)
    writer = _form(kind).write
    name = f"{kind.__module__}:{kind.__qualname__}"
    return {name: value if writer is None else writer(value)}


def _read_any(tree: Any) -> Any:  # noqa: ANN401
    if isinstance(tree, list):
        return tuple(_read_any(item) for item in tree)
    if not isinstance(tree, dict):
        return tree
    ((name, fields),) = tree.items()
    module, _, qualified = name.partition(":")
    kind: Any = getattr(sys.modules.get(module), qualified, None)
    if not (_is_value(kind) or (isinstance(kind, type) and issubclass(kind, IntEnum))):
        raise ValueError(f"{name} is no state of today")
    reader = _form(kind).read
    return fields if reader is None else reader(fields)
