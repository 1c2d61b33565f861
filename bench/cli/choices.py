"""What there is to choose from, by the word that stands for it in a help text.

It is looked up when a help text is shown: the command itself has no time to.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import Final


def with_choices(text: str) -> str:
    """Return a help text with the names there are in the places of `{models}`, `{laws}`..."""
    return re.sub(r"\{(\w+)\}", lambda found: ", ".join(_CHOICES[found[1]]()), text)


def _models() -> Iterable[str]:
    from hil.config.engine.models import OWN_MODELS

    return OWN_MODELS


def _prototypes() -> Iterable[str]:
    from hil.config.prototypes import PROTOTYPES

    return PROTOTYPES


def _two_chambers() -> Iterable[str]:
    from hil.config.prototypes import PROTOTYPES

    return (name for name, engine in PROTOTYPES.items() if engine.chambers == 2)


def _laws() -> Iterable[str]:
    from controller.motion.laws import LAWS

    return LAWS


def _tunable() -> Iterable[str]:
    from bench.studies.tune import TUNABLE

    return TUNABLE


def _engines() -> Iterable[str]:
    from hil.config.detailed import names

    return names()


def _campaigns() -> Iterable[str]:
    from bench.studies.campaign.config import packaged

    return packaged()


_CHOICES: Final[dict[str, Callable[[], Iterable[str]]]] = {
    "models": _models, "prototypes": _prototypes, "two_chambers": _two_chambers, "laws": _laws,
    "tunable": _tunable, "engines": _engines, "campaigns": _campaigns,
}  # fmt: skip
