"""What an engine is to the rig: it begins, moves on to its own next event, says what is sensed.

An engine holds constants; what changes is its `Motion`, a value. Time is told in three ways, so
that each engine counts in the one its equations are in: seconds of the stroke, whole nanoseconds,
and nanoseconds with a fraction. Adding an engine: docs/decisions.md, "One rig, many engines".
"""

from __future__ import annotations

from typing import Any, Final, final

from mypy_extensions import i64, mypyc_attr

from hil.values import Value
from plant.engines.machine import Machine

AT_DEAD_CENTRE: Final = 0
"""The rig judges a charge at the dead centre, and says there what burns."""
BY_SPARK: Final = 1
"""The engine feels the lines: valves as they move, and a spark lights its charge at once."""
OF_ITS_OWN: Final = 2
"""The engine is told fuel and sparks ahead, and says at the dead centre whether it has burnt."""


@final
@mypyc_attr(acyclic=True, free_list_len=1)
class Motion(Value):
    """An engine between two instants.

    tau_s: time since the start of the stroke
    heading: which way the piston goes, 0 where that is what the alternation of strokes makes it
    inner: the engine's own state, opaque to the rig
    """

    __slots__ = ("x_m", "v_m_s", "tau_s", "moving", "heading", "inner")

    def __init__(
        self, x_m: float, v_m_s: float, tau_s: float, moving: bool, heading: int, inner: Any  # noqa: ANN401
    ) -> None:  # fmt: skip
        self.x_m = x_m
        self.v_m_s = v_m_s
        self.tau_s = tau_s
        self.moving = moving
        self.heading = heading
        self.inner = inner


@final
class Charge(Value):
    """What burns, or has burnt: nought is a misfire.

    lambda_ratio: air by what its fuel needs, nought when that is not known
    """

    __slots__ = ("fuel_kg", "efficiency", "lambda_ratio")

    def __init__(self, fuel_kg: float, efficiency: float, lambda_ratio: float = 0.0) -> None:
        self.fuel_kg = fuel_kg
        self.efficiency = efficiency
        self.lambda_ratio = lambda_ratio


NO_CHARGE: Final = Charge(0.0, 1.0)


@final
class Inputs(Value):
    """What acts on an engine from here on.

    valves: of each valve that its line has moved, whether it is open, -1 of any other (BY_SPARK)
    intake: pressure in the intake manifold, as a share of the open throttle's (BY_SPARK)
    fuel_kg, spark_ns: both charges as they will be by `Ahead.until_ns`, -1 no spark (OF_ITS_OWN)
    """

    __slots__ = ("machine", "valves", "fuel_kg", "spark_ns", "intake")

    def __init__(
        self,
        machine: Machine,
        valves: tuple[int, ...],
        fuel_kg: tuple[float, float],
        spark_ns: tuple[i64, i64],
        intake: float = 1.0,
    ) -> None:
        self.machine = machine
        self.valves = valves
        self.fuel_kg = fuel_kg
        self.spark_ns = spark_ns
        self.intake = intake


@final
class Ahead(Value):
    """What lies ahead in a tick, seen from the end of its last part.

    now_ns, used_s: where the last part ended, on the clock and counted from the tick's start
    until_ns: the tick's end or, for an engine that can split its steps, an instant due before it
    edge_ns: the next edge of a line; due_s, due_ns: the next disturbance, since the stroke's start
    and on the clock
    part: how many parts this tick has had
    """

    __slots__ = (
        "start_ns", "end_ns", "dt_s", "now_ns", "used_s", "until_ns", "edge_ns", "due_s", "due_ns",
        "stroke_ns", "part",
    )  # fmt: skip

    def __init__(
        self,
        start_ns: int,
        end_ns: int,
        dt_s: float,
        now_ns: float,
        used_s: float,
        until_ns: int,
        edge_ns: int,
        due_s: float,
        due_ns: float,
        stroke_ns: int,
        part: int,
    ) -> None:
        self.start_ns = start_ns
        self.end_ns = end_ns
        self.dt_s = dt_s
        self.now_ns = now_ns
        self.used_s = used_s
        self.until_ns = until_ns
        self.edge_ns = edge_ns
        self.due_s = due_s
        self.due_ns = due_ns
        self.stroke_ns = stroke_ns
        self.part = part


@final
class Stop(Value):
    """A dead centre, or a contact, which counts as one.

    lasted_s: duration of the stroke that it ends
    times: dead centres in this one step, more than one when the piston bounces
    compressed: whether the piston came to the head of the charge
    burnt: whether the engine burnt its charge, None when that is the rig's to judge
    """

    __slots__ = ("t_ns", "x_m", "lasted_s", "times", "contacts", "compressed", "burnt")

    def __init__(
        self,
        t_ns: float,
        x_m: float,
        lasted_s: float,
        times: int,
        contacts: int,
        compressed: bool,
        burnt: bool | None,
    ) -> None:
        self.t_ns = t_ns
        self.x_m = x_m
        self.lasted_s = lasted_s
        self.times = times
        self.contacts = contacts
        self.compressed = compressed
        self.burnt = burnt


@final
class Moved(Value):
    """How far an engine has come: to a stop, an edge, a disturbance, the end, or just onwards."""

    __slots__ = ("motion", "t_ns", "used_s", "stop", "at_edge", "at_due", "at_end")

    def __init__(
        self,
        motion: Motion,
        t_ns: float,
        used_s: float,
        stop: Stop | None,
        at_edge: bool,
        at_due: bool,
        at_end: bool,
    ) -> None:
        self.motion = motion
        self.t_ns = t_ns
        self.used_s = used_s
        self.stop = stop
        self.at_edge = at_edge
        self.at_due = at_due
        self.at_end = at_end


SLOW_SIGNALS: Final = ("power", "p_left", "p_right")
"""As faults of their sensors name them."""


@final
class Sensed(Value):
    """What there is to be sensed besides position and velocity."""

    __slots__ = ("p_left_pa", "p_right_pa", "electric_power_w")

    def __init__(self, p_left_pa: float, p_right_pa: float, electric_power_w: float) -> None:
        self.p_left_pa = p_left_pa
        self.p_right_pa = p_right_pa
        self.electric_power_w = electric_power_w

    def of(self, signal: str) -> float:
        """One of the `SLOW_SIGNALS`."""
        if signal == "power":
            return self.electric_power_w
        return self.p_left_pa if signal == "p_left" else self.p_right_pa


@mypyc_attr(allow_interpreted_subclasses=True)  # an engine of a user need not be compiled
class Engine:
    """An engine: `begin`, `advance`, `sensed`; the rest only where its physics has a use for it.

    ignition: who decides when a charge burns; valves: how many valve lines it has, and their lift
    splits: whether it can stop at any instant; every_stroke: whether each stroke is to fire
    """

    def __init__(
        self,
        load_coefficient_n_s_m: float,
        ignition: int,
        valves: int = 0,
        splits: bool = True,
        every_stroke: bool = True,
        valve_lift_m: float = 0.0,
    ) -> None:
        self.load_coefficient_n_s_m = load_coefficient_n_s_m
        self.ignition = ignition
        self.valves = valves
        self.splits = splits
        self.every_stroke = every_stroke
        self.valve_lift_m = valve_lift_m

    def begin(self, charge: Charge | None, load_n_s_m: float) -> Motion:
        """Begin at rest without a charge, else where that charge burns in settled running.

        Raises: ConfigError when it cannot begin so
        """
        raise NotImplementedError

    def advance(self, m: Motion, inputs: Inputs, ahead: Ahead) -> Moved:
        """Move on to whatever comes first of what lies ahead and the engine's own next stop."""
        raise NotImplementedError

    def sensed(self, m: Motion, machine: Machine) -> Sensed:
        """Return pressures and power."""
        raise NotImplementedError

    def coast(self, m: Motion, dt_s: float) -> Motion | None:
        """Move through a tick in which nothing happens; None when something does, or may."""
        return None

    def follow(self, m: Motion, machine: Machine) -> Motion:
        """Let a changed machine act from here on; it may set off a resting piston."""
        return m

    def turn(self, m: Motion, machine: Machine, charge: Charge, stop: Stop) -> Motion:
        """Begin the next stroke with what burns at the stop, or come to rest there."""
        return m

    def light(self, m: Motion, side: int, t_ns: int, fuel_kg: float) -> tuple[Motion, str]:
        """Light a charge; returns why it does not burn, an empty string when it does."""
        raise NotImplementedError

    def gaps_m(self, m: Motion) -> tuple[float, float]:
        """Distance of the piston from the left and the right head, of an engine with valves."""
        raise NotImplementedError

    def cycle(self, m: Motion, side: int) -> tuple[float, float, float] | None:
        """Peak pressure, its position and steepest rise of a side's last cycle, where it is known.

        That cycle ended at the side's last bottom dead centre.
        """
        return None

    def stroke_s(self, m: Motion, machine: Machine, now_ns: int, begun_ns: int) -> float:
        """How long the stroke under way lasts if nothing disturbs it; 0 when that is not known."""
        return 0.0


def power_w(m: Motion, machine: Machine) -> float:
    """Power P = c v^2 - F v: delivered as generator, taken up (negative) as motor."""
    v = m.v_m_s
    return machine.load_coefficient_n_s_m * v * v - machine.force_n * v
