"""The controller's step as a pure function: modes, safe state, misfires, commands."""

import copy
import math

import pytest

from controller.actuator import Machine, messages
from controller.build import initial_state, make_params
from controller.mode.start_restart import Mode
from controller.state import Inputs
from controller.step import step
from hil.config.controller import ControllerConfig
from hil.config.prototypes import NU
from hil.values import replace
from hil.wire.codec import Decoder, Encoder
from hil.wire.commands import OperatorCommand
from hil.wire.messages import GENERATOR, OFF, PistonSample

MS = 1_000_000
OMEGA = 2.0 * math.pi * 19.94
FULL_LOAD = 810.0


def params(period_ns=MS, **config):
    return make_params(ControllerConfig(**config), NU, period_ns)


def swing(tick, amplitude=0.0155):
    t = tick * 1e-3
    return PistonSample(-amplitude * math.cos(OMEGA * t), amplitude * OMEGA * math.sin(OMEGA * t))


def run(p, state, ticks, sample_of=swing, commands=()):
    """Step over ticks; returns the last state and all outputs."""
    commands, outputs = dict(commands), []
    for tick in ticks:
        state, output = step(p, state, Inputs(tick, sample_of(tick), commands.get(tick)))
        outputs.append(output)
    return state, outputs


def texts(outputs):
    return [text for output in outputs for _, text in output.events]


def test_same_inputs_give_the_same_outputs():
    p = params()
    first = run(p, initial_state(p), range(200))
    assert run(p, initial_state(p), range(200)) == first


def test_two_controllers_in_turn_do_not_know_of_each_other():
    p, q = params(), params(name="single-loop", tdc_ref_m=0.014)
    alone = run(p, initial_state(p), range(150))[1], run(q, initial_state(q), range(150))[1]
    states, mixed = [initial_state(p), initial_state(q)], ([], [])
    for tick in range(150):
        for number, one in enumerate((p, q)):
            states[number], output = step(one, states[number], Inputs(tick, swing(tick)))
            mixed[number].append(output)
    assert mixed == alone


def test_a_state_that_was_kept_goes_on_as_if_nothing_had_been():
    p = params()
    kept, _ = run(p, initial_state(p), range(77))
    rebuilt = copy.copy(kept)
    assert rebuilt == kept
    onward = run(p, kept, range(77, 160))
    run(p, kept, range(77, 90))
    assert run(p, rebuilt, range(77, 160)) == onward


def test_every_answer_can_be_encoded_and_names_its_tick():
    p = params()
    _, outputs = run(p, initial_state(p), range(120))
    encoder, decoder = Encoder(), Decoder("controller")
    for tick, output in enumerate(outputs):
        sent = messages(tick, output.mode, output.machine, output.throttle, output.pulses)
        head, *rest = decoder.decode(encoder.encode(sent))
        assert head.tick == tick
        assert head.frame_count == 1 + len(rest) == len(sent)


def test_settled_engine_reports_every_stroke_once():
    p = params()
    _, outputs = run(p, initial_state(p), range(260))
    strokes = [output.stroke for output in outputs if output.stroke is not None]
    assert [stroke.number for stroke in strokes] == list(range(1, len(strokes) + 1))
    assert len(strokes) == 10
    assert all(stroke.tdc_m == pytest.approx(0.0155, abs=1e-6) for stroke in strokes)
    assert [stroke.side for stroke in strokes] == [1, 0] * 5


def test_beginning_off_gives_no_order_and_no_pulse():
    p = params(running=False)
    state, outputs = run(p, initial_state(p), range(100))
    assert state.mode is Mode.OFF
    assert all(o.machine.mode == OFF and not o.pulses and not o.may_fire for o in outputs)


@pytest.mark.parametrize("stale_ticks", [3, 11])
def test_samples_that_stay_away_lead_to_the_safe_state(stale_ticks):
    p = params(limits={"stale_s": (stale_ticks - 1) * 1e-3})
    state, _ = run(p, initial_state(p), range(60))
    state, before = run(p, state, range(60, 59 + stale_ticks), lambda _: None)
    assert state.mode is Mode.GENERATING
    assert texts(before) == []
    state, (last,) = run(p, state, [59 + stale_ticks], lambda _: None)
    assert state.mode is Mode.SAFE
    assert last.events == (("mode safe", "GENERATING -> SAFE: sample lost"),)
    assert (last.machine.mode, last.machine.load_n_s_m) == (GENERATOR, FULL_LOAD)
    assert last.pulses == ()
    assert not last.may_fire


def test_one_sample_in_time_starts_the_count_anew():
    p = params()
    state = initial_state(p)
    state, _ = run(p, state, range(60))
    state, outputs = run(p, state, range(60, 200), lambda t: swing(t) if t % 10 == 9 else None)
    assert state.mode is not Mode.SAFE
    assert not any("sample lost" in text for text in texts(outputs))


def test_safe_state_stays_until_a_start_is_asked_for():
    p = params()
    state, _ = run(p, initial_state(p), range(20), lambda _: None)
    assert state.mode is Mode.SAFE
    state, outputs = run(p, state, range(20, 200))
    assert state.mode is Mode.SAFE
    assert all(output.machine.load_n_s_m == FULL_LOAD for output in outputs)
    start = OperatorCommand("start", origin="operator")
    state, outputs = run(p, state, range(200, 202), commands={200: start})
    assert state.mode is Mode.MOTORING
    assert texts(outputs) == ["start from operator", "SAFE -> MOTORING: start requested"]


def test_piston_beyond_its_limit_leads_to_the_safe_state():
    p = params()
    state, outputs = run(p, initial_state(p), range(60), lambda t: swing(t, 0.0196))
    assert state.mode is Mode.SAFE
    assert "GENERATING -> SAFE: piston beyond its limit" in texts(outputs)


def test_dead_centre_beyond_the_limit_counts_even_between_the_samples():
    """At 500 Hz the nearest samples may lie 0.15 mm inside the dead centre."""
    p = params(period_ns=2 * MS)
    shift = 0.7e-3

    def sample_of(tick):
        t = tick * 2e-3 + shift
        x = 0.019505
        return PistonSample(-x * math.cos(OMEGA * t), x * OMEGA * math.sin(OMEGA * t))

    ticks = range(1, 14)
    assert max(abs(sample_of(tick).x_m) for tick in ticks) < p.bounds.limit_m
    _, outputs = run(p, initial_state(p), ticks, sample_of)
    assert "GENERATING -> SAFE: piston beyond its limit" in texts(outputs)


def test_stop_brakes_and_ends_off_when_the_piston_stands():
    p = params()
    state, _ = run(p, initial_state(p), range(60))
    stop = OperatorCommand("stop")
    state, outputs = run(p, state, range(60, 80), commands={60: stop})
    assert state.mode is Mode.STOPPING
    assert all(o.machine == Machine(GENERATOR, 0.0, FULL_LOAD) and not o.may_fire for o in outputs)
    state, _ = run(p, state, range(80, 83), lambda _: PistonSample(0.001, 0.0005))
    assert state.mode is Mode.OFF


def failing(tick, fails_at):
    """A stroke that begins with an unburnt charge: the piston hardly leaves its dead centre."""
    sample = swing(tick)
    half = 1e3 * math.pi / OMEGA
    return replace(sample, v_m_s=0.15 * sample.v_m_s) if fails_at <= tick / half else sample


def test_charge_that_did_not_burn_is_seen_a_quarter_of_a_stroke_later():
    p = params()
    state, outputs = run(p, initial_state(p), range(60), lambda t: failing(t, 2.0))
    changes = [i for i, output in enumerate(outputs) if output.events]
    assert texts(outputs)[0] == "GENERATING -> MOTORING: misfire"
    quarter = 2.25 * 1e3 * math.pi / OMEGA
    assert changes[0] == math.ceil(quarter)
    assert state.operation.misfires == 1


def test_lost_samples_are_no_misfire():
    """Without a sample there is nothing to judge the combustion by."""
    p = params()
    dead_centre = round(2e3 * math.pi / OMEGA)
    lost = range(dead_centre + 1, dead_centre + 9)
    state, outputs = run(p, initial_state(p), range(150), lambda t: None if t in lost else swing(t))
    assert texts(outputs) == []
    assert state.mode is Mode.GENERATING


def test_set_point_of_the_operator_is_taken_and_told():
    p = params()
    command = OperatorCommand("set-point", {"tdc_ref_m": 0.0145}, origin="desk 2")
    state, outputs = run(p, initial_state(p), range(3), commands={1: command})
    assert state.set_points.tdc_ref_m == 0.0145
    assert texts(outputs) == ["set-point tdc_ref_m=0.0145 from desk 2"]


def test_set_point_beyond_the_limit_is_refused_and_told():
    p = params()
    command = OperatorCommand("set-point", {"tdc_ref_m": 0.0196}, origin="desk 2")
    state, outputs = run(p, initial_state(p), range(3), commands={1: command})
    assert state.set_points.tdc_ref_m == 0.0155
    assert [event for output in outputs for event in output.events] == [
        ("command-refused", "tdc_ref_m=0.0196 from desk 2: accepted up to 0.0192")
    ]


def test_motoring_that_gets_nowhere_gives_up():
    p = params(running=False, start={"timeout_s": 0.05})
    start = OperatorCommand("start")
    state, outputs = run(
        p, initial_state(p), range(80), lambda _: PistonSample(0.0, 0.0), {5: start}
    )
    assert state.mode is Mode.SAFE
    assert texts(outputs)[-1] == "MOTORING -> SAFE: motoring did not reach the amplitude"


def test_motoring_pushes_the_way_the_piston_moves():
    p = params(running=False)
    start = OperatorCommand("start")
    _, outputs = run(p, initial_state(p), range(60), lambda t: swing(t, 0.006), {0: start})
    for tick, output in enumerate(outputs[3:], 3):
        speed = swing(tick).v_m_s
        assert output.machine.force_n * speed >= 0.0
        assert abs(output.machine.force_n) <= 110.0
    assert max(output.machine.force_n for output in outputs) == 110.0
