"""Edges ahead of time: on whole microseconds, low before the dead centre, spark in its window."""

import math

import pytest

import controller.step as control
from bench.run.offline import simulate
from bench.run.resolve import resolve
from controller.actuator import messages
from controller.observe.estimate import Motion, seconds_to_dead_centre
from controller.timing.injection import plan_injection
from controller.timing.plan import Plan, PlannedPulse, Timings
from controller.timing.spark import may_move, plan_spark
from hil.config.charge.injection import InjectorKnowledge
from hil.config.controller import ControllerConfig
from hil.config.load import build
from hil.values import replace
from hil.wire.messages import SPARK_LEFT

MS = 1_000_000
TIMINGS = Timings(ControllerConfig())
STROKE_S = 0.025
WINDOW_NS = 3_000_000
OMEGA = math.pi / STROKE_S


def at_mid_stroke(direction=1, t_ns=100 * MS, quarter_ns=12_500_000):
    return Motion(
        direction=direction, t_ns=t_ns, x_m=0.0, v_m_s=direction * 1.9, mid_t_ns=t_ns,
        passed_mid=True, quarter_ns=quarter_ns,
    )  # fmt: skip


@pytest.mark.parametrize("fuel_mg", [0.2, 1.0, 2.8185, 6.0])
def test_injection_is_high_for_dead_time_and_fuel(fuel_mg):
    plan = plan_injection(TIMINGS, at_mid_stroke(), 100 * MS, MS, STROKE_S, fuel_mg * 1e-6)
    assert plan.injection.duration_ns == pytest.approx(800_000 + fuel_mg * MS, abs=500)
    assert plan.fuel_kg == fuel_mg * 1e-6


@pytest.mark.parametrize("direction", [-1, 1])
@pytest.mark.parametrize("t_ns", [100 * MS, 100 * MS + 1, 100 * MS + 999])
@pytest.mark.parametrize("fuel_mg", [0.2, 2.81853, 6.0])
def test_injection_edges_are_on_whole_microseconds_ahead_of_the_next_tick(direction, t_ns, fuel_mg):
    plan = plan_injection(
        TIMINGS, at_mid_stroke(direction, t_ns), t_ns, MS, STROKE_S, fuel_mg * 1e-6
    )
    assert plan.injection.open_ns % 1000 == 0
    assert plan.injection.duration_ns % 1000 == 0
    assert plan.injection.open_ns >= t_ns + MS
    assert plan.injection.channel == (1 if direction > 0 else 0)


@pytest.mark.parametrize("fuel_mg", [0.2, 2.8185, 4.0])
@pytest.mark.parametrize("quarter_ns", [10_000_000, 12_500_000])
def test_injector_is_closed_before_the_dead_centre(fuel_mg, quarter_ns):
    motion = at_mid_stroke(quarter_ns=quarter_ns)
    plan = plan_injection(TIMINGS, motion, motion.t_ns, MS, STROKE_S, fuel_mg * 1e-6)
    assert plan.injection.close_ns < motion.mid_t_ns + quarter_ns


def test_no_fuel_and_no_dead_time_still_make_a_pulse_that_the_wire_takes():
    config = ControllerConfig(injector=InjectorKnowledge(dead_time_s=0.0))
    plan = plan_injection(Timings(config), at_mid_stroke(), 100 * MS, MS, STROKE_S, 0.0)
    assert plan.injection.duration_ns == 1000


def near_dead_centre(before_s, period_ns=MS):
    t_ns = 200 * MS
    v = 1.9 * math.sin(OMEGA * before_s)
    v_before = 1.9 * math.sin(OMEGA * (before_s + period_ns * 1e-9))
    return Motion(
        direction=1, t_ns=t_ns, x_m=0.01, v_m_s=v, a_m_s2=(v - v_before) / (period_ns * 1e-9)
    )


FED = Plan(injection=PlannedPulse(1, 0, 1000), fuel_kg=2e-6)


def with_spark(plan, motion):
    """The plan after a tick in which the motion is that of a free oscillation."""
    if not may_move(TIMINGS, plan, motion.t_ns, MS):
        return plan
    seconds = seconds_to_dead_centre(motion, MS * 1e-9, OMEGA)
    return plan_spark(TIMINGS, plan, motion, motion.t_ns, MS, seconds, TIMINGS.spark_advance_s)


def test_spark_waits_until_the_dead_centre_can_be_foreseen():
    ahead_s = TIMINGS.spark_ahead_s
    far = near_dead_centre(ahead_s + 2e-3)
    assert with_spark(FED, far).spark is None


@pytest.mark.parametrize("before_ms", [3.0, 4.0, 6.0])
def test_spark_is_planned_its_advance_before_the_predicted_dead_centre(before_ms):
    motion = near_dead_centre(before_ms * 1e-3)
    spark = with_spark(FED, motion).spark
    assert spark.channel == SPARK_LEFT + 1
    assert spark.open_ns % 1000 == spark.duration_ns % 1000 == 0
    wanted = motion.t_ns + round((before_ms * 1e-3 - TIMINGS.spark_advance_s) * 1e9)
    assert spark.open_ns == pytest.approx(wanted, abs=20_000)


def test_spark_that_should_be_out_by_now_is_sent_for_the_next_tick():
    motion = near_dead_centre(1.2e-3)
    spark = with_spark(FED, motion).spark
    assert spark.open_ns == motion.t_ns + MS


@pytest.mark.parametrize("ahead_ns", [-MS, 0, MS])
def test_spark_that_is_due_before_a_command_can_act_is_left_as_it_is(ahead_ns):
    motion = near_dead_centre(5e-3)
    plan = replace(FED, spark=PlannedPulse(3, motion.t_ns + ahead_ns, 1000))
    assert with_spark(plan, motion) is plan


def course_of(monkeypatch, model, rate_hz, **plant):
    """Run half a second settled; returns the course and every pulse in the form last sent."""
    step, pulses = control.step, {}

    def watched(params, state, inputs):
        state, output = step(params, state, inputs)
        for pulse in output.pulses:
            pulses[pulse.channel, pulse.close_ns // (10 * MS)] = pulse
        sent = messages(inputs.tick, output.mode, output.machine, 1.0, output.pulses)
        assert sum(type(m).__name__ == "Pulse" for m in sent) <= 2
        return state, output

    monkeypatch.setattr(control, "step", watched)
    tree = {
        "run": {"duration_s": 0.5},
        "loop": {"rate_hz": rate_hz, "clock": "lockstep"},
        "plant": {"model": model, **plant},
    }
    return simulate(resolve(build(tree, "test"))), list(pulses.values())


CELLS = [
    (model, rate_hz)
    for model in ("closed-form", "harmonic", "rectangular", "nonlinear")
    for rate_hz in (500, 1000, 5000)
]


@pytest.mark.interpreted("watches the controller's step from outside")
@pytest.mark.parametrize(("model", "rate_hz"), CELLS)
def test_spark_strikes_inside_its_window_before_every_dead_centre(monkeypatch, model, rate_hz):
    course, pulses = course_of(monkeypatch, model, rate_hz)
    assert [event for event in course.events if event.code != "disturbance"] == []
    assert len(course.dead_centres) > 15
    assert all(pulse.open_ns % 1000 == pulse.duration_ns % 1000 == 0 for pulse in pulses)
    openings = [pulse.open_ns for pulse in pulses if pulse.channel >= SPARK_LEFT]
    for dc in course.dead_centres[1:]:
        assert any(0 < dc.t_ns - t_ns < WINDOW_NS for t_ns in openings)


@pytest.mark.interpreted("watches the controller's step from outside")
@pytest.mark.parametrize("noise_x_m", [1e-6, 1e-5])
def test_spark_stays_inside_its_window_with_noisy_sensors(monkeypatch, noise_x_m):
    sensors = {"noise_x_m": noise_x_m, "noise_v_m_s": 1e-3}
    course, _ = course_of(monkeypatch, "harmonic", 1000, sensors=sensors)
    assert [event.text for event in course.events if event.code == "misfire"] == []
