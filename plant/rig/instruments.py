"""When the plant looks at pressures and winding: at the ends of ticks, about dead centres."""

from __future__ import annotations

from plant.engines.protocol import Motion
from plant.rig import indicator
from plant.rig.params import PlantParams
from plant.rig.state import PlantState


def told(p: PlantParams, s: PlantState) -> PlantState:
    """The state once the sample of its tick is sent: the oldest cycle is told, unless a valve was.

    Only one of both has room beside the other frames of a tick.
    """
    if not s.instruments.told or (s.pulses.valves.told and p.valves.by_lines):
        return s
    return s.but(instruments=indicator.after_telling(s.instruments))


def observed(p: PlantParams, before: PlantState, after: PlantState) -> PlantState:
    """Look at the end of a tick."""
    if p.config.indicator.on:
        after = read(p, after, after.motion, float(after.tick * p.period_ns))
    if p.config.winding.on:
        speeds = (before.v_m_s, after.v_m_s)
        warmer = indicator.warmed(
            after.instruments, p.config.winding, after.machine, speeds, p.dt_s
        )
        after = after.but(instruments=warmer)
    return after


def read(p: PlantParams, s: PlantState, motion: Motion, t_ns: float) -> PlantState:
    """Take a reading of the pressures."""
    if not p.config.indicator.on:
        return s
    interval_ns = p.config.indicator.interval_s * 1e9
    return s.but(
        instruments=indicator.read(s.instruments, p.engine, motion, s.machine, t_ns, interval_ns)
    )


def ended(p: PlantParams, s: PlantState, side: int) -> PlantState:
    """End the cycle of a cylinder at its bottom dead centre."""
    if not p.config.indicator.on:
        return s
    return s.but(instruments=indicator.ended(s.instruments, p.engine, s.motion, side))
