"""Names of the files of a log that is written in segments.

The file that is being written has the log's own name; a finished one gets a number into it:
plant.0001.mcap, plant.0002.mcap, ... and plant.mcap, in the order of time.
"""

from __future__ import annotations

import re
from pathlib import Path


def segments_before(path: Path) -> list[Path]:
    """Return the finished segments of a log that are still there, oldest first."""
    pattern = re.compile(re.escape(path.stem) + r"\.(\d{4,})" + re.escape(path.suffix))
    numbered = [
        (int(match[1]), other)
        for other in path.parent.glob(f"*{path.suffix}")
        if (match := pattern.fullmatch(other.name))
    ]
    return [other for _, other in sorted(numbered)]


def segment_path(path: Path, number: int) -> Path:
    """Return the name that a finished segment of a log gets."""
    return path.with_name(f"{path.stem}.{number:04d}{path.suffix}")
