"""What can fail, declared: sensors that lie, actuators that do not act as they are told."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from bench.trust.rig import Rig
from hil.values import replace
from hil.wire.messages import (
    GENERATOR,
    INJECTOR_LEFT,
    INJECTOR_RIGHT,
    OFF,
    SPARK_LEFT,
    SPARK_RIGHT,
    MachineCommand,
    Message,
    PistonSample,
    Pulse,
)

Sample = tuple[float, float]


class Context(NamedTuple):
    """When a fault began, and what the sensors said then."""

    first: int
    period_s: float
    held: Sample

    def since_s(self, tick: int) -> float:
        """Time since the fault began [s]."""
        return (tick - self.first) * self.period_s


SensorLie = Callable[[Context, int, float, float], Sample]
"""What the sensors say instead of position and velocity, in that tick."""


class SensorFault(NamedTuple):
    """A sensor that lies with live counters, for so long."""

    name: str
    lie: SensorLie
    duration_s: float = 1e9


class ActuatorFault(NamedTuple):
    """An order that does not arrive as it was sent; None drops it."""

    name: str
    change: Callable[[Message], Message | None]
    forces: bool = False
    """Whether the fault alone can drive the piston against a head."""


def _hold_x(c: Context, _t: int, _x: float, v: float) -> Sample:
    return c.held[0], v


def _hold_v(c: Context, _t: int, x: float, _v: float) -> Sample:
    return x, c.held[1]


def _hold(c: Context, _t: int, _x: float, _v: float) -> Sample:
    return c.held


def _affine(
    x_scale: float = 1.0, v_scale: float = 1.0, x_m: float = 0.0, v_m_s: float = 0.0
) -> SensorLie:
    def lie(_c: Context, _t: int, x: float, v: float) -> Sample:
        return x * x_scale + x_m, v * v_scale + v_m_s

    return lie


def _drift(x_m_s: float = 0.0, v_m_s2: float = 0.0) -> SensorLie:
    def lie(c: Context, t: int, x: float, v: float) -> Sample:
        return x + x_m_s * c.since_s(t), v + v_m_s2 * c.since_s(t)

    return lie


def _every(n: int, other: SensorLie) -> SensorLie:
    def lie(c: Context, t: int, x: float, v: float) -> Sample:
        return other(c, t, x, v) if (t - c.first) % n == 0 else (x, v)

    return lie


def _swapped(_c: Context, _t: int, x: float, v: float) -> Sample:
    return v * 1e-2, x * 1e2


SENSOR_FAULTS: Final = (
    SensorFault("x and v stuck", _hold),
    SensorFault("x stuck", _hold_x),
    SensorFault("v stuck", _hold_v),
    SensorFault("x and v nought", _affine(0.0, 0.0)),
    SensorFault("x nought", _affine(0.0)),
    SensorFault("v nought", _affine(1.0, 0.0)),
    SensorFault("x and v turned", _affine(-1.0, -1.0)),
    SensorFault("x turned", _affine(-1.0)),
    SensorFault("v turned", _affine(1.0, -1.0)),
    SensorFault("x jumps 20 mm for 5 ticks", _affine(x_m=0.020), 0.005),
    SensorFault("x jumps -20 mm for 5 ticks", _affine(x_m=-0.020), 0.005),
    SensorFault("x jumps 5 mm for 5 ticks", _affine(x_m=0.005), 0.005),
    SensorFault("x jumps 5 mm", _affine(x_m=0.005)),
    SensorFault("x jumps -5 mm", _affine(x_m=-0.005)),
    SensorFault("x jumps 10 mm", _affine(x_m=0.010)),
    SensorFault("x jumps 30 mm", _affine(x_m=0.030)),
    SensorFault("v jumps 2 m/s", _affine(v_m_s=2.0)),
    SensorFault("v jumps -2 m/s", _affine(v_m_s=-2.0)),
    SensorFault("v jumps 5 m/s", _affine(v_m_s=5.0)),
    SensorFault("v jumps 0.5 m/s", _affine(v_m_s=0.5)),
    SensorFault("v jumps 5 m/s for 5 ticks", _affine(v_m_s=5.0), 0.005),
    SensorFault("x half", _affine(0.5)),
    SensorFault("x double", _affine(2.0)),
    SensorFault("v half", _affine(1.0, 0.5)),
    SensorFault("v double", _affine(1.0, 2.0)),
    SensorFault("x and v half", _affine(0.5, 0.5)),
    SensorFault("x drifts by 1 m/s", _drift(1.0)),
    SensorFault("x drifts by -1 m/s", _drift(-1.0)),
    SensorFault("v drifts by 50 m/s2", _drift(0.0, 50.0)),
    SensorFault("v drifts by -50 m/s2", _drift(0.0, -50.0)),
    SensorFault("x at its end", _affine(0.0, x_m=0.08)),
    SensorFault("x at its other end", _affine(0.0, x_m=-0.08)),
    SensorFault("v at its end", _affine(1.0, 0.0, v_m_s=8.0)),
    SensorFault("v at its other end", _affine(1.0, 0.0, v_m_s=-8.0)),
    SensorFault("every other x wild", _every(2, _affine(x_m=0.010))),
    SensorFault("every third v wild", _every(3, _affine(v_m_s=3.0))),
    SensorFault("every fifth sample nought", _every(5, _affine(0.0, 0.0))),
    SensorFault("x and v swapped", _swapped),
    SensorFault("x and v stuck for 15 ms", _hold, 0.015),
    SensorFault("x stuck for 5 ms", _hold_x, 0.005),
    SensorFault("v stuck for 5 ms", _hold_v, 0.005),
    SensorFault("x stuck for 40 ms", _hold_x, 0.040),
)


def _dead(*channels: int) -> Callable[[Message], Message | None]:
    def change(message: Message) -> Message | None:
        return None if isinstance(message, Pulse) and message.channel in channels else message

    return change


def _machine(mode: int | None, force: float, load: float) -> Callable[[Message], Message | None]:
    def change(message: Message) -> Message | None:
        if not isinstance(message, MachineCommand):
            return message
        return replace(message,
            mode=message.mode if mode is None else mode, force_n=message.force_n * force,
            load_coefficient_n_s_m=message.load_coefficient_n_s_m * load,
        )  # fmt: skip

    return change


def _open_for(share: float, *channels: int) -> Callable[[Message], Message | None]:
    def change(message: Message) -> Message | None:
        if not isinstance(message, Pulse) or message.channel not in channels:
            return message
        return replace(message, duration_us=max(round(float(message.duration_us) * share), 1))

    return change


def _late(by_us: int, *channels: int) -> Callable[[Message], Message | None]:
    def change(message: Message) -> Message | None:
        if not isinstance(message, Pulse) or message.channel not in channels:
            return message
        return replace(message, open_us=(message.open_us + by_us) % (1 << 20))

    return change


_INJECTORS, _SPARKS = (INJECTOR_LEFT, INJECTOR_RIGHT), (SPARK_LEFT, SPARK_RIGHT)

ACTUATOR_FAULTS: Final = (
    ActuatorFault("left injector dead", _dead(INJECTOR_LEFT)),
    ActuatorFault("right injector dead", _dead(INJECTOR_RIGHT)),
    ActuatorFault("both injectors dead", _dead(*_INJECTORS)),
    ActuatorFault("left spark dead", _dead(SPARK_LEFT)),
    ActuatorFault("right spark dead", _dead(SPARK_RIGHT)),
    ActuatorFault("both sparks dead", _dead(*_SPARKS)),
    ActuatorFault("left cylinder dead", _dead(INJECTOR_LEFT, SPARK_LEFT)),
    ActuatorFault("right cylinder dead", _dead(INJECTOR_RIGHT, SPARK_RIGHT)),
    ActuatorFault("left spark 4 ms late", _late(4000, SPARK_LEFT)),
    ActuatorFault("right spark 4 ms early", _late(-4000, SPARK_RIGHT)),
    ActuatorFault("left injector open half as long", _open_for(0.5, INJECTOR_LEFT)),
    ActuatorFault("right injector open a tenth", _open_for(0.1, INJECTOR_RIGHT)),
    ActuatorFault("both injectors open half as long", _open_for(0.5, *_INJECTORS)),
    ActuatorFault("left injector open 1.2 times as long", _open_for(1.2, INJECTOR_LEFT), True),
    ActuatorFault("machine off", _machine(OFF, 0.0, 0.0), True),
    ActuatorFault("machine brakes half", _machine(None, 1.0, 0.5), True),
    ActuatorFault("machine brakes double", _machine(None, 1.0, 2.0)),
    ActuatorFault("machine generates at full load", _machine(GENERATOR, 0.0, 1.0)),
)


def apply_sensor(rig: Rig, fault: SensorFault, held: Sample) -> None:
    """Let the sensors lie from the rig's next tick on."""
    context = Context(rig.tick, rig.period_ns * 1e-9, held)
    last = rig.tick + fault.duration_s / context.period_s

    def tamper(tick: int, messages: Sequence[Message]) -> Sequence[Message]:
        if tick >= last:
            return messages
        return [_lying(m, *fault.lie(context, tick, m.x_m, m.v_m_s))
                if isinstance(m, PistonSample) else m for m in messages]  # fmt: skip

    rig.plant_link.tamper = tamper


def _lying(sample: PistonSample, x_m: float, v_m_s: float) -> PistonSample:
    return replace(sample, x_m=min(max(x_m, -0.08), 0.08), v_m_s=min(max(v_m_s, -8.0), 8.0))


def apply_actuator(rig: Rig, fault: ActuatorFault) -> None:
    """Let the actuators fail from the rig's next answer on."""

    def tamper(_tick: int, messages: Sequence[Message]) -> Sequence[Message]:
        changed = [fault.change(m) for m in messages]
        kept = [m for m in changed if m is not None]
        head = replace(kept[0], frame_count=len(kept))
        return [head, *kept[1:]]

    rig.controller_link.tamper = tamper
