"""The messages of a tick's sample: head, motion, and what takes a place beside them."""

from __future__ import annotations

from typing import Final

from mypy_extensions import i64

from hil.wire.fields import most_of
from hil.wire.messages import (
    ELECTRIC_POWER,
    P_LEFT,
    P_RIGHT,
    SLOW_ORDER,
    WINDING,
    WINDING_EVERY,
    CylinderPeak,
    Message,
    PistonSample,
    PlantTick,
    ValveMove,
)
from plant.engines.protocol import Sensed
from plant.rig.params import PlantParams
from plant.rig.silence import unheard
from plant.rig.state import PlantState
from plant.sensors import Sample, valve_move

_NAN: Final = float("nan")
_X_MOST: Final = most_of(PistonSample, "x_m")
_V_MOST: Final = most_of(PistonSample, "v_m_s")
_POWER_MOST: Final = most_of(PlantTick, "electric_power_w")
_P_MOST: Final = most_of(PlantTick, "p_left_pa")
_WINDING_MOST: Final = most_of(PlantTick, "winding_k")
_PEAK_MOST: Final = most_of(CylinderPeak, "p_peak_pa")
_RISE_MOST: Final = most_of(CylinderPeak, "rise_pa_s")


def sample_messages(
    p: PlantParams, s: PlantState, seen: Sample, slowly: Sensed
) -> tuple[Message, ...]:
    """The messages with which tick s.tick begins."""
    third = beside(p, s)
    head = _head(p, s, slowly, 2 if third is None else 3)
    heard = unheard(p, s) if s.stale or s.latch else 0
    body = PistonSample(_within(seen.x_m, _X_MOST), _within(seen.v_m_s, _V_MOST), heard)
    return (head, body) if third is None else (head, body, third)


def beside(p: PlantParams, s: PlantState) -> ValveMove | CylinderPeak | None:
    """What takes a place beside head and motion: a valve's move, else a cylinder's cycle."""
    move = valve_move(p, s)
    return move if move is not None or not p.instrumented else _cylinder_peak(s)


def _cylinder_peak(s: PlantState) -> CylinderPeak | None:
    """The oldest cycle that is still to be told."""
    if not s.instruments.told:
        return None
    cycle = s.instruments.told[0]
    return CylinderPeak(
        cycle.side, _within(cycle.p_peak_pa, _PEAK_MOST), _within(cycle.x_peak_m, _X_MOST),
        _within(cycle.rise_pa_s, _RISE_MOST),
    )  # fmt: skip


def winding_k(p: PlantParams, s: PlantState, tick: i64) -> float:
    """Temperature of the winding in the ticks that carry it, else nan."""
    if not p.instrumented or not p.config.winding.on:
        return _NAN
    is_its_turn = tick % WINDING_EVERY == WINDING_EVERY - 1
    return _within(s.instruments.winding_k, _WINDING_MOST) if is_its_turn else _NAN


def _head(p: PlantParams, s: PlantState, slowly: Sensed, frame_count: i64) -> PlantTick:
    """The first frame, with the slow signal whose turn it is."""
    tick = s.tick
    slow, kelvin = SLOW_ORDER[tick & 3], winding_k(p, s, tick)
    if kelvin == kelvin:  # noqa: PLR0124  # not nan
        slow = WINDING
    power, left, right = slowly.electric_power_w, slowly.p_left_pa, slowly.p_right_pa
    return PlantTick(
        tick & 0xFFFFFFFF,
        frame_count,
        slow,
        _within(power, _POWER_MOST) if slow == ELECTRIC_POWER else _NAN,
        _within(left, _P_MOST) if slow == P_LEFT else _NAN,
        _within(right, _P_MOST) if slow == P_RIGHT else _NAN,
        kelvin,
    )


def _within(value: float, most: float) -> float:
    """A sensor at the end of its range says the end of its range."""
    return -most if value < -most else most if value > most else value
