"""Every log under the given directories is whole: it has an end, and says how it came to it."""

from __future__ import annotations

import sys
from pathlib import Path

from mcap.reader import make_reader


def told(path: Path) -> str:
    """Return how the recorder says that the log ended; fails when the log has no end."""
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None, f"{path}: no summary"
        assert summary.statistics is not None, f"{path}: no statistics"
        ends = [m.metadata["end"] for m in reader.iter_metadata() if m.name == "recorder"]
        assert len(ends) == 1, f"{path}: {len(ends)} ends"
        return f"{path.name}: {summary.statistics.message_count} messages, {ends[0]}"


def main() -> None:
    """Check all logs; some must be of processes that were killed."""
    logs = [path for place in sys.argv[1:] for path in sorted(Path(place).glob("*.mcap"))]
    lines = [told(path) for path in logs]
    print("\n".join(lines))
    assert any("without closing" in line for line in lines), "no log of a killed process"
    assert any(line.endswith("closed") for line in lines), "no log of a process that ended"


main()
