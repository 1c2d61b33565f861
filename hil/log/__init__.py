"""Reading logs: `hil.log.open(path)` and what it gives."""

from hil.log.reader import Log, TopicInfo, open_log
from hil.log.reader import open_log as open

__all__ = ["Log", "TopicInfo", "open", "open_log"]
