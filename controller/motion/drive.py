"""The machine of a four-stroke engine: which strokes it drives, with what force, where it brakes.

Of the four strokes (thesis Tables 3.1, 4.2) the power strokes of left and right cylinder are 2 and
3. The machine drives the mover through stroke 0 (left takes in, right exhausts) and stroke 1 (left
compresses, right takes in), and stops it at the end of strokes 0 and 3, where an open valve lets
the air out that would.

A force is ordered a tick ahead, so that it is found for where the mover will be by then; in a tick
in which the mover turns it is the mean of what belongs before and after.
"""

from __future__ import annotations

from typing import Final, final

from controller.observe.estimate import Motion
from hil.config.motion.cycle import CycleConfig
from hil.config.prototypes import Prototype
from hil.values import Value, replace

INTAKE, COMPRESSION, POWER, EXHAUST = range(4)
"""The strokes by what the left cylinder does in them."""

_NEAREST_M: Final = 0.1e-3
"""Nearer to where it is to stop v^2 / 2 d has no meaning left: the most is ordered."""


@final
class Cycle:
    """Section `cycle` of the configuration, read once for all ticks.

    stops_m: where strokes 0 to 3 are to end, as distances from mid-stroke
    """

    def __init__(self, config: CycleConfig, engine: Prototype, period_s: float) -> None:
        self.first = config.first_stroke
        self.forces_n = (config.motor_1_n, config.motor_3_n, 0.0, 0.0)
        self.brakes_n = (config.motor_2_n, 0.0, 0.0, config.motor_4_n * config.brake_share)
        self.stops_m = config.dead_centres_m
        self.force_per_tdc_n_m = config.force_per_tdc_n_m
        self.gain = config.gain
        self.peak_n = engine.peak_force_n
        self.mass_kg = engine.moving_mass_kg
        self.period_s = period_s

    def stroke_of(self, motion: Motion) -> int:
        """Which of the four strokes is under way."""
        return int(motion.stroke + self.first) % 4


@final
class Drive(Value):
    """What the machine was ordered, and what has been learnt.

    force_n: mean force on the mover of the order that acts until the next tick, and of the one
        before it, along +x; generates: whether the order is to generate
    brakes: whether the mover is being stopped; compression_n: what is added to motor 3
    """

    __slots__ = ("force_n", "before_n", "brakes", "compression_n", "generates")

    def __init__(
        self, force_n: float = 0.0, before_n: float = 0.0, brakes: bool = False,
        compression_n: float = 0.0, generates: bool = False,
    ) -> None:  # fmt: skip
        self.force_n = force_n
        self.before_n = before_n
        self.brakes = brakes
        self.compression_n = compression_n
        self.generates = generates


AT_REST: Final = Drive()


def counted(before: Motion, after: Motion) -> Motion:
    """The motion behind a dead centre; one at the same head as the last is a rebound, no stroke."""
    if before.dc_t_ns < 0 or before.side != after.side:
        return after
    return replace(after, stroke=before.stroke)


def learn(cycle: Cycle, drive: Drive, motion: Motion, tdc_ref_m: float) -> Drive:
    """Correct the force of the compression by where it has ended (stroke 1 has just done so)."""
    if cycle.stroke_of(motion) != POWER:
        return Drive(drive.force_n, drive.before_n, False, drive.compression_n)
    error_m = tdc_ref_m - motion.tdc_m
    more_n = drive.compression_n + cycle.gain * cycle.force_per_tdc_n_m * error_m
    most_n = 0.5 * cycle.forces_n[COMPRESSION]
    return Drive(drive.force_n, drive.before_n, False, min(max(more_n, -most_n), most_n))


def order(
    cycle: Cycle, drive: Drive, motion: Motion, load_n_s_m: float, motoring_n: float
) -> Drive:
    """Find the machine's order for the tick after the next sample.

    Parameters: motoring_n : force that drives what no charge does, 0 while the engine fires
    """
    h, way = cycle.period_s, -1.0 if motion.direction < 0 else 1.0
    stroke = cycle.stroke_of(motion)
    rest_n = cycle.mass_kg * motion.a_m_s2 - drive.before_n  # gas and friction, over the last tick
    a = (rest_n + drive.force_n) / cycle.mass_kg
    z = motion.z_m + h * (motion.speed_m_s + 0.5 * h * way * a)
    v = motion.speed_m_s + h * way * a
    if v <= 0.0 and motion.z_m > 0.0:  # it will have turned by then
        after = _driven(cycle, drive, (stroke + 1) % 4, motoring_n)
        return _ordered(drive, -way * after, abs(v), load_n_s_m, after == 0.0)
    force_n, brakes = _along(cycle, drive, stroke, z, v, way * rest_n, motoring_n)
    generates = force_n == 0.0 and not brakes
    if not generates:
        force_n = _to_the_turn(
            cycle, drive, stroke, force_n, z, v, way * rest_n, brakes, motoring_n
        )
    drive = Drive(drive.force_n, drive.before_n, brakes, drive.compression_n)
    return _ordered(drive, way * force_n, way * v, load_n_s_m, generates)


def _driven(cycle: Cycle, drive: Drive, stroke: int, motoring_n: float) -> float:
    """Force along the motion with which a stroke begins [N]; 0 where the machine generates."""
    if stroke == COMPRESSION:
        return cycle.forces_n[COMPRESSION] + drive.compression_n
    return cycle.forces_n[stroke] or motoring_n


def _along(
    cycle: Cycle, drive: Drive, stroke: int, z: float, v: float, rest_n: float, motoring_n: float
) -> tuple[float, bool]:
    """Force along the motion, and whether it brakes.

    F = -m v^2 / (2 d) - F_rest stops the mover after the way d; the braking begins where that is as
    much as the configured force.
    """
    driven_n, brake_n = _driven(cycle, drive, stroke, motoring_n), cycle.brakes_n[stroke]
    if brake_n == 0.0 or z < 0.0:
        return driven_n, False
    way_m = cycle.stops_m[stroke] - z
    needed_n = -cycle.peak_n
    if way_m > _NEAREST_M:
        needed_n = -0.5 * cycle.mass_kg * v * v / way_m - rest_n
    if not drive.brakes and needed_n > brake_n:
        return driven_n, False
    most_n = driven_n if driven_n > 0.0 else 0.0
    return min(max(needed_n, -cycle.peak_n), most_n), True


def _to_the_turn(
    cycle: Cycle, drive: Drive, stroke: int, force_n: float, z: float, v: float, rest_n: float,
    brakes: bool, motoring_n: float,
) -> float:  # fmt: skip
    """The force of a tick in which the mover turns, if it does.

    Braked, it has turned by the tick's end, F = -m v / h - F_rest - F_next: while it creeps on, no
    valve opens that would let it turn. Else the mean of this stroke's force and the next one's.
    """
    slowing = -(rest_n + force_n) / cycle.mass_kg
    if z < 0.0 or slowing * cycle.period_s <= v:
        return force_n
    after_n = _driven(cycle, drive, (stroke + 1) % 4, motoring_n)
    if brakes:
        return max(-cycle.mass_kg * v / cycle.period_s - rest_n - after_n, -cycle.peak_n)
    share = v / (slowing * cycle.period_s)
    return share * force_n - (1.0 - share) * after_n


def _ordered(
    drive: Drive, force_n: float, v_m_s: float, load_n_s_m: float, generates: bool
) -> Drive:
    """The drive that has given an order."""
    mean_n = -load_n_s_m * v_m_s if generates else force_n
    return Drive(mean_n, drive.force_n, drive.brakes, drive.compression_n, generates)
