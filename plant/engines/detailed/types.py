"""Arrays of the compiled step, and the state of a detailed engine as part of a plant's state."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]


class GasState(NamedTuple):
    """The detailed engine between two ticks, as a value: y and d are the bytes of the arrays.

    ignited_kg, efficiency: the charge lit in the stroke under way, nought when none is
    stroke_s: duration of the stroke before
    """

    y: bytes
    d: bytes
    ignited_kg: float
    efficiency: float
    stroke_s: float
    p_left_pa: float
    p_right_pa: float
    electric_power_w: float
