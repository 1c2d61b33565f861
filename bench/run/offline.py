"""The closed loop in one thread: over a link in memory, or without wire, processes and log.

Without them the step functions of plant and controller run in turn, the same as in the processes,
so the same strokes to the resolution of the wire: what tuning and comparisons run by the thousand.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple, final

from mypy_extensions import i64

import controller.build
import controller.step
import plant.build
from controller.actuator import MAX_PULSES
from controller.loop import ControllerLoop
from controller.state import Inputs, Output
from drivers.memory_link import MemoryLink
from hil.config.resolved import Resolved
from hil.ports import Link
from hil.rounding import nearest
from hil.values import NEVER, Value
from hil.wire.commands import OperatorCommand
from hil.wire.messages import PistonSample
from hil.wire.pulses import PulseOrder, wrap_us
from plant.engines.machine import MachineOrder
from plant.loop import PlantLoop
from plant.rig.events import Event
from plant.rig.silence import unheard
from plant.rig.state import Command, DeadCentre
from plant.rig.step import step
from plant.sample_frames import beside, winding_k
from plant.sensors import sample, sensed


@final
class Silence(Value):
    """Ticks from `begin` to before `end` in which nothing comes through, one way or both."""

    __slots__ = ("begin", "end", "samples", "answers")

    def __init__(self, begin: i64, end: i64, samples: bool = True, answers: bool = True) -> None:
        self.begin = begin
        self.end = end
        self.samples = samples
        self.answers = answers

    def hides_sample(self, tick: i64) -> bool:
        """Whether the sample of a tick before the end does not reach the controller."""
        return self.samples and self.begin <= tick

    def hides_answer(self, tick: i64) -> bool:
        """Whether the answer does not reach the plant, likewise."""
        return self.answers and self.begin <= tick


NEVER_SILENT: Final = Silence(NEVER, NEVER)


def _silence_at(silences: Sequence[Silence], tick: i64) -> Silence:
    """The silence of a tick, or the next one, of those in order."""
    return next((silence for silence in silences if tick < silence.end), NEVER_SILENT)


@final
class Answerer:
    """Gives the controller its turn when a sample has been sent; `silences` in order."""

    def __init__(
        self, loop: ControllerLoop, link: MemoryLink, silences: Sequence[Silence] = ()
    ) -> None:
        self._loop = loop
        self._link = link
        self._silences = silences
        self._silence = _silence_at(silences, 0)

    def turn(self) -> None:
        """Take what was sent, and answer it."""
        tick: i64 = self._loop.tick + 1
        batch = self._link.receive()
        if tick + 1 < self._silence.begin:
            self._loop.turn(batch)
        else:
            self._turn_in_silence(tick, batch)

    def _turn_in_silence(self, tick: i64, batch: bytes | None) -> None:
        """Let the silence have the sample of this tick, and the answer that acts in the next."""
        self._silence = _silence_at(self._silences, tick)
        self._loop.turn(None if self._silence.hides_sample(tick) else batch)
        inbox = self._link.peer.inbox
        if inbox and _silence_at(self._silences, tick + 1).hides_answer(tick + 1):
            inbox[-1] = b""


def join(
    plant_end: Link, controller_end: Link, controller: ControllerLoop,
    silences: Sequence[Silence] = (),
) -> tuple[MemoryLink, MemoryLink]:  # fmt: skip
    """Let the controller answer inside the plant's send; returns both ends, known as what they are.

    Parameters: silences : in the order of their ticks

    Raises: TypeError when they are not two ends in memory
    """
    if not (isinstance(plant_end, MemoryLink) and isinstance(controller_end, MemoryLink)):
        raise TypeError("only ends in memory can be joined")
    plant_end.on_send = Answerer(controller, controller_end, silences).turn
    return plant_end, controller_end


def run_ticks(loop: PlantLoop, tick: i64, end: i64) -> int:
    """Run the plant from one tick up to another; return that tick."""
    while tick < end:
        tick = loop.turn(tick)
    return tick


class Course(NamedTuple):
    """What a run came to: dead centres, events of the plant, last mode, x and v at every tick."""

    dead_centres: list[DeadCentre]
    events: list[Event]
    mode: str
    x_m: list[float]
    v_m_s: list[float]


class _Schedule:
    """The operator's commands, and the tick of the next one."""

    def __init__(self, by_tick: dict[int, OperatorCommand]) -> None:
        self._by_tick = by_tick
        self._waiting = sorted(by_tick, reverse=True)
        self.next_tick: i64 = self._waiting[-1] if by_tick else NEVER

    def take(self) -> OperatorCommand:
        """Return the next one, and look to the one after it."""
        command = self._by_tick[self._waiting.pop()]
        self.next_tick = self._waiting[-1] if self._waiting else NEVER
        return command


def silences_of(scenario: Resolved) -> tuple[Silence, ...]:
    """The silences of a scenario's link in ticks, each of one at least."""
    rate_hz = scenario.loop.rate_hz
    found = []
    for begin_s, end_s, of in scenario.link.silences:
        begin = round(begin_s * rate_hz)
        end = max(round(end_s * rate_hz), begin + 1)
        found.append(Silence(begin, end, of != "answers", of != "samples"))
    return tuple(found)


def simulate(scenario: Resolved) -> Course:
    """Run a resolved scenario in lockstep."""
    params = plant.build.make_params(scenario)
    state, events = plant.build.begin(scenario, params)
    law = controller.build.make_params(
        scenario.controller, scenario.plant.believed(), scenario.loop.period_ns
    )
    mind = controller.build.initial_state(law)
    schedule = _Schedule(controller.build.schedule_of(scenario))
    course = Course([], list(events), "", [], [])
    said: Output | None = None
    command, ticks = Command(), scenario.ticks
    silences = silences_of(scenario)
    silence = _silence_at(silences, 0)
    tick: i64 = 0
    for tick in range(ticks):
        silence = silence if tick < silence.end else _silence_at(silences, tick)
        seen, power_w, ordered = sample(params, state), math.nan, None
        course.x_m.append(seen.x_m)
        course.v_m_s.append(seen.v_m_s)
        if tick & 1 == 0:
            power_w = float(nearest(sensed(params, state).electric_power_w))
        before, beside_it = state.dead_centre, beside(params, state)
        kelvin = winding_k(params, state, tick)
        told = PistonSample(seen.x_m, seen.v_m_s, unheard(params, state))
        state, events = step(params, state, None if silence.hides_answer(tick) else command)
        if events:
            course.events.extend(events)
        if state.dead_centre is not before and state.dead_centre.number != before.number:
            course.dead_centres.append(state.dead_centre)
        if tick == schedule.next_tick:
            ordered = schedule.take()
        inputs = Inputs(tick, None, ordered) if silence.hides_sample(tick) else Inputs(
            tick, told, ordered, power_w, 0, beside_it, kelvin
        )  # fmt: skip
        mind, output = controller.step.step(law, mind, inputs)
        if said is None or not _says_the_same(output, said):
            command = command_of(output)
        said = output
    return course._replace(mode=mind.mode.name.lower())


def _says_the_same(output: Output, before: Output) -> bool:
    """Whether an answer orders what the one before it did: most do."""
    new, old = output.machine, before.machine
    return (
        output.pulses is before.pulses
        and output.mode is before.mode
        and new.mode == old.mode
        and new.force_n == old.force_n
        and new.load_n_s_m == old.load_n_s_m
        and output.throttle == before.throttle
    )


def command_of(output: Output) -> Command:
    """What the plant would decode of an answer."""
    machine = MachineOrder(output.machine.mode, output.machine.force_n, output.machine.load_n_s_m)
    pulses = tuple(
        PulseOrder(p.channel, wrap_us(p.open_ns), p.duration_ns // 1000)
        for p in output.pulses[:MAX_PULSES]
    )
    return Command(machine, pulses, output.may_fire, output.throttle)
