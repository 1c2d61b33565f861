"""What must hold for every sample that the wire can carry, and every order of them."""

import math

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from controller.actuator import messages
from controller.build import initial_state, make_params
from controller.mode.operation import Operation
from controller.mode.start_restart import Mode
from controller.motion.pid import Loop, pid_step
from controller.observe.estimate import Motion, update
from controller.state import Inputs
from controller.step import step
from hil.config.controller import ControllerConfig, Gains
from hil.config.prototypes import NU
from hil.values import fields_of, replace
from hil.wire.codec import Encoder
from hil.wire.commands import OperatorCommand
from hil.wire.messages import FIRING_MODES, PistonSample

MS = 1_000_000
# How long an example takes says something of the machine, not of the controller.
ANY_MACHINE = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
samples = st.none() | st.builds(PistonSample, st.floats(-0.08, 0.08), st.floats(-8.0, 8.0))
commands = st.none() | st.builds(
    lambda kind, tdc: OperatorCommand(kind, {"tdc_ref_m": tdc} if kind == "set-point" else {}),
    st.sampled_from(("start", "stop", "set-point")),
    st.floats(0.001, 0.05),
)
numbers = st.floats(-1e3, 1e3)


def params(running, law):
    return make_params(ControllerConfig(running=running, name=law), NU, MS)


@ANY_MACHINE
@given(
    st.booleans(),
    st.sampled_from(["cascade", "single-loop", "open-loop"]),
    st.lists(st.tuples(samples, commands), min_size=1, max_size=80),
)
def test_whatever_is_sensed_the_answer_is_within_limits_and_fits_the_wire(running, law, story):
    p = params(running, law)
    state, encoder = initial_state(p), Encoder()
    for tick, (sample, command) in enumerate(story):
        state, output = step(p, state, Inputs(tick, sample, command))
        sent = messages(tick, output.mode, output.machine, output.throttle, output.pulses)
        encoder.encode(sent)
        assert abs(output.machine.force_n) <= p.config.limits.force_n
        assert 0.0 <= output.machine.load_n_s_m <= 10_000.0
        assert len(sent) <= 4
        assert output.may_fire == (state.mode in FIRING_MODES)
        if not output.may_fire:
            assert output.pulses == ()
        for pulse in output.pulses:
            assert pulse.open_ns % 1000 == pulse.duration_ns % 1000 == 0
            assert pulse.close_ns > tick * MS
            if pulse.channel < 2:
                fuel_kg = pulse.duration_ns * 1e-12 - 0.8e-6
                assert 0.199e-6 < fuel_kg < 6.001e-6


@ANY_MACHINE
@given(st.lists(samples, min_size=10, max_size=60))
def test_no_order_of_samples_leads_out_of_the_safe_state(story):
    p = params(True, "cascade")
    state = replace(initial_state(p), operation=Operation(Mode.SAFE))
    for tick, sample in enumerate(story):
        state, output = step(p, state, Inputs(tick, sample))
        assert state.mode is Mode.SAFE
        assert output.machine.load_n_s_m == p.supervisor.full_load_n_s_m


@ANY_MACHINE
@given(st.lists(st.tuples(samples, commands), max_size=40), st.data())
def test_a_run_can_be_cut_anywhere(story, data):
    p = params(True, "cascade")
    cut = data.draw(st.integers(0, len(story)))

    def play(state, ticks):
        outputs = []
        for tick in ticks:
            state, output = step(p, state, Inputs(tick, *story[tick]))
            outputs.append(output)
        return state, outputs

    whole, all_outputs = play(initial_state(p), range(len(story)))
    kept, first = play(initial_state(p), range(cut))
    last, second = play(kept, range(cut, len(story)))
    assert first + second == all_outputs
    assert last == whole


@ANY_MACHINE
@given(st.lists(st.tuples(st.floats(-0.08, 0.08), st.floats(-8.0, 8.0)), max_size=60))
def test_estimate_stays_finite_and_between_its_samples(story):
    motion = Motion()
    for tick, (x, v) in enumerate(story):
        before = motion
        motion, passed = update(motion, tick * MS, x, v)
        assert all(math.isfinite(getattr(motion, name)) for name in fields_of(Motion))
        assert motion.stroke == before.stroke + passed.dead_centre
        if passed.dead_centre:
            assert before.t_ns <= motion.dc_t_ns <= motion.t_ns
            assert motion.tdc_m >= 0.5e-3
        if passed.mid_stroke:
            assert before.t_ns <= motion.mid_t_ns <= motion.t_ns


@ANY_MACHINE
@given(
    numbers, numbers, numbers, st.lists(st.floats(-1.0, 1.0), max_size=60), st.floats(0.001, 10.0)
)
def test_pid_output_is_limited_and_its_integral_is_bounded(kp, ki, kd, errors, limit):
    """One step past the limit, plus what the other parts hide, is the most it can hold."""
    loop = Loop()
    for e in errors:
        loop, terms = pid_step(Gains(kp=kp, ki=ki, kd=kd), loop, e, -limit, limit)
        assert -limit <= terms.u <= limit
        assert abs(loop.integral) <= limit + 2.0 * abs(kp) + 4.0 * abs(kd) + abs(ki)
