"""The closed loop without wire, processes and log: plant step and controller step in turn.

The same step functions as in the processes, so the same strokes to the resolution of the wire;
what tuning and comparisons run thousands of times.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import controller.build
import controller.step
import plant.build
from controller.actuator import MAX_PULSES
from controller.state import Inputs, Output
from hil.config.resolved import Resolved
from hil.wire.messages import PistonSample
from hil.wire.pulses import PulseOrder, wrap_us
from plant.engines.machine import MachineOrder
from plant.rig.events import Event
from plant.rig.state import Command, DeadCentre
from plant.rig.step import step
from plant.sensors import sample, sensed


class Course(NamedTuple):
    """What a run came to: every dead centre, every event of the plant, the last mode."""

    dead_centres: list[DeadCentre]
    events: list[Event]
    mode: str


def simulate(scenario: Resolved) -> Course:
    """Run a resolved scenario in lockstep."""
    params = plant.build.make_params(scenario)
    state, events = plant.build.begin(scenario, params)
    law = controller.build.make_params(
        scenario.controller, scenario.plant.prototype, scenario.loop.period_ns
    )
    mind = controller.build.initial_state(law)
    schedule = controller.build.schedule_of(scenario)
    course = Course([], list(events), "")
    command: Command = Command()
    for tick in range(scenario.ticks):
        seen = sample(params, state)
        power_w = math.nan
        if not tick & 1:
            power_w = float(round(sensed(params, state).electric_power_w))
        before = state.dead_centre.number
        state, events = step(params, state, command)
        course.events.extend(events)
        if state.dead_centre.number != before:
            course.dead_centres.append(state.dead_centre)
        inputs = Inputs(tick, PistonSample(seen.x_m, seen.v_m_s), schedule.get(tick), power_w)
        mind, output = controller.step.step(law, mind, inputs)
        command = _command_of(output)
    return course._replace(mode=mind.mode.name.lower())


def _command_of(output: Output) -> Command:
    """What the plant would decode of an answer."""
    machine = MachineOrder(output.machine.mode, output.machine.force_n, output.machine.load_n_s_m)
    pulses = tuple(
        PulseOrder(p.channel, wrap_us(p.open_ns), p.duration_ns // 1000)
        for p in output.pulses[:MAX_PULSES]
    )
    return Command(machine, pulses, output.may_fire)
