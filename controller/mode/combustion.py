"""Whether the last charge has burnt, from the speed that the piston has reached since."""

from __future__ import annotations

import math
from typing import Final

from controller.motion.maps.stroke_map import StrokeMap
from controller.motion.prediction import speeds
from controller.observe.estimate import Motion
from controller.supervisory import SetPoints

MISFIRE_SHARE: Final = 0.3
"""Of what a charge adds to the speed: with less it has not burnt."""

MISFIRE_SPEED_RATIO: Final = 0.6
"""Below this share of the expected speed it has not: the air springs alone give 0.2 to 0.45."""


def has_misfired(
    stroke_map: StrokeMap | None, motion: Motion, set_points: SetPoints,
    burnt_kg: tuple[float, float],
) -> bool:  # fmt: skip
    """Compare the speed reached since the dead centre with that of a burnt charge.

    By the stroke's map the speed is near that of a stroke with no charge: of a weak charge the load
    is not to be taken off. Without a map v = v_mid sin(pi t / T), scaled by the dead centre from
    which the piston started.
    """
    if stroke_map is not None:
        charge_kg = burnt_kg[0] if motion.side == 0 else burnt_kg[1]
        fired, unfired = speeds(stroke_map, motion, set_points.load_n_s_m, charge_kg)
        return motion.speed_m_s < unfired + MISFIRE_SHARE * (fired - unfired)
    scale = motion.tdc_m / set_points.tdc_ref_m
    expected = set_points.point.v_mid_m_s * scale * math.sqrt(0.5)  # sin(pi / 4)
    return motion.speed_m_s < MISFIRE_SPEED_RATIO * expected
