"""Piston-motion laws: a PI that does not wind up, and no bump at the operating point."""

import pytest

from controller.knowledge import operating_point
from controller.laws import LAWS
from controller.laws.interface import StrokeFacts
from controller.laws.pi import pi_step
from hil.config.controller import ControllerConfig, Gains, OpenLoopConfig
from hil.config.prototypes import NU

POINT = operating_point(NU, 0.0155, 810.0)
FACTS = StrokeFacts(0.0155, 0.0155, POINT.v_mid_m_s, POINT, 0.2e-6, 6.0e-6)
CONFIG = ControllerConfig()
CLOSED = ["cascade", "single-loop"]


def run(name, facts, strokes, state=None, config=CONFIG):
    law = LAWS[name]
    state, demand = law.initial if state is None else state, None
    for _ in range(strokes):
        state, demand = law.step(config, state, facts)
    return state, demand


def test_pi_is_proportional_plus_what_was_summed_up_before():
    gains = Gains(kp=2.0, ki=0.5)
    integral, terms = pi_step(gains, 0.25, 1.0, -10.0, 10.0)
    assert terms == (2.25, 2.0, 0.25)
    assert integral == 0.75


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("ki", [0.5, -0.5])
def test_pi_holds_its_integral_while_the_output_is_saturated_further_out(sign, ki):
    gains, integral = Gains(kp=2.0 * sign, ki=ki), 0.0
    for _ in range(50):
        integral, terms = pi_step(gains, integral, 3.0, -1.0, 1.0)
        assert -1.0 <= terms.u <= 1.0
    assert abs(integral) <= 10.0
    if ki * sign > 0:
        assert integral == 0.0


def test_pi_leaves_saturation_in_the_very_stroke_in_which_the_error_turns():
    gains, integral = Gains(kp=1.0, ki=1.0), 0.0
    for _ in range(100):
        integral, _ = pi_step(gains, integral, 5.0, -1.0, 1.0)
    _, terms = pi_step(gains, integral, -0.5, -1.0, 1.0)
    assert terms.u < 1.0


def test_pi_may_unwind_while_it_is_saturated():
    integral, terms = pi_step(Gains(kp=1.0, ki=1.0), 5.0, -0.5, -1.0, 1.0)
    assert terms.u == 1.0
    assert integral == 4.5


@pytest.mark.parametrize("name", CLOSED)
def test_at_the_operating_point_nothing_moves(name):
    state, demand = run(name, FACTS, 20)
    assert state == LAWS[name].initial
    assert demand.fuel_kg == pytest.approx(POINT.fuel_kg, rel=1e-12)


def test_cascade_reference_is_the_steady_speed_at_the_operating_point():
    _, demand = run("cascade", FACTS, 1)
    assert demand.v_ref_m_s == pytest.approx(POINT.v_mid_m_s)


@pytest.mark.parametrize("name", CLOSED)
@pytest.mark.parametrize("error_m", [1e-3, -1e-3])
def test_too_short_a_stroke_gets_more_fuel_and_too_long_a_one_less(name, error_m):
    speed = POINT.v_mid_m_s * (0.0155 - error_m) / 0.0155
    facts = FACTS._replace(tdc_m=0.0155 - error_m, v_mid_m_s=speed)
    _, demand = run(name, facts, 3)
    assert (demand.fuel_kg - POINT.fuel_kg) * error_m > 0.0


@pytest.mark.parametrize("name", CLOSED)
@pytest.mark.parametrize(("tdc_m", "v", "limit"), [(0.005, 0.3, 6.0e-6), (0.0195, 4.0, 0.2e-6)])
def test_fuel_stays_within_its_limits_and_the_integrals_do_not_grow(name, tdc_m, v, limit):
    facts = FACTS._replace(tdc_m=tdc_m, v_mid_m_s=v)
    state, demand = run(name, facts, 200)
    later, _ = run(name, facts, 200, state)
    assert demand.fuel_kg == pytest.approx(limit)
    assert later == state


def test_cascade_limits_how_far_the_outer_loop_moves_the_speed():
    _, demand = run("cascade", FACTS._replace(tdc_m=0.0), 100)
    most = CONFIG.cascade.v_correction_max_m_s
    assert demand.v_ref_m_s - POINT.v_mid_m_s == pytest.approx(most)


@pytest.mark.parametrize("name", CLOSED)
def test_demand_adds_up_from_its_terms(name):
    facts = FACTS._replace(tdc_m=0.0153, v_mid_m_s=POINT.v_mid_m_s - 0.01)
    _, demand = run(name, facts, 4)
    assert demand.fuel_kg == pytest.approx(
        POINT.fuel_kg + demand.inner_p_kg + demand.inner_i_kg, rel=1e-12
    )
    if name == "cascade":
        assert demand.v_ref_m_s == pytest.approx(
            POINT.v_mid_m_s + demand.outer_p_m_s + demand.outer_i_m_s
        )


def test_single_loop_knows_nothing_of_the_speed():
    slow = run("single-loop", FACTS._replace(v_mid_m_s=0.1), 5)
    fast = run("single-loop", FACTS._replace(v_mid_m_s=5.0), 5)
    assert slow == fast


@pytest.mark.parametrize("fuel_kg", [None, 2.0e-6])
def test_open_loop_gives_its_fuel_whatever_happens(fuel_kg):
    config = ControllerConfig(open_loop=OpenLoopConfig(fuel_kg=fuel_kg))
    expected = POINT.fuel_kg if fuel_kg is None else fuel_kg
    for facts in (FACTS, FACTS._replace(tdc_m=0.001, v_mid_m_s=0.0)):
        assert run("open-loop", facts, 3, config=config)[1].fuel_kg == expected


@pytest.mark.parametrize("name", LAWS)
def test_law_is_known_by_the_name_of_the_configuration(name):
    assert ControllerConfig(name=name).name == LAWS[name].name
