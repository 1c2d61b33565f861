"""Configuration of what the controller believes of a stroke."""

from __future__ import annotations

from typing import Literal

from hil.config.base import Section


class StrokeMapConfig(Section):
    """What the model-based laws and the timing believe of a stroke (docs/control.md).

    kind: which map; the bench gives the one of the plant's model. `auto` is the linear one where
        that meets the preset's three figures, else the gas law where that does
    """

    kind: Literal["auto", "linear", "gas-law"] = "auto"
