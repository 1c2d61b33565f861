"""Everything that follows from declarations and is checked in: each file with what makes its text.

python -m bench.dev.generate            write them all
python -m bench.dev.generate --check    fail when one has drifted from its declarations
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from bench.dev import (
    dbc,
    foxglove_layout,
    frame_source,
    messages_page,
    record_source,
    safe_state_page,
)
from hil import compiled
from hil.wire import reference


def _reference() -> str:
    """Return docs/reference.md; what it is read off needs the frames as they are now."""
    from bench.dev import reference_page

    return reference_page.page()


OUTPUTS: Final[dict[str, Callable[[], str]]] = {
    **frame_source.modules(),
    "hil/wire/fpeg.dbc": dbc.dbc_text,
    "hil/log/packing.py": record_source.text,
    "docs/foxglove-live-layout.json": foxglove_layout.text,
    "docs/messages.md": messages_page.page,
    "docs/safe-state.md": safe_state_page.page,
    "docs/commands.md": reference.text,
    "docs/reference.md": _reference,
}
"""Text by path from the root."""


def drifted(outputs: Mapping[str, Callable[[], str]], root: Path) -> list[str]:
    """Files whose text is not what follows from the declarations."""
    return [
        name
        for name, text in outputs.items()
        if not (root / name).exists() or (root / name).read_text(encoding="utf-8") != text()
    ]


def main() -> int:
    """Write all files, or check them."""
    parser = argparse.ArgumentParser(prog="python -m bench.dev.generate")
    parser.add_argument("--check", action="store_true")
    root = compiled.root()
    if parser.parse_args().check:
        found = drifted(OUTPUTS, root)
        for name in found:
            print(f"{name} has drifted: python -m bench.dev.generate writes it", file=sys.stderr)
        return 1 if found else 0
    for name, text in OUTPUTS.items():
        (root / name).write_text(text(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
