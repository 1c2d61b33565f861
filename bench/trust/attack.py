"""What an attack is, and what comes of many tries of it."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple


class Tally(NamedTuple):
    """Tries of one attack; `lost` has a line for each that the promise did not survive.

    noted: figures worth a place in the table
    """

    tried: int
    lost: tuple[str, ...] = ()
    noted: str = ""

    @property
    def survived(self) -> int:
        """How many the promise survived."""
        return self.tried - len(self.lost)


class Field(NamedTuple):
    """Where an attack takes place: a directory of its own, and whether few tries are made."""

    directory: Path
    quick: bool
    dice: random.Random
    say: Callable[[str], None]

    def tries(self, quick: int, full: int) -> int:
        """Return how many tries are made."""
        return quick if self.quick else full


class Attack(NamedTuple):
    """One row: its kind, what is done, what has to hold, and the function that tries it."""

    kind: str
    does: str
    promise: str
    tries: Callable[[Field], Tally]
