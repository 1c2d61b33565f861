"""Files to begin from: `hil new law|engine|prototype|scenario|suite NAME`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from hil.errors import ConfigError
from hil.files import Output

_TEMPLATES: Final = Path(__file__).parent / "templates"
KINDS: Final = {
    "law": "law.py.txt", "engine": "engine.py.txt", "prototype": "prototype.toml",
    "scenario": "scenario.toml", "suite": "suite.scenario.toml",
}  # fmt: skip
"""By what is begun, the file that it begins from."""

_NAME: Final = re.compile(r"[a-z][a-z0-9-]{0,30}")


def write(kind: str, name: str, *, force: bool) -> Path:
    """Write a file to begin from into the current directory, and return it.

    Raises: ConfigError when the name is none, or the file is there already
    """
    if not _NAME.fullmatch(name):
        raise ConfigError(f"{name!r}: accepted are small letters, figures and dashes, as in my-law")
    template = _TEMPLATES / KINDS[kind]
    ending = template.name.partition(".")[2].removesuffix(".txt")  # a template is no module of ours
    path = Path(f"{name.replace('-', '_') if ending == 'py' else name}.{ending}")
    text = template.read_text("utf-8").replace("NAME", name).replace("FILE", path.name)
    Output("hil new", path, force).write(text)
    return path
