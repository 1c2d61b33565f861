"""What an engine of one's own does with energy, driven by hand: nothing comes from nothing."""

from __future__ import annotations

from typing import Final

from bench.own.watching import Finding
from hil.config.resolved import Resolved
from hil.wire.messages import GENERATOR
from plant.engines import build_engine
from plant.engines.machine import Machine, MachineOrder
from plant.engines.protocol import (
    AT_DEAD_CENTRE,
    NO_CHARGE,
    Ahead,
    Charge,
    Engine,
    Inputs,
    Motion,
    Moved,
    Stop,
)

_STROKES: Final = 20
_TICKS: Final = 20
_TICKS_A_STROKE: Final = 400
"""After so many, a stroke is none."""

_GROWTH: Final = 1e-3
"""Of a dead centre without fuel, by what an integration may err in all strokes."""

_SPLIT_M: Final = 1e-6
"""By so much a tick may come out otherwise when it is gone through in two parts."""


class _Drive:
    """An engine under one machine, stroke by stroke, and the work that the machine takes."""

    def __init__(self, engine: Engine, m: Motion, load_n_s_m: float, period_ns: int) -> None:
        self.engine, self.motion = engine, m
        order = MachineOrder(GENERATOR, 0.0, load_n_s_m)
        self.inputs = Inputs(Machine(order, load_n_s_m, 0.0), (), (0.0, 0.0), (-1, -1))
        self.period_ns = period_ns
        self.now_ns = 0.0
        self.begun_ns = 0.0
        self.work_j = 0.0

    def stroke(self, charge: Charge) -> float:
        """Go on to the next dead centre, where that charge burns; its position [m]."""
        for _ in range(_TICKS_A_STROKE):
            moved = self.part(self.period_ns)
            if moved.stop is not None:
                self.begun_ns = moved.t_ns
                self.motion = self.engine.turn(
                    moved.motion, self.inputs.machine, charge, moved.stop
                )
                return moved.stop.x_m
        return 0.0

    def part(self, span_ns: int) -> Moved:
        """Move on by so much, or to a dead centre before; c v^2 is the machine's power."""
        before_ns, v0 = self.now_ns, self.motion.v_m_s
        end_ns = round(before_ns) + span_ns
        ahead = Ahead(
            round(before_ns), end_ns, span_ns * 1e-9, before_ns, 0.0, end_ns, 1 << 62, 1e9, 1e18,
            round(self.begun_ns), 0,
        )  # fmt: skip
        moved = self.engine.advance(self.motion, self.inputs, ahead)
        v1, dt_s = moved.motion.v_m_s, (moved.t_ns - before_ns) * 1e-9
        mean_square = (v0 * v0 + v0 * v1 + v1 * v1) / 3.0
        self.work_j += self.inputs.machine.load_coefficient_n_s_m * mean_square * dt_s
        self.motion, self.now_ns = moved.motion, moved.t_ns
        return moved


def energy_findings(steady: Resolved) -> list[Finding]:
    """Swing free, run under load, and go through a tick in two parts.

    Raises: RunError when the engine fails
    """
    preset, period_ns = steady.controller.preset, steady.loop.period_ns
    load = steady.controller.supervisory.load_coefficient_n_s_m
    engine = build_engine(steady.plant, period_ns)
    charge = Charge(preset.fuel_kg, 1.0)
    m = engine.begin(charge, load)
    found = [_halves(_begun(engine, m, charge, load, period_ns))]
    if engine.ignition == AT_DEAD_CENTRE:  # else nothing is known of when it is to be lit
        heating_value = steady.plant.resolved_prototype().heating_value_j_kg
        found.append(_free(_begun(engine, m, NO_CHARGE, 0.0, period_ns)))
        found.append(_loaded(_begun(engine, m, charge, load, period_ns), charge, heating_value))
    return found


def _begun(
    engine: Engine, m: Motion, charge: Charge, load_n_s_m: float, period_ns: int
) -> _Drive:  # fmt: skip
    """Let the charge burn where the motion begins."""
    drive = _Drive(engine, m, load_n_s_m, period_ns)
    if engine.ignition == AT_DEAD_CENTRE:
        here = Stop(0.0, m.x_m, 0.0, 1, 0, compressed=True, burnt=None)
        drive.motion = engine.turn(m, drive.inputs.machine, charge, here)
    return drive


def _halves(drive: _Drive) -> Finding:
    """Whether a tick in two parts comes to where the whole one does."""
    worst_m, half_ns = 0.0, drive.period_ns // 2
    for _ in range(_TICKS):
        before = drive.motion, drive.now_ns
        if drive.part(half_ns).stop is not None or drive.part(half_ns).stop is not None:
            break
        in_two = drive.motion.x_m
        drive.motion, drive.now_ns = before
        drive.part(2 * half_ns)
        worst_m = max(worst_m, abs(drive.motion.x_m - in_two))
    return Finding(
        "consistency: a tick in two parts ends in the same place", worst_m < _SPLIT_M,
        f"{1e6 * worst_m:.2g} um apart",
    )  # fmt: skip


def _free(drive: _Drive) -> Finding:
    """Whether the swing of an engine without fuel and load stays below its beginning."""
    first_m = abs(drive.motion.x_m)
    most_m = max(abs(drive.stroke(NO_CHARGE)) for _ in range(_STROKES))
    grown = most_m / first_m - 1.0
    return Finding(
        "energy: without fuel the swing does not grow", grown < _GROWTH,
        f"{100 * grown:+.3f} % in {_STROKES} strokes",
    )  # fmt: skip


def _loaded(drive: _Drive, charge: Charge, heating_value_j_kg: float) -> Finding:
    """Whether the machine takes no more than the fuel brings, once the motion has settled."""
    for _ in range(_STROKES):
        drive.stroke(charge)
    drive.work_j = 0.0
    for _ in range(_STROKES):
        drive.stroke(charge)
    share = drive.work_j / (_STROKES * charge.fuel_kg * heating_value_j_kg)
    return Finding(
        "energy: the machine takes a part of what the fuel brings", 0.0 < share < 1.0,
        f"{100 * share:.1f} %",
    )  # fmt: skip
