"""Sets the TTL lines of a configuration low, whatever became of the process that drove them.

python drivers/gpio/low.py CONFIG      run as a file, since a line may be high while it is loaded:
it imports none of ours, and trusts a configuration that the service has checked before
"""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path


def main(config: Path) -> int:
    """Request the lines as low outputs and give them back; nothing to do where there are none."""
    outputs = tomllib.loads(config.read_text(encoding="utf-8")).get("outputs", {})
    if "chip" not in outputs:
        return 0
    import gpiod  # noqa: PLC0415 - an extra, and only where there are lines
    import gpiod.line  # noqa: PLC0415

    settings = gpiod.LineSettings(
        direction=gpiod.line.Direction.OUTPUT,
        output_value=gpiod.line.Value.INACTIVE,
        active_low=outputs.get("active_low", False),
    )
    offsets = tuple(outputs["lines"].values())
    gpiod.request_lines(outputs["chip"], config={offsets: settings}, consumer="low").release()
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
