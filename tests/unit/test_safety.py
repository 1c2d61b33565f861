"""The last limit: whatever the layers above want."""

import math

import pytest

from controller import safety
from controller.actuator import Machine
from controller.motion.law import Demand
from hil.config.controller import LimitsConfig
from hil.values import replace
from hil.wire.messages import GENERATOR, MOTOR

LIMITS = safety.Limits(LimitsConfig(force_n=4000.0))


@pytest.mark.parametrize(
    ("wanted", "throttle", "given"),
    [
        (3.0e-6, 1.0, 3.0e-6),
        (0.0, 1.0, 0.2e-6),
        (-1.0, 1.0, 0.2e-6),
        (9.0e-6, 1.0, 6.0e-6),
        (9.0e-6, 0.5, 3.0e-6),
        (9.0e-6, 0.01, 0.2e-6),
    ],
)
def test_fuel_stays_within_injector_and_throttle(wanted, throttle, given):
    demand = Demand(wanted, v_ref_m_s=1.9, outer_p_m_s=0.1)
    limited = safety.limit_fuel(LIMITS, throttle * LIMITS.fuel_max_kg, demand)
    assert limited.fuel_kg == pytest.approx(given)
    assert replace(limited, fuel_kg=wanted) == demand


@pytest.mark.parametrize(
    ("wanted", "given"),
    [(110.0, 110.0), (-4000.0, -4000.0), (4000.1, 4000.0), (-1e9, -4000.0), (math.inf, 4000.0)],
)
def test_force_stays_within_its_limit(wanted, given):
    assert safety.limit_machine(LIMITS, Machine(MOTOR, wanted)).force_n == given


@pytest.mark.parametrize("load", [-1.0, 10_000.1, math.inf, math.nan])
def test_load_that_no_machine_has_becomes_none(load):
    assert safety.limit_machine(LIMITS, Machine(GENERATOR, 0.0, load)).load_n_s_m == 0.0


def test_force_that_is_no_number_becomes_none():
    assert safety.limit_machine(LIMITS, Machine(MOTOR, math.nan, 0.0)).force_n == 0.0
