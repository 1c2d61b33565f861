"""The shared vocabulary: messages, codec, time, configuration, ports. Imports nothing of ours.

`hil.run`, `hil.pair` and `hil.resolve` are those of `bench.api`, imported when they are first asked
for: the one name by which users of Python know the bench.
"""

from importlib import import_module as _import_module
from typing import Any as _Any

from hil import compiled as _compiled

_compiled.use()

_OF_THE_BENCH = ("run", "pair", "resolve", "Run", "Pair", "ExpectationError")


def __getattr__(name: str) -> _Any:  # noqa: ANN401
    if name in _OF_THE_BENCH:
        return getattr(_import_module("bench.api"), name)
    raise AttributeError(f"module 'hil' has no attribute {name!r}")
