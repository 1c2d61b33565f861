"""What a Functional Mock-up Unit must offer to be the plant: its variables, units and meaning.

From this table come the check of a foreign unit, the description of an exported one and
docs/fmu.md.
"""

from __future__ import annotations

from typing import Final, NamedTuple

INPUT, OUTPUT, PARAMETER = "input", "output", "parameter"

BASE_UNITS: Final[dict[str, dict[str, int]]] = {
    "1": {},
    "m": {"m": 1},
    "m2": {"m": 2},
    "s": {"s": 1},
    "kg": {"kg": 1},
    "m/s": {"m": 1, "s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N.s/m": {"kg": 1, "s": -1},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "J/kg": {"m": 2, "s": -2},
}
"""Units of the contract by the exponents of their base units."""


class Variable(NamedTuple):
    """One variable.

    needed : whether a unit without it is refused
    whole : whether it counts
    """

    name: str
    causality: str
    unit: str
    text: str
    needed: bool = True
    whole: bool = False
    start: float = 0.0


INPUTS: Final = (
    Variable("machine_force_n", INPUT, "N", "force of the motoring machine, positive to the right"),
    Variable("load_coefficient_n_s_m", INPUT, "N.s/m", "damping by the generating machine"),
    Variable("fuel_left_kg", INPUT, "kg", "fuel in the left charge at the end of the step"),
    Variable("fuel_right_kg", INPUT, "kg", "fuel in the right charge at the end of the step"),
    Variable(
        "spark_left_s", INPUT, "s", "instant of the left charge's spark, below 0: none", start=-1.0
    ),
    Variable(
        "spark_right_s", INPUT, "s", "instant of the right charge's spark, below 0: none",
        start=-1.0,
    ),
)  # fmt: skip

OUTPUTS: Final = (
    Variable("x_m", OUTPUT, "m", "position from mid-stroke, positive to the right head"),
    Variable("v_m_s", OUTPUT, "m/s", "velocity, positive to the right head"),
    Variable("p_left_pa", OUTPUT, "Pa", "pressure in the left cylinder", needed=False),
    Variable("p_right_pa", OUTPUT, "Pa", "pressure in the right cylinder", needed=False),
    Variable(
        "electric_power_w", OUTPUT, "W", "electric power, positive when delivered", needed=False
    ),
    Variable("dc_t_s", OUTPUT, "s", "instant of the last dead centre", needed=False),
    Variable("dc_x_m", OUTPUT, "m", "position of the last dead centre", needed=False),
    Variable("fuel_burnt_kg", OUTPUT, "kg", "fuel that burnt at it, 0: none", needed=False),
    Variable(
        "dead_centres", OUTPUT, "1", "dead centres since the start", needed=False, whole=True
    ),
    Variable("contacts", OUTPUT, "1", "contacts with a head since the start", needed=False,
             whole=True),
)  # fmt: skip

BEGINNING: Final = (
    Variable(
        "start_x_m", PARAMETER, "m", "position at the start of the run", needed=False
    ),
    Variable(
        "start_fuel_kg", PARAMETER, "kg",
        "fuel that burns at the start, a dead centre; 0: the run begins at rest", needed=False,
    ),
)  # fmt: skip

ALL: Final = (*INPUTS, *OUTPUTS, *BEGINNING)
DEAD_CENTRE: Final = ("dead_centres", "dc_t_s", "dc_x_m")
"""Outputs that are of use only together; without them dead centres are found between ticks."""

ORIGIN: Final = "fpeg-hil"
"""Tool that an exported unit names; its model is called MODEL.PROTOTYPE."""
