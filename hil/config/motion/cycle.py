"""The four-stroke cycle under the controller: which strokes are driven, and where they end."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from hil.config.base import FIXED, Tunable

Newton = Annotated[float, Field(ge=-20_000.0, le=20_000.0)]
Metres = Annotated[float, Field(gt=0.0, le=1.0)]
Speed = Annotated[float, Field(gt=0.0, le=20.0)]


class CycleConfig(Tunable):
    """The machine's part in the four strokes (thesis Table 4.2), in the order of Table 3.1.

    drive: a programme of the plant's own by position, or the controller's commands
    motor_1_n, motor_3_n: force along the motion in the intake and in the compression stroke
    motor_2_n, motor_4_n: force from which the mover is stopped at the end of intake and exhaust
    brake_share: part of motor 4 from which braking begins; what is left is for what was unforeseen
    dead_centres_m, v_mid_m_s: where the four strokes end, and their speeds at mid-stroke
    first_stroke: stroke of the cycle with which a run begins
    fuel_per_tdc_kg_m, force_per_tdc_n_m: fuel that ends the power stroke a metre further (0: as the
        steady state has it), and force that ends the compression so
    gain: part of an error that one cycle corrects
    """

    drive: Literal["programme", "controller"] = Field("programme", json_schema_extra=FIXED)
    motor_1_n: Newton = 140.0
    motor_2_n: Newton = -378.0
    motor_3_n: Newton = 747.0
    motor_4_n: Newton = -4000.0
    brake_share: float = Field(default=0.8, gt=0.0, le=1.0)
    dead_centres_m: tuple[Metres, Metres, Metres, Metres] = Field(
        (0.0191, 0.0175, 0.0175, 0.0174), json_schema_extra=FIXED
    )
    v_mid_m_s: tuple[Speed, Speed, Speed, Speed] = Field(
        (0.8, 1.8, 3.5, 3.5), json_schema_extra=FIXED
    )
    first_stroke: int = Field(2, ge=0, le=3, json_schema_extra=FIXED)
    fuel_per_tdc_kg_m: float = Field(default=0.0, ge=0.0, le=1.0)
    force_per_tdc_n_m: float = Field(default=2.0e5, gt=0.0, le=1.0e7)
    gain: float = Field(default=0.7, gt=0.0, le=1.0)
