"""The closed loop without wire, processes and log: plant step and controller step in turn.

The same step functions as in the processes, so the same strokes to the resolution of the wire;
what tuning and comparisons run thousands of times.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import controller.main
import controller.step
import plant.main
from controller import state as control
from controller.actuator import MAX_PULSES
from hil.config.resolved import Resolved
from hil.messages import ELECTRIC_POWER, PULSE_CLOCK_US, SLOW_ORDER, PistonSample
from plant.actuation import PulseOrder
from plant.events import Event
from plant.initial import initial_state
from plant.machine import MachineOrder
from plant.sensors import electric_power_w, sample
from plant.state import Command, DeadCentre
from plant.step import step


class Course(NamedTuple):
    """What a run came to: every dead centre, every event of the plant, the last mode."""

    dead_centres: list[DeadCentre]
    events: list[Event]
    mode: str


def simulate(scenario: Resolved) -> Course:
    """Run a resolved scenario in lockstep."""
    params = plant.main.make_params(scenario)
    settled = scenario.begins == "settled"
    state, events = initial_state(
        params,
        scenario.controller.preset.fuel_kg if settled else None,
        scenario.controller.supervisory.load_coefficient_n_s_m,
    )
    law = control.make_params(
        scenario.controller, scenario.plant.prototype, scenario.loop.period_ns
    )
    mind = control.initial_state(law)
    schedule = controller.main.schedule_of(scenario)
    course = Course([], list(events), "")
    command: Command = Command()
    for tick in range(scenario.ticks):
        sensed = PistonSample(*sample(params, state))
        carried = SLOW_ORDER[tick % len(SLOW_ORDER)] == ELECTRIC_POWER
        power_w = float(round(electric_power_w(state))) if carried else math.nan
        before = state.dead_centre.number
        state, events = step(params, state, command)
        course.events.extend(events)
        if state.dead_centre.number != before:
            course.dead_centres.append(state.dead_centre)
        inputs = control.Inputs(tick, sensed, schedule.get(tick), power_w)
        mind, output = controller.step.step(law, mind, inputs)
        command = _command_of(output)
    return course._replace(mode=mind.mode.name.lower())


def _command_of(output: control.Output) -> Command:
    """What the plant would decode of an answer."""
    machine = MachineOrder(*output.machine)
    pulses = tuple(
        PulseOrder(p.channel, p.open_ns // 1000 % PULSE_CLOCK_US, p.duration_ns // 1000)
        for p in output.pulses[:MAX_PULSES]
    )
    return Command(machine, pulses, output.may_fire)
