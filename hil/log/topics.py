"""The topics of a log: every record with the meaning and unit of its fields.

A new topic is a new class here, one `Topic` with the next free channel number, and its
place in `ALL`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Final

from hil.log.records import EVERY_STROKE, EVERY_TICK, Field, Record, Topic
from hil.wire.messages import CHANNELS, MACHINE_MODES

SAMPLE_FRESH, SAMPLE_NONE, SAMPLE_INVALID = 0, 1, 2
LEFT, RIGHT = 0, 1
SEVERITIES: Final = {0: "info", 1: "warning", 2: "fault"}
INFO, WARNING, FAULT = SEVERITIES


def _told(names: Mapping[int, str]) -> str:
    """Numbers and what they stand for."""
    return ", ".join(f"{number} {name.replace('_', ' ')}" for number, name in names.items())


class Sensor(Record):
    """What the sensors said: the sample that the plant sent or the controller used."""

    tick: Annotated[int, Field("uint32", "number of the tick")]
    t_ns: Annotated[int, Field("int64", "start of the tick, from the start of the run", "ns")]
    x_m: Annotated[
        float, Field("float64", "position from mid-stroke, positive to the right head", "m")
    ]
    v_m_s: Annotated[float, Field("float64", "velocity, positive to the right head", "m/s")]
    p_left_pa: Annotated[float, Field("float64", "pressure in the left cylinder", "Pa")]
    p_right_pa: Annotated[float, Field("float64", "pressure in the right cylinder", "Pa")]
    electric_power_w: Annotated[float, Field("float64", "electric power of the machine", "W")]
    status: Annotated[
        int, Field("uint8", "0 fresh sample, 1 none received (last known values), 2 invalid")
    ]


class Actuator(Record):
    """What the controller commands: machine, throttle and the pulses of this tick."""

    tick: Annotated[int, Field("uint32", "number of the tick")]
    t_ns: Annotated[int, Field("int64", "start of the tick, from the start of the run", "ns")]
    answers_tick: Annotated[int, Field("uint32", "tick of the sample that this answers")]
    mode: Annotated[int, Field("uint8", f"machine mode: {_told(MACHINE_MODES)}")]
    force_n: Annotated[
        float, Field("float64", "machine force when motoring, positive to the right", "N")
    ]
    load_coefficient_n_s_m: Annotated[
        float, Field("float64", "load coefficient when generating", "N s/m")
    ]
    throttle: Annotated[float, Field("float64", "throttle opening, 0 closed to 1 open", "1")]
    pulse_count: Annotated[int, Field("uint8", "how many entries of the pulse arrays are valid")]
    pulse_channel: Annotated[
        tuple[int, int, int, int],
        Field("uint8[4]", _told(CHANNELS)),
    ]
    pulse_open_t_ns: Annotated[
        tuple[int, int, int, int],
        Field("int64[4]", "opening edges, from the start of the run", "ns"),
    ]
    pulse_duration_ns: Annotated[
        tuple[int, int, int, int], Field("int64[4]", "opening to closing", "ns")
    ]


class Stroke(Record):
    """One stroke as the controller saw it, and the terms of both loops."""

    index: Annotated[int, Field("uint32", "number of the stroke")]
    tick: Annotated[int, Field("uint32", "number of the tick in which it was told")]
    t_ns: Annotated[int, Field("int64", "start of that tick, from the start of the run", "ns")]
    side: Annotated[int, Field("uint8", "head of its dead centre: 0 left, 1 right")]
    tdc_m: Annotated[float, Field("float64", "dead centre as distance from mid-stroke", "m")]
    tdc_ref_m: Annotated[float, Field("float64", "its set point", "m")]
    v_mid_m_s: Annotated[float, Field("float64", "speed at mid-stroke", "m/s")]
    v_ref_m_s: Annotated[float, Field("float64", "its set point, from the outer loop", "m/s")]
    fuel_kg: Annotated[float, Field("float64", "fuel for the next combustion", "kg")]
    outer_p_m_s: Annotated[
        float, Field("float64", "proportional and derivative term of the outer loop", "m/s")
    ]
    outer_i_m_s: Annotated[float, Field("float64", "integral term of the outer loop", "m/s")]
    inner_p_kg: Annotated[
        float, Field("float64", "proportional and derivative term of the inner loop", "kg")
    ]
    inner_i_kg: Annotated[float, Field("float64", "integral term of the inner loop", "kg")]
    speed_hz: Annotated[
        float, Field("float64", "engine speed: cycles of two strokes a second, by this one", "Hz")
    ]
    power_w: Annotated[float, Field("float64", "mean electric power, as measured", "W")]
    power_ref_w: Annotated[
        float, Field("float64", "target power within reach, nan without a target", "W")
    ]
    lambda_ratio: Annotated[
        float, Field("float64", "air by what the fuel needs, as estimated; nan without fuel", "1")
    ]


class Truth(Record):
    """The state of the engine model, without sensors."""

    tick: Annotated[int, Field("uint32", "number of the tick")]
    t_ns: Annotated[int, Field("int64", "start of the tick, from the start of the run", "ns")]
    x_m: Annotated[
        float, Field("float64", "position from mid-stroke, positive to the right head", "m")
    ]
    v_m_s: Annotated[float, Field("float64", "velocity, positive to the right head", "m/s")]
    fuel_kg: Annotated[float, Field("float64", "fuel burnt by the last combustion", "kg")]
    load_coefficient_n_s_m: Annotated[
        float, Field("float64", "load coefficient that acts", "N s/m")
    ]
    disturbance: Annotated[int, Field("uint32", "bit set of the disturbances that act")]
    dc_index: Annotated[int, Field("uint32", "number of the last dead centre")]
    dc_t_ns: Annotated[int, Field("int64", "its instant, from the start of the run", "ns")]
    dc_x_m: Annotated[float, Field("float64", "its position from mid-stroke", "m")]
    contacts: Annotated[int, Field("uint32", "contacts with a head since the start of the run")]
    lambda_ratio: Annotated[
        float, Field("float64", "air of the last charge that burnt, by what its fuel needs", "1")
    ]
    manifold_pa: Annotated[float, Field("float64", "pressure in the intake manifold", "Pa")]


class Timing(Record):
    """When the tick was due, when it ran, and what it used."""

    tick: Annotated[int, Field("uint32", "number of the tick")]
    t_ns: Annotated[int, Field("int64", "start of the tick, from the start of the run", "ns")]
    scheduled_ns: Annotated[
        int, Field("int64", "monotonic clock from the start of the run: due", "ns")
    ]
    woke_ns: Annotated[
        int, Field("int64", "monotonic clock from the start of the run: woken", "ns")
    ]
    done_ns: Annotated[
        int, Field("int64", "monotonic clock from the start of the run: frames sent", "ns")
    ]
    used_tick: Annotated[
        int, Field("int64", "tick of the peer's frames used in this tick, -1 none, -2 none yet")
    ]
    missed: Annotated[int, Field("uint8", "1: an overrun skipped this tick")]


class Event(Record):
    """A fault, a change of mode, a command: whatever needs words."""

    tick: Annotated[int, Field("uint32", "number of the tick")]
    t_ns: Annotated[int, Field("int64", "start of the tick, from the start of the run", "ns")]
    severity: Annotated[int, Field("uint8", _told(SEVERITIES))]
    code: Annotated[str, Field("string", "short name, for programs")]
    text: Annotated[str, Field("string", "one line, for people")]


class Frames(Record):
    """The frames of one tick as they were on the link: 10 bytes each, id and 8 data bytes."""

    tick: Annotated[int, Field("uint32", "number of the tick")]
    t_ns: Annotated[int, Field("int64", "start of the tick, from the start of the run", "ns")]
    data: Annotated[
        bytes, Field("uint8[]", "u16 identifier and 8 data bytes per frame, little endian")
    ]


class Demand(Record):
    """What the piston-motion law asked for, in the tick in which it was worked out."""

    tick: Annotated[int, Field("uint32", "number of the tick")]
    t_ns: Annotated[int, Field("int64", "start of the tick, from the start of the run", "ns")]
    fuel_kg: Annotated[float, Field("float64", "fuel for the next combustion", "kg")]
    v_ref_m_s: Annotated[float, Field("float64", "set point of the mid-stroke speed", "m/s")]


class Snapshot(Record):
    """All that a process remembers at the start of a tick: a run can be resumed from it."""

    tick: Annotated[int, Field("uint32", "number of the tick that comes next")]
    t_ns: Annotated[int, Field("int64", "start of the tick, from the start of the run", "ns")]
    state: Annotated[str, Field("string", "JSON, every number exact")]


class Command(Record):
    """An operator's command as it came, in the tick in which it was taken."""

    tick: Annotated[int, Field("uint32", "number of the tick")]
    t_ns: Annotated[int, Field("int64", "start of the tick, from the start of the run", "ns")]
    origin: Annotated[str, Field("string", "who sent it")]
    data: Annotated[bytes, Field("uint8[]", "the command, JSON as it came")]


class Stimulus(Record):
    """What the stimuli of a scenario give to parameters, in the ticks in which one changes."""

    tick: Annotated[int, Field("uint32", "number of the tick")]
    t_ns: Annotated[int, Field("int64", "start of the tick, from the start of the run", "ns")]
    count: Annotated[int, Field("uint8", "how many entries are valid")]
    value: Annotated[
        tuple[float, float, float, float, float, float, float, float],
        Field("float64[8]", "of each parameter that was touched, in the order of the touching"),
    ]


class Valve(Record):
    """A valve that a controller moves has opened or closed; the record stands at that instant."""

    tick: Annotated[int, Field("uint32", "number of the tick")]
    t_ns: Annotated[int, Field("int64", "its instant, from the start of the run", "ns")]
    channel: Annotated[int, Field("uint8", _told(CHANNELS))]
    is_open: Annotated[int, Field("uint8", "1 opened, 0 closed")]
    gap_m: Annotated[float, Field("float64", "distance of the piston from the valve's head", "m")]


class Cylinder(Record):
    """The pressure of a cylinder's cycle as it was told, and what the protection takes back."""

    tick: Annotated[int, Field("uint32", "number of the tick in which it was told")]
    t_ns: Annotated[int, Field("int64", "start of that tick, from the start of the run", "ns")]
    side: Annotated[int, Field("uint8", "cylinder: 0 left, 1 right")]
    p_peak_pa: Annotated[float, Field("float64", "greatest pressure of the cycle", "Pa")]
    x_peak_m: Annotated[float, Field("float64", "position of the piston where it was", "m")]
    rise_pa_s: Annotated[float, Field("float64", "steepest rise of the pressure", "Pa/s")]
    knock_w_m2: Annotated[float, Field("float64", "ringing intensity of that rise", "W/m2")]
    verdict: Annotated[int, Field("uint8", "by its pressure: 0 not judged, 1 burnt, 2 misfired")]
    load_share: Annotated[float, Field("float64", "share of the load that is left", "1")]
    fuel_share: Annotated[
        float, Field("float64", "share of the steady fuel beyond which none is given", "1")
    ]
    retard_m: Annotated[
        float, Field("float64", "how much nearer to the head the spark is put", "m")
    ]


class Winding(Record):
    """Temperature of the machine's winding, as its model has it: once a second."""

    tick: Annotated[int, Field("uint32", "number of the tick")]
    t_ns: Annotated[int, Field("int64", "start of the tick, from the start of the run", "ns")]
    winding_k: Annotated[float, Field("float64", "temperature of the winding", "K")]
    copper_w: Annotated[float, Field("float64", "heat of the winding in the last tick", "W")]


class OfLaw(Record):
    """What a law of the user's own tells of itself with each demand; its log has its names."""

    tick: Annotated[int, Field("uint32", "number of the tick")]
    t_ns: Annotated[int, Field("int64", "start of the tick, from the start of the run", "ns")]
    value: Annotated[
        tuple[float, float, float, float, float, float, float, float],
        Field("float64[8]", "of each signal that it declares, in their order"),
    ]


SENSOR: Final[Topic] = Topic("/sensor", 1, Sensor, EVERY_TICK)
ACTUATOR: Final[Topic] = Topic("/actuator", 2, Actuator, EVERY_TICK)
STROKE: Final[Topic] = Topic("/stroke", 3, Stroke, EVERY_STROKE, ("controller",))
TRUTH: Final[Topic] = Topic("/truth", 4, Truth, EVERY_TICK, ("plant",))
TIMING: Final[Topic] = Topic("/timing", 5, Timing, EVERY_TICK)
EVENT: Final[Topic] = Topic("/event", 6, Event)
FRAMES_SENT: Final[Topic] = Topic("/frames/sent", 7, Frames, EVERY_TICK)
FRAMES_RECEIVED: Final[Topic] = Topic("/frames/received", 8, Frames, EVERY_TICK)
DEMAND: Final[Topic] = Topic("/demand", 9, Demand, EVERY_STROKE, ("controller",))
SNAPSHOT: Final[Topic] = Topic("/snapshot", 10, Snapshot)
COMMAND: Final[Topic] = Topic("/command", 11, Command)
STIMULUS: Final[Topic] = Topic("/stimulus", 12, Stimulus)
VALVE: Final[Topic] = Topic("/valve", 13, Valve)
CYLINDER: Final[Topic] = Topic("/cylinder", 14, Cylinder, EVERY_STROKE, ("controller",))
WINDING: Final[Topic] = Topic("/winding", 15, Winding)

ALL: Final[tuple[Topic, ...]] = (
    SENSOR, ACTUATOR, STROKE, TRUTH, TIMING, EVENT, FRAMES_SENT, FRAMES_RECEIVED,
    DEMAND, SNAPSHOT, COMMAND, STIMULUS, VALVE, CYLINDER, WINDING,
)  # fmt: skip

LAW: Final[Topic] = Topic("/law", 20, OfLaw, EVERY_STROKE, ("controller",))
"""In the logs of runs whose law is the user's own and declares signals."""

EVERY: Final[tuple[Topic, ...]] = (*ALL, LAW)
"""What a log may have."""

HOT: Final[tuple[Topic, ...]] = (
    SENSOR, TRUTH, TIMING, ACTUATOR, FRAMES_SENT, FRAMES_RECEIVED, STROKE, DEMAND,
)  # fmt: skip
"""Those of (nearly) every tick: hil/log/packing.py has a function for each."""
