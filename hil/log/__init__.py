"""Reading logs: `hil.log.open(path)` and what it gives.

Imported when it is first asked for: a loop only packs records, and numpy would be a third of the
time in which it comes up.
"""

from __future__ import annotations

from importlib import import_module as _import_module
from typing import TYPE_CHECKING
from typing import Any as _Any

if TYPE_CHECKING:
    from hil.log.part import Span, TopicInfo
    from hil.log.reader import Log, open_log
    from hil.log.reader import open_log as open

__all__ = ["Log", "Span", "TopicInfo", "open", "open_log"]

_HOMES = {"Span": "part", "TopicInfo": "part"}


def __getattr__(name: str) -> _Any:  # noqa: ANN401
    if name in __all__:
        home = _import_module(f"hil.log.{_HOMES.get(name, 'reader')}")
        return getattr(home, "open_log" if name == "open" else name)
    raise AttributeError(f"module 'hil.log' has no attribute {name!r}")
