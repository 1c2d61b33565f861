"""Every message on the wire, declared once.

A message is a value; the `Signal` of each field stands where `__init__` takes it. The straight code
that packs it (hil/wire/frames), the DBC file (hil/wire/fpeg.dbc) and the table in docs/messages.md
all follow from this module; `python -m bench.dev.generate --check` fails when one has drifted.
A tick carries at most six frames in both directions together (docs/messages.md, bus load).
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Annotated as A
from typing import Final, final

from mypy_extensions import i64

from hil.values import Value
from hil.wire.fields import Signal, message

OFF: Final = 0
MOTOR: Final = 1
GENERATOR: Final = 2
MACHINE_MODES: Final = {OFF: "off", MOTOR: "motor", GENERATOR: "generator"}


class OperatingMode(IntEnum):
    """Operating mode of the engine."""

    OFF = 0
    MOTORING = 1
    GENERATING = 2
    STOPPING = 3
    SAFE = 4


OPERATING_MODES: Final = {mode.value: mode.name.lower() for mode in OperatingMode}

FIRING_MODES: Final = (OperatingMode.MOTORING.value, OperatingMode.GENERATING.value)
"""In any other operating mode all TTL lines are low; both sides hold to it."""

INJECTOR_LEFT: Final = 0
INJECTOR_RIGHT: Final = 1
SPARK_LEFT: Final = 2
SPARK_RIGHT: Final = 3
INTAKE_LEFT: Final = 4
EXHAUST_LEFT: Final = 5
INTAKE_RIGHT: Final = 6
EXHAUST_RIGHT: Final = 7
VALVES: Final = (INTAKE_LEFT, EXHAUST_LEFT, INTAKE_RIGHT, EXHAUST_RIGHT)
CHANNELS: Final = {
    INJECTOR_LEFT: "injector_left",
    INJECTOR_RIGHT: "injector_right",
    SPARK_LEFT: "spark_left",
    SPARK_RIGHT: "spark_right",
    INTAKE_LEFT: "intake_left",
    EXHAUST_LEFT: "exhaust_left",
    INTAKE_RIGHT: "intake_right",
    EXHAUST_RIGHT: "exhaust_right",
}

ELECTRIC_POWER: Final = 0
P_LEFT: Final = 1
P_RIGHT: Final = 2
WINDING: Final = 3
SLOW_SIGNALS: Final = {
    ELECTRIC_POWER: "electric_power",
    P_LEFT: "p_left",
    P_RIGHT: "p_right",
    WINDING: "winding",
}
SLOW_ORDER: Final[tuple[int, ...]] = (ELECTRIC_POWER, P_LEFT, ELECTRIC_POWER, P_RIGHT)
"""They take turns: which one a tick carries, by its number modulo four."""

WINDING_EVERY: Final = 64
"""Where a winding's temperature is measured, it takes the right pressure's turn so often."""

UNHEARD_SAFE: Final = 15
"""The plant is in its safe state."""

PULSE_CLOCK_US: Final = 1 << 20
"""Openings are given in plant microseconds modulo this (20 bits)."""


@final
class PlantTick(Value):
    """First frame of the plant's tick: which tick, how many frames, and one slow signal.

    tick: the plant's tick, the only clock on the wire
    frame_count: frames of this tick, this one included
    slow: which slow signal this frame carries
    electric_power_w: power delivered by the machine, negative when motoring; nan if not carried
    p_left_pa: pressure in the left cylinder; nan if not carried
    p_right_pa: pressure in the right cylinder; nan if not carried
    winding_k: temperature of the machine's winding; nan if not carried
    """

    __slots__ = (
        "tick", "frame_count", "slow", "electric_power_w", "p_left_pa", "p_right_pa", "winding_k",
    )  # fmt: skip

    def __init__(
        self,
        tick: A[i64, Signal("u32")],
        frame_count: A[i64, Signal("u3", minimum=1)],
        slow: A[i64, Signal("u2", values=SLOW_SIGNALS, selects=True)],
        electric_power_w: A[float, Signal("i15", scale=1.0, unit="W", only_when=ELECTRIC_POWER)],
        p_left_pa: A[float, Signal("u15", scale=1000.0, unit="Pa", only_when=P_LEFT)],
        p_right_pa: A[float, Signal("u15", scale=1000.0, unit="Pa", only_when=P_RIGHT)],
        winding_k: A[float, Signal("u15", scale=0.02, unit="K", only_when=WINDING)] = math.nan,
    ) -> None:
        self.tick = tick
        self.frame_count = frame_count
        self.slow = slow
        self.electric_power_w = electric_power_w
        self.p_left_pa = p_left_pa
        self.p_right_pa = p_right_pa
        self.winding_k = winding_k


message(0x100, sender="plant", receiver="controller")(PlantTick)


@final
class PistonSample(Value):
    """Piston motion at the start of the tick; +x points to the right head.

    x_m: position from mid-stroke
    v_m_s: velocity
    unheard: how long no answer could be acted on: nought, or in fourteenths of what the plant
        bears; 15 when it is in its safe state
    """

    __slots__ = ("x_m", "v_m_s", "unheard")

    def __init__(
        self,
        x_m: A[float, Signal("i24", scale=1e-8, unit="m", minimum=-0.08, maximum=0.08)],
        v_m_s: A[float, Signal("i24", scale=1e-6, unit="m/s", minimum=-8.0, maximum=8.0)],
        unheard: A[int, Signal("u4")] = 0,
    ) -> None:
        self.x_m = x_m
        self.v_m_s = v_m_s
        self.unheard = unheard


message(0x101, sender="plant", receiver="controller")(PistonSample)


@final
class ValveMove(Value):
    """A valve has opened or closed, as its position switch saw it: sent once, in the next tick.

    It takes the place of a pulse: the answer to a tick that carries one has a pulse frame less.

    channel: TTL line of the valve
    is_open: whether it has opened
    t_us: the instant on the plant's clock, modulo 2^20
    """

    __slots__ = ("channel", "is_open", "t_us")

    def __init__(
        self,
        channel: A[i64, Signal("u4", values=CHANNELS)],
        is_open: A[i64, Signal("u1")],
        t_us: A[i64, Signal("u20", unit="us")],
    ) -> None:
        self.channel = channel
        self.is_open = is_open
        self.t_us = t_us


message(0x102, sender="plant", receiver="controller", per_tick=0)(ValveMove)


@final
class CylinderPeak(Value):
    """The pressure of one cycle of a cylinder, as its sensor saw it: once a stroke.

    It is sent when the cylinder is at its bottom dead centre, and as a valve's move in the place of
    a pulse; of both in one tick the valve goes first.

    side: 0 left, 1 right
    p_peak_pa: greatest pressure of the cycle
    x_peak_m: position of the piston where it was
    rise_pa_s: steepest rise of the pressure
    """

    __slots__ = ("side", "p_peak_pa", "x_peak_m", "rise_pa_s")

    def __init__(
        self,
        side: A[i64, Signal("u1")],
        p_peak_pa: A[float, Signal("u15", scale=1000.0, unit="Pa")],
        x_peak_m: A[float, Signal("i18", scale=1e-6, unit="m", minimum=-0.08, maximum=0.08)],
        rise_pa_s: A[float, Signal("u18", scale=1e6, unit="Pa/s")],
    ) -> None:
        self.side = side
        self.p_peak_pa = p_peak_pa
        self.x_peak_m = x_peak_m
        self.rise_pa_s = rise_pa_s


message(0x103, sender="plant", receiver="controller", per_tick=0)(CylinderPeak)


@final
class ControllerTick(Value):
    """First frame of the controller's answer: to which sample, how many frames, which mode.

    tick: the plant's tick that this answers
    frame_count: frames of this answer, this one included
    mode: operating mode of the engine, for whoever watches the bus
    """

    __slots__ = ("tick", "frame_count", "mode")

    def __init__(
        self,
        tick: A[i64, Signal("u32")],
        frame_count: A[i64, Signal("u3", minimum=1)],
        mode: A[i64, Signal("u3", values=OPERATING_MODES)],
    ) -> None:
        self.tick = tick
        self.frame_count = frame_count
        self.mode = mode


message(0x200, sender="controller", receiver="plant")(ControllerTick)


@final
class MachineCommand(Value):
    """What the linear machine is to do from the next tick on.

    mode: off, motor or generator
    force_n: motoring force, positive to the right head; 0 unless motoring
    load_coefficient_n_s_m: braking force per velocity; 0 unless generating
    throttle: opening, 1 is wide open
    """

    __slots__ = ("mode", "force_n", "load_coefficient_n_s_m", "throttle")

    def __init__(
        self,
        mode: A[i64, Signal("u2", values=MACHINE_MODES)],
        force_n: A[float, Signal("i20", scale=0.01, unit="N", minimum=-5000.0, maximum=5000.0)],
        load_coefficient_n_s_m: A[
            float, Signal("u20", scale=0.01, unit="N.s/m", minimum=0.0, maximum=10000.0)
        ],
        throttle: A[float, Signal("u8", scale=0.004, unit="1", minimum=0.0, maximum=1.0)],
    ) -> None:
        self.mode = mode
        self.force_n = force_n
        self.load_coefficient_n_s_m = load_coefficient_n_s_m
        self.throttle = throttle


message(0x201, sender="controller", receiver="plant")(MachineCommand)


@final
class Pulse(Value):
    """One TTL pulse, ahead of time: the line goes high at the opening and low when it is over.

    channel: which TTL line
    open_us: opening instant on the plant's clock, modulo 2^20
    duration_us: how long the line stays high; an opening always carries its closing
    """

    __slots__ = ("channel", "open_us", "duration_us")

    def __init__(
        self,
        channel: A[i64, Signal("u4", values=CHANNELS)],
        open_us: A[i64, Signal("u20", unit="us")],
        duration_us: A[i64, Signal("u20", unit="us", minimum=1)],
    ) -> None:
        self.channel = channel
        self.open_us = open_us
        self.duration_us = duration_us


message(0x202, sender="controller", receiver="plant", per_tick=2)(Pulse)


Message = (
    PlantTick | PistonSample | ValveMove | CylinderPeak | ControllerTick | MachineCommand | Pulse
)
