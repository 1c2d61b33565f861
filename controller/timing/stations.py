"""When the piston is where: crossings of fixed positions, measured, and from them those to come.

A valve is ordered an actuator's delay before it is to move, often before mid-stroke or before the
dead centre of the stroke before, so that what is needed is not the end of a stroke but the way
there. The piston does in a stroke what it did in the last one of that phase of the cycle:

    t_j = t_i + (tau_j - tau_i) v_i / v_i'        i the last station passed, v_i' its speed now

A station is a position in the direction of motion, z from mid-stroke; times of crossing are those
of the cubic through two samples, so that in a steady state a prediction repeats to the digit.
"""

from __future__ import annotations

import math
from typing import Final, final

from mypy_extensions import i64

from controller.observe.estimate import Motion, crossing_between
from hil.rounding import nearest
from hil.values import Value

_MOST_RATIO: Final = 1.25
_SLOWEST_M_S: Final = 0.1
_TRUST: Final = 0.4
"""Part of the way from a profile to the stroke just seen that is gone."""

_DWELL_NS: Final = 500_000
"""A dead centre so much later than the deceleration before it foretold is one the piston dwells at.

What then sets it off is the valve that is to open there: its edge must not wait for the piston.
"""


@final
class Profile(Value):
    """A stroke as it was: seconds from its dead centre to each station, speed there, duration.

    is_seen: whether it was; before, its duration is believed and the way there is not
    """

    __slots__ = ("tau_s", "speed_m_s", "duration_s", "is_seen")

    def __init__(
        self, tau_s: tuple[float, ...], speed_m_s: tuple[float, ...], duration_s: float,
        is_seen: bool = True,
    ) -> None:  # fmt: skip
        self.tau_s = tau_s
        self.speed_m_s = speed_m_s
        self.duration_s = duration_s
        self.is_seen = is_seen


@final
class Passage(Value):
    """The stroke under way, and the last one of each phase of the cycle.

    phase: of the stroke under way; begun_ns, start_m: its dead centre
    t_ns, speed_m_s: of each station that it has passed
    ends_ns: where its deceleration leads to, as last seen at a speed that tells, -1 not yet
    """

    __slots__ = ("phase", "begun_ns", "start_m", "t_ns", "speed_m_s", "profiles", "ends_ns")

    def __init__(
        self, phase: int, begun_ns: i64, start_m: float, t_ns: tuple[int, ...],
        speed_m_s: tuple[float, ...], profiles: tuple[Profile, ...], ends_ns: i64 = -1,
    ) -> None:  # fmt: skip
        self.phase = phase
        self.begun_ns = begun_ns
        self.start_m = start_m
        self.t_ns = t_ns
        self.speed_m_s = speed_m_s
        self.profiles = profiles
        self.ends_ns = ends_ns

    @property
    def is_seen(self) -> bool:
        """Whether each stroke of the cycle has been seen."""
        return all(profile.is_seen for profile in self.profiles)


def sine_profile(stations_m: tuple[float, ...], amplitude_m: float, duration_s: float) -> Profile:
    """A stroke of an oscillation  z = -X cos(pi tau / T),  with which a run begins."""
    angles = [math.acos(-min(max(z / amplitude_m, -1.0), 1.0)) for z in stations_m]
    speed = amplitude_m * math.pi / duration_s
    return Profile(
        tuple([duration_s * angle / math.pi for angle in angles]),
        tuple([speed * math.sin(angle) for angle in angles]), duration_s, is_seen=False,
    )  # fmt: skip


def follow(
    stations_m: tuple[float, ...], passage: Passage, before: Motion, after: Motion,
    dead_centre: bool,
) -> Passage:  # fmt: skip
    """Enter a sample: a dead centre, and the stations passed since the sample before.

    Parameters: before, after : motion at the sample before and at this one
    """
    if after.direction == 0:
        return passage
    if dead_centre:
        passage = _turned(passage, after)
    count = len(passage.t_ns)
    t_ns, speeds = list(passage.t_ns), list(passage.speed_m_s)
    while count < len(stations_m) and after.z_m >= stations_m[count]:
        t, speed = _crossed(passage, before, after, stations_m[count])
        t_ns.append(t)
        speeds.append(speed)
        count += 1
    ends_ns = _end(after) if count == len(stations_m) else -1
    if count == len(passage.t_ns) and ends_ns < 0:
        return passage
    return Passage(
        passage.phase, passage.begun_ns, passage.start_m, tuple(t_ns), tuple(speeds),
        passage.profiles, ends_ns if ends_ns >= 0 else passage.ends_ns,
    )  # fmt: skip


def _end(motion: Motion) -> i64:
    """When the piston will stand if it goes on slowing down as it does, -1 if that is too slow."""
    speed, a = motion.speed_m_s, float(motion.direction) * motion.a_m_s2
    if speed < _SLOWEST_M_S or a >= 0.0:
        return -1
    return motion.t_ns - nearest(speed / a * 1e9)


def _crossed(passage: Passage, before: Motion, after: Motion, z_m: float) -> tuple[int, float]:
    """Instant and speed at a station; one behind the dead centre is passed with it."""
    if passage.begun_ns >= 0 and z_m <= -passage.start_m:
        return passage.begun_ns, 0.0
    way = float(after.direction)
    t_ns, z, v = before.t_ns, way * before.x_m, way * before.v_m_s
    if t_ns < passage.begun_ns:
        t_ns, z, v = passage.begun_ns, -passage.start_m, 0.0
    if t_ns < 0 or t_ns >= after.t_ns:
        return after.t_ns, after.speed_m_s
    return crossing_between(t_ns, z - z_m, v, after.t_ns, after.z_m - z_m, after.speed_m_s)


def _turned(passage: Passage, after: Motion) -> Passage:
    """Keep the stroke that has ended as its phase's profile, and begin the next one.

    Stations that it has not reached are left as they were. A piston that has rebounded a little and
    turns again at the same head is in the same stroke still.
    """
    if (passage.phase % 2 == 0 and after.side == 0) or (passage.phase % 2 == 1 and after.side == 1):
        return Passage(passage.phase, after.dc_t_ns, after.tdc_m, (), (), passage.profiles)
    profiles = list(passage.profiles)
    old = profiles[passage.phase]
    ends_ns, foretold_ns = after.dc_t_ns, passage.ends_ns
    if foretold_ns >= 0 and ends_ns - foretold_ns > _DWELL_NS:
        ends_ns = foretold_ns
    duration_s = float(ends_ns - passage.begun_ns) * 1e-9
    if passage.begun_ns >= 0 and duration_s > 0.0:
        count = len(passage.t_ns)
        taus = [float(t - passage.begun_ns) * 1e-9 for t in passage.t_ns]
        seen = Profile(
            (*taus, *old.tau_s[count:]), (*passage.speed_m_s, *old.speed_m_s[count:]), duration_s
        )
        profiles[passage.phase] = _towards(old, seen) if old.is_seen else seen
    phase = (passage.phase + 1) % len(profiles)
    return Passage(phase, after.dc_t_ns, after.tdc_m, (), (), tuple(profiles))


def _towards(old: Profile, seen: Profile) -> Profile:
    """A profile moved by part of the way to the one just seen: strokes differ by chance, too."""
    return Profile(
        tuple([a + _TRUST * (b - a) for a, b in zip(old.tau_s, seen.tau_s, strict=True)]),
        tuple([a + _TRUST * (b - a) for a, b in zip(old.speed_m_s, seen.speed_m_s, strict=True)]),
        old.duration_s + _TRUST * (seen.duration_s - old.duration_s),
    )  # fmt: skip


def instant(passage: Passage, phase: int, station: int, after_ns: i64) -> i64:
    """When a station of a phase is passed, the first time after an instant [ns].

    Parameters: station : its number, -1 for the dead centre that begins the stroke
    """
    count = len(passage.profiles)
    ahead = (phase - passage.phase) % count
    begins_ns = passage.begun_ns
    if ahead == 0:
        t_ns = begins_ns if station < 0 else _in_this_stroke(passage, station)
        if t_ns > after_ns:
            return t_ns
    profile = passage.profiles[passage.phase]
    begins_ns = _predicted(passage, profile.duration_s)
    number = 1
    while number <= 2 * count:
        profile = passage.profiles[(passage.phase + number) % count]
        if number % count == ahead:
            tau_s = 0.0 if station < 0 else profile.tau_s[station]
            t_ns = begins_ns + nearest(tau_s * 1e9)
            if t_ns > after_ns:
                return t_ns
        begins_ns += nearest(profile.duration_s * 1e9)
        number += 1
    return begins_ns


def _in_this_stroke(passage: Passage, station: int) -> i64:
    """When the stroke under way has passed, or will pass, a station [ns]."""
    if station < len(passage.t_ns):
        return passage.t_ns[station]
    return _predicted(passage, passage.profiles[passage.phase].tau_s[station])


def _predicted(passage: Passage, tau_s: float) -> i64:
    """The instant of a point of the stroke under way that the last one passed tau after its start.

    From the last station passed, at the ratio of the speeds there.
    """
    last, profile = len(passage.t_ns) - 1, passage.profiles[passage.phase]
    if last < 0 or not profile.is_seen:
        return passage.begun_ns + nearest(tau_s * 1e9)
    then, now = profile.speed_m_s[last], passage.speed_m_s[last]
    ratio = 1.0
    if min(then, now) > _SLOWEST_M_S:
        ratio = min(max(then / now, 1.0 / _MOST_RATIO), _MOST_RATIO)
    return passage.t_ns[last] + nearest((tau_s - profile.tau_s[last]) * ratio * 1e9)
