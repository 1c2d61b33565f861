"""The layout of Foxglove for a running engine: that of a log, with the topics as they come live."""

from __future__ import annotations

import json
from typing import Any

from hil import compiled
from hil.log import topics

_OF_A_LOG = "docs/foxglove-layout.json"
_PARAMETERS = {"title": "Parameters"}


def text() -> str:
    """Return docs/foxglove-live-layout.json."""
    tree = json.loads((compiled.root() / _OF_A_LOG).read_text(encoding="utf-8"))
    live = _renamed(tree)
    live["configById"]["Parameters!live"] = _PARAMETERS
    live["layout"] = {
        "direction": "row",
        "first": live["layout"],
        "second": "Parameters!live",
        "splitPercentage": 80,
    }
    return json.dumps(live, indent=1) + "\n"


def _renamed(tree: Any) -> Any:  # noqa: ANN401
    """The same with each topic under the process that puts it, the plant where both do."""
    if isinstance(tree, dict):
        return {key: _renamed(value) for key, value in tree.items()}
    if isinstance(tree, list):
        return [_renamed(value) for value in tree]
    known = {topic.name: topic for topic in topics.ALL}
    topic = known.get(tree.partition(".")[0]) if isinstance(tree, str) else None
    return tree if topic is None else f"/{topic.sides[0]}{tree}"
