"""Piston-motion laws: a PID that does not wind up, and no bump at the operating point."""

import math
from operator import attrgetter

import pytest

from bench.run.offline import simulate
from bench.run.resolve import resolve
from bench.studies import compare_page
from bench.studies.compare import laws_of
from controller.knowledge import operating_point
from controller.motion.law import NO_TRIM, Demand, Law, View
from controller.motion.laws import LAWS
from controller.motion.pid import Loop, pid_step
from controller.observe.estimate import MID_STROKE, Motion
from hil.config.controller import ControllerConfig, Gains, OpenLoopConfig
from hil.config.load import build
from hil.config.prototypes import NU
from hil.errors import ConfigError
from hil.values import replace

POINT = operating_point(NU, 0.0155, 810.0)


def seen(tdc_m=0.0155, v_mid_m_s=POINT.v_mid_m_s):
    """A tick at mid-stroke."""
    motion = Motion(direction=1, tdc_m=tdc_m, v_mid_m_s=v_mid_m_s, passed_mid=True)
    return View(
        dt_s=1e-3, motion=motion, passed=MID_STROKE, tdc_ref_m=0.0155, load_n_s_m=810.0,
        point=POINT, power_w=math.nan, burnt_kg=(0.0, 0.0), fuel_min_kg=0.2e-6,
        fuel_max_kg=6.0e-6, stroke_map=None,
    )  # fmt: skip


STEADY = seen()
CONFIG = ControllerConfig()
CLOSED = ["cascade", "single-loop"]


def run(name, view, strokes, state=None, config=CONFIG):
    law = LAWS[name](config)
    state, demand = law.initial() if state is None else state, None
    for _ in range(strokes):
        state, demand = law.step(state, view)
    return state, demand


def test_pid_is_proportional_plus_what_was_summed_up_before():
    gains = Gains(kp=2.0, ki=0.5)
    loop, terms = pid_step(gains, Loop(0.25), 1.0, -10.0, 10.0)
    assert (terms.u, terms.p, terms.i, terms.d) == (2.25, 2.0, 0.25, 0.0)
    assert loop.integral == 0.75


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("ki", [0.5, -0.5])
def test_pid_holds_its_integral_while_the_output_is_saturated_further_out(sign, ki):
    gains, loop = Gains(kp=2.0 * sign, ki=ki), Loop()
    for _ in range(50):
        loop, terms = pid_step(gains, loop, 3.0, -1.0, 1.0)
        assert -1.0 <= terms.u <= 1.0
    assert abs(loop.integral) <= 10.0
    if ki * sign > 0:
        assert loop.integral == 0.0


def test_pid_leaves_saturation_in_the_very_stroke_in_which_the_error_turns():
    gains, loop = Gains(kp=1.0, ki=1.0), Loop()
    for _ in range(100):
        loop, _ = pid_step(gains, loop, 5.0, -1.0, 1.0)
    _, terms = pid_step(gains, loop, -0.5, -1.0, 1.0)
    assert terms.u < 1.0


def test_pid_may_unwind_while_it_is_saturated():
    loop, terms = pid_step(Gains(kp=1.0, ki=1.0), Loop(5.0), -0.5, -1.0, 1.0)
    assert terms.u == 1.0
    assert loop.integral == 4.5


@pytest.mark.parametrize("name", CLOSED)
def test_at_the_operating_point_nothing_moves(name):
    state, demand = run(name, STEADY, 20)
    law = LAWS[name](CONFIG)
    assert law.restarted(state) == law.initial()
    assert demand.fuel_kg == pytest.approx(POINT.fuel_kg, rel=1e-12)


def test_cascade_reference_is_the_steady_speed_at_the_operating_point():
    _, demand = run("cascade", STEADY, 1)
    assert demand.v_ref_m_s == pytest.approx(POINT.v_mid_m_s)


@pytest.mark.parametrize("name", CLOSED)
@pytest.mark.parametrize("error_m", [1e-3, -1e-3])
def test_too_short_a_stroke_gets_more_fuel_and_too_long_a_one_less(name, error_m):
    speed = POINT.v_mid_m_s * (0.0155 - error_m) / 0.0155
    view = seen(tdc_m=0.0155 - error_m, v_mid_m_s=speed)
    _, demand = run(name, view, 3)
    assert (demand.fuel_kg - POINT.fuel_kg) * error_m > 0.0


@pytest.mark.parametrize("name", CLOSED)
@pytest.mark.parametrize(("tdc_m", "v", "limit"), [(0.005, 0.3, 6.0e-6), (0.0195, 4.0, 0.2e-6)])
def test_fuel_stays_within_its_limits_and_the_integrals_do_not_grow(name, tdc_m, v, limit):
    view = seen(tdc_m=tdc_m, v_mid_m_s=v)
    state, demand = run(name, view, 200)
    later, _ = run(name, view, 200, state)
    assert demand.fuel_kg == pytest.approx(limit)
    assert replace(later, noise=state.noise) == state


def test_cascade_limits_how_far_the_outer_loop_moves_the_speed():
    _, demand = run("cascade", seen(tdc_m=0.0), 100)
    most = CONFIG.cascade.v_correction_max_m_s
    assert demand.v_ref_m_s - POINT.v_mid_m_s == pytest.approx(most)


@pytest.mark.parametrize("name", CLOSED)
def test_demand_adds_up_from_its_terms(name):
    view = seen(tdc_m=0.0153, v_mid_m_s=POINT.v_mid_m_s - 0.01)
    _, demand = run(name, view, 4)
    assert demand.fuel_kg == pytest.approx(
        POINT.fuel_kg + demand.inner_p_kg + demand.inner_i_kg, rel=1e-12
    )
    if name == "cascade":
        assert demand.v_ref_m_s == pytest.approx(
            POINT.v_mid_m_s + demand.outer_p_m_s + demand.outer_i_m_s
        )


def test_single_loop_knows_nothing_of_the_speed():
    slow = run("single-loop", seen(v_mid_m_s=0.1), 5)
    fast = run("single-loop", seen(v_mid_m_s=5.0), 5)
    assert slow == fast


@pytest.mark.parametrize("fuel_kg", [None, 2.0e-6])
def test_open_loop_gives_its_fuel_whatever_happens(fuel_kg):
    config = ControllerConfig(open_loop=OpenLoopConfig(fuel_kg=fuel_kg))
    expected = POINT.fuel_kg if fuel_kg is None else fuel_kg
    for view in (STEADY, seen(tdc_m=0.001, v_mid_m_s=0.0)):
        assert run("open-loop", view, 3, config=config)[1].fuel_kg == expected


class MoreFuel(Law):
    """A law of somebody's own, which counts its strokes and looks at every tick."""

    name = "mine"

    def initial(self):
        return 0

    def step(self, state, view):
        return state + 1, Demand(1.01 * view.point.fuel_kg)

    def watch(self, state, view, planned_kg):
        return state, NO_TRIM


def test_a_law_that_watches_is_one_that_says_how():
    assert MoreFuel(CONFIG).watches
    assert not LAWS["cascade"](CONFIG).watches


def test_a_law_is_a_row_and_nothing_else(monkeypatch):
    """It can be configured, run, taken over to, compared and tuned by its name alone."""
    monkeypatch.setitem(LAWS, "mine", MoreFuel)
    tree = {
        "loop": {"clock": "lockstep"},
        "run": {"duration_s": 0.4},
        "controller": {"name": "mine"},
    }
    tree["events"] = {"back": {"kind": "law", "law": "mine", "at_s": 0.2}}
    course = simulate(resolve(build(tree, "test")))
    assert course.mode == "generating"
    assert course.dead_centres[-1].fuel_kg == pytest.approx(1.01 * POINT.fuel_kg, rel=0.02)
    assert laws_of(None)[-1] == "mine"
    assert compare_page.colour_of("mine").startswith("law")


@pytest.mark.parametrize("events", [{}, {"to": {"kind": "law", "law": "none-such", "at_s": 0.1}}])
def test_a_name_without_a_row_is_refused_with_those_that_have_one(events):
    tree = {"controller": {"name": "cascade" if events else "none-such"}, "events": events}
    key = "events.to.law" if events else "controller.name"
    with pytest.raises(ConfigError, match=f"{key} = 'none-such': accepted: cascade, single"):
        resolve(build(tree, "test"))


@pytest.mark.parametrize(("name", "law"), LAWS.items())
def test_what_may_be_tuned_is_a_key_of_the_configuration(name, law):
    for key in law.parameters:
        assert attrgetter(key)(CONFIG) > 0.0


@pytest.mark.parametrize("name", LAWS)
def test_law_is_known_by_the_name_of_the_configuration(name):
    assert ControllerConfig(name=name).name == LAWS[name].name
