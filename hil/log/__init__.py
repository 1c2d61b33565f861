"""Reading logs: `hil.log.open(path)` and what it gives."""

from hil.log.part import Span, TopicInfo
from hil.log.reader import Log, open_log
from hil.log.reader import open_log as open

__all__ = ["Log", "Span", "TopicInfo", "open", "open_log"]
