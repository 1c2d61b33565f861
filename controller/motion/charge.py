"""What the model-based laws learn: the share of the fuel that acts, by cylinder, and the inertia.

A stroke that ends elsewhere than its model says had another charge than was believed. The share
of each cylinder moves by a part of that, so that imbalance, injector flow, heating value and the
errors of the model itself are taken up; in steady state the model then says what the engine does.
A stroke that takes longer than foreseen moves another mass over the same springs (T^2 ~ m / k).
"""

from __future__ import annotations

from typing import Final, final

from mypy_extensions import i64

from controller.motion.law import View
from controller.motion.maps.stroke_map import StrokeMap
from controller.motion.quiet import NOTHING_SEEN, Noise, Quiet
from hil.config.motion.laws import LearningConfig, QuietConfig
from hil.values import Value, replace

_STEP: Final = 0.01
_BY_DERIVATIVES: Final = 2.0
"""Away from where it was found, a map of derivatives errs alike stroke after stroke: so many times
as much of what one shows is believed."""


@final
class Learning:
    """Sections `learning` and `quiet` of the configuration, read once for all ticks."""

    def __init__(self, config: LearningConfig, quiet: QuietConfig) -> None:
        self.quiet = Quiet(quiet)
        self.gain = config.gain
        self.inertia_gain = config.inertia_gain
        self.most = config.most
        self.load_change = config.load_change
        self.share_min = config.share_min
        self.share_max = config.share_max
        self.near_m = config.near_m
        self.offset_m = config.offset_m


@final
class Charge(Value):
    """Effective fuel as a share of the fuel asked for, (left, right); `known` once aligned.

    mass_kg: the inertia learnt, 0 before the first stroke
    ahead_m: error of the dead centre that is predicted at mid-stroke
    noise: what of the errors is noise; lessons: part of the gains with which they teach
    """

    __slots__ = ("share", "known", "mass_kg", "ahead_m", "noise", "lessons")

    def __init__(
        self, share: tuple[float, float] = (1.0, 1.0), known: bool = True, mass_kg: float = 0.0,
        ahead_m: float = 0.0, noise: Noise = NOTHING_SEEN, lessons: float = 1.0,
    ) -> None:  # fmt: skip
        self.share = share
        self.known = known
        self.mass_kg = mass_kg
        self.ahead_m = ahead_m
        self.noise = noise
        self.lessons = lessons

    def effective_kg(self, view: View, side: i64) -> float:
        """Effective fuel of the last combustion at a head [kg]."""
        return self.share_of(side) * view.burnt_at(side)

    def share_of(self, side: i64) -> float:
        """The share at a head."""
        return self.share[0] if side == 0 else self.share[1]

    def map_of(self, view: View) -> StrokeMap:
        """The stroke's map with the inertia learnt."""
        believed = view.believed
        return believed.with_mass(self.mass_kg) if self.mass_kg else believed


AS_BELIEVED: Final = Charge()
UNALIGNED: Final = Charge(known=False)


@final
class Forecast(Value):
    """Where the stroke under way should end [m], dX/dq there [m/kg], under which load, and when.

    begun_ns, duration_s: when the stroke began and how long it should take
    """

    __slots__ = ("end_m", "slope_m_kg", "load_n_s_m", "begun_ns", "duration_s")

    def __init__(
        self, end_m: float = 0.0, slope_m_kg: float = 0.0, load_n_s_m: float = 0.0,
        begun_ns: i64 = -1, duration_s: float = 0.0,
    ) -> None:  # fmt: skip
        self.end_m = end_m
        self.slope_m_kg = slope_m_kg
        self.load_n_s_m = load_n_s_m
        self.begun_ns = begun_ns
        self.duration_s = duration_s


NOTHING_FORESEEN: Final = Forecast()


def first_fuel(charge: Charge, view: View) -> float:
    """The fuel of a stroke until the watch trims it [kg].

    That of the steady state; while the shares are still to be aligned, that burnt there last.
    """
    side = view.fuel_side
    burnt = view.burnt_at(side)
    if not charge.known and burnt > 0.0:
        return view.limited_kg(burnt)
    return view.limited_kg(view.point.fuel_kg / charge.share_of(side))


def foresee(stroke_map: StrokeMap, q: float, c: float, start_m: float, begun_ns: i64) -> Forecast:
    """Forecast of a stroke that begins at the distance `start_m`."""
    end, duration_s = stroke_map.travel(q, c, -start_m, 0.0, 0.0)
    more = stroke_map.end_of(q * (1.0 + _STEP), c, start_m)
    return Forecast(end, (more - end) / (q * _STEP), c, begun_ns, duration_s)


def learn(config: Learning, charge: Charge, view: View, forecast: Forecast, c: float) -> Charge:
    """Move the share of the side that fired towards what explains the dead centre.

    share += gain (X - X_foreseen) / (dX/dq m_fuel), m *= (T / T_foreseen)^(2 gain); a stroke within
    which the load has changed teaches nothing, nor does one without a charge.
    """
    motion, side = view.motion, 1 - view.motion.side
    fuel_kg = view.burnt_at(side)
    usable = forecast.slope_m_kg > 0.0 and fuel_kg > 0.0
    if not usable or abs(c - forecast.load_n_s_m) > config.load_change * c:
        return charge
    wrong_m = motion.tdc_m - forecast.end_m
    noise = charge.noise.after(config.quiet, wrong_m, side)
    lessons = noise.share(config.quiet)
    wrong = wrong_m / (forecast.slope_m_kg * fuel_kg)
    gain = lessons * config.gain * (1.0 if view.believed.tells_force else _BY_DERIVATIVES)
    moved = charge.share_of(side) + gain * _within(wrong, config.most)
    moved = min(max(moved, config.share_min), config.share_max)
    share = (moved, charge.share[1]) if side == 0 else (charge.share[0], moved)
    longer = float(motion.dc_t_ns - forecast.begun_ns) * 1e-9 / forecast.duration_s - 1.0
    believed = view.believed.m
    m = charge.mass_kg or believed
    m *= 1.0 + 2.0 * lessons * config.inertia_gain * _within(longer, config.most)
    m = min(max(m, config.share_min * believed), config.share_max * believed)
    return Charge(share, charge.known, m, charge.ahead_m, noise, lessons)


def _within(value: float, most: float) -> float:
    return min(max(value, -most), most)


def look_back(config: Learning, charge: Charge, wrong_m: float) -> Charge:
    """Take up the error of the dead centre that was predicted from mid-stroke."""
    ahead_m = _within(charge.ahead_m + charge.lessons * config.gain * wrong_m, config.offset_m)
    return replace(charge, ahead_m=ahead_m)


def align(config: Learning, charge: Charge, view: View, c: float) -> Charge:
    """After a change of law: the shares with which the model asks for the fuel in force.

    Only an engine near its set point shows them; one that is not begins with what was believed.
    """
    if not is_near(config, view):
        return replace(charge, known=True)
    ref_m, burnt_kg = view.tdc_ref_m, view.burnt_kg
    q = view.believed.charge_for(c, ref_m, ref_m, 0.5 * (burnt_kg[0] + burnt_kg[1]))
    return replace(charge, share=shares_of(config, q, burnt_kg), known=True)


def is_near(config: Learning, view: View) -> bool:
    """Whether the engine is so near its set point that the fuel in force is the one for it."""
    near = abs(view.motion.tdc_m - view.tdc_ref_m) < config.near_m
    return near and min(view.burnt_kg) > 0.0


def shares_of(config: Learning, q: float, burnt_kg: tuple[float, float]) -> tuple[float, float]:
    """The shares by which both sides' fuels have had the effect of q."""
    left, right = (min(max(q / m, config.share_min), config.share_max) for m in burnt_kg)
    return left, right
