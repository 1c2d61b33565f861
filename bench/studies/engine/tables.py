"""The thesis's tables of its detailed engines, beside what ours gives."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hil.config.detailed import Calibration, read
from hil.errors import RunError
from plant.engines.detailed import layout as at
from plant.engines.detailed.engine import (
    Engine,
    Motion,
    at_rest,
    begin,
    engine_of,
    run_for,
    strokes,
)
from plant.engines.detailed.figures import Figures, figures, settled

_BAR = 1e5
_RISING_BAR = 10.0
_START_S = 1.5
_MOTORED_S = 2.0


class Row(NamedTuple):
    """One figure: the thesis's, ours, and how far ours may be from it to count as reached."""

    table: str
    name: str
    thesis: float
    ours: float
    tolerance: float
    absolute: bool = False

    @property
    def error(self) -> float:
        """Return ours less theirs, as a share of theirs unless the tolerance is absolute."""
        return self.ours - self.thesis if self.absolute else self.ours / self.thesis - 1.0

    @property
    def reached(self) -> bool:
        """Return whether the error is within the tolerance."""
        return abs(self.error) <= self.tolerance


TABLE_4_3 = {
    "nu-two-stroke": (2000.0, 3.1, 47.0, 0.22, 34.5, 3900.0, 3760.0, 7.36),
    "nu-four-stroke": (900.0, 3.8, 76.0, 0.20, 44.9, 1230.0, 640.0, 16.20),
}
TABLE_2 = {
    0.65: (3.3, 2.2, 1200.0, 5.6),
    0.75: (3.8, 2.6, 1400.0, 6.4),
    0.85: (4.2, 3.0, 1560.0, 7.9),
    0.95: (4.6, 3.2, 1680.0, 8.8),
}
TABLE_4_2 = (120.0, -300.0, 1000.0, -4000.0)
"""Forces of motors 1 to 4 along the motion [N]."""
CHAPTER_2: dict[str, tuple[tuple[str, float], ...]] = {
    "gas-spring": (("frequency [Hz]", 21.0), ("electric power [W]", 10_000.0)),
    "mechanical-spring": (("electric power [W]", 2200.0), ("efficiency [%]", 32.0)),
}
"""Of the prototypes of sections 2.3.1 and 2.3.4; of opposed pistons none is printed."""
STARTING = {110.0: (6, 12.0), 130.0: (4, 19.0)}
"""Motor force [N]: first cycle whose peak reaches 10 bar, final peak [bar]  (App. I 4.1)."""


def table_4_3(name: str) -> list[Row]:
    """Performance of the Newcastle engine (thesis Table 4.3)."""
    two = name == "nu-two-stroke"
    return _performance(read(name), f"4.3 {'two' if two else 'four'}-stroke")


def _performance(c: Calibration, title: str) -> list[Row]:
    engine = engine_of(c)
    f = figures(engine, settled(engine))
    wide, other = (0.08, 0.06) if c.name == "nu-two-stroke" else (0.05, 0.05)
    names = ("speed [rpm]", "peak velocity [m/s]", "peak pressure [bar]", "fuel [kg/kWh]",
             "efficiency [%]", "indicated power [W]", "electric power [W]",
             "compression ratio")  # fmt: skip
    ours = (f.speed_rpm, f.v_max_m_s, f.p_max_pa / _BAR, f.fuel_kg_kwh, 100.0 * f.efficiency,
            f.indicated_w, f.electric_w, f.compression_ratio)  # fmt: skip
    limits = (wide, *(other,) * 7)
    return [Row(title, *row) for row in zip(names, TABLE_4_3[c.name], ours, limits, strict=True)]


def table_2() -> list[Row]:
    """The Beijing engine at part load (App. I Table 2)."""
    names = ("peak velocity [m/s]", "mean velocity [m/s]", "speed [rpm]", "compression ratio")
    rows: list[Row] = []
    c = read("bit-running")
    for load, thesis in TABLE_2.items():
        try:
            f = figures_at(c, load)
            ours = (f.v_max_m_s, f.v_mean_m_s, f.speed_rpm, f.compression_ratio)
        except RunError:  # the engine stops at that load, and the table says so
            ours = (math.nan,) * 4
        title = f"App. I 2, load {load:.0%}"
        rows += [Row(title, *row, 0.10) for row in zip(names, thesis, ours, strict=True)]
    return rows


def figures_at(c: Calibration, throttle: float) -> Figures:
    """Figures at part load."""
    return figures(*motion_at(c, throttle))


def motion_at(c: Calibration, throttle: float, step: float = 0.05) -> tuple[Engine, Motion]:
    """Settle at full throttle, then close it in small steps, as an operator would."""
    motion = None
    for part in [*np.arange(1.0, throttle + 1e-9, -step).tolist(), throttle]:
        engine = engine_of(c, throttle=part)
        if motion is not None:
            motion.d[at.ENERGY] = engine.energy_j
        motion = settled(engine, 1.5, motion)
    assert motion is not None
    return engine, motion


def starting_peaks(force_n: float) -> list[float]:
    """Peak pressures of the right cylinder, cycle by cycle, motored from rest [bar]."""
    c = read("bit-starting")
    cycle = c.cycle.model_copy(update={"start_force_n": force_n})
    engine = engine_of(c.model_copy(update={"cycle": cycle}))
    motion = at_rest(engine)
    begin(engine, motion, 1)
    rows = strokes(run_for(engine, motion, _START_S))
    return [float(row[at.REC_P_RIGHT]) / _BAR for row in rows if row[at.REC_X] < 0.0]


def starting() -> list[Row]:
    """Starting of the Beijing engine by mechanical resonance (App. I Figs 6, 7 and 10)."""
    rows: list[Row] = []
    for force, (cycle, final) in STARTING.items():
        peaks = starting_peaks(force)
        reached = next((n for n, p in enumerate(peaks, 1) if p >= _RISING_BAR), 0)
        title = f"App. I 4.1, {force:.0f} N"
        rows.append(Row(title, "cycle of 10 bar", cycle, reached, 0.0, absolute=True))
        rows.append(Row(title, "final peak [bar]", final, peaks[-1], 1.0, absolute=True))
    weak = max(starting_peaks(90.0))
    rows.append(Row("App. I 4.1, 90 N", "peak, below 10 bar", 0.0, weak, _RISING_BAR, True))
    return rows


def motoring() -> list[Row]:
    """The Newcastle engine motored at constant speed (thesis section 4.1.3)."""
    engine = engine_of(read("nu-motoring"))
    motion = at_rest(engine)
    begin(engine, motion, 1)
    last = strokes(run_for(engine, motion, _MOTORED_S))[-1]
    c = engine.calibration
    peak = max(last[at.REC_P_LEFT], last[at.REC_P_RIGHT]) / _BAR
    ratio = (c.cycle.exhaust_closes_m or 0.0) / (c.left.length_m - abs(last[at.REC_X]))
    return [
        Row("4.1.3 motoring", "peak pressure [bar]", 11.0, float(peak), 0.05),
        Row("4.1.3 motoring", "compression ratio", 15.5, float(ratio), 0.05),
    ]


def own_forces() -> list[Row]:
    """The four-stroke engine with Table 4.2's own forces, switched near Fig. 4.12's positions."""
    c = read("nu-four-stroke")
    forces = dict(zip(("motor_1_n", "motor_2_n", "motor_3_n", "motor_4_n"), TABLE_4_2, strict=True))
    places = {"switch_1_m": 0.010, "switch_4_m": -0.010}
    cycle = c.cycle.model_copy(update=forces | places)
    rows = _performance(c.model_copy(update={"cycle": cycle}), "4.3, forces of 4.2")
    return [row._replace(tolerance=math.inf) for row in rows]


def other_engines() -> list[Row]:
    """Engines of the literature (thesis chapter 2), as far as it prints a figure.

    Efficiency is that of the generating set: electric power over fuel power.
    """
    rows: list[Row] = []
    for name, printed in CHAPTER_2.items():
        engine = engine_of(read(name))
        f = figures(engine, settled(engine))
        ours = {"frequency [Hz]": f.speed_rpm / 60.0, "electric power [W]": f.electric_w}
        ours["efficiency [%]"] = 100.0 * f.electric_w / f.fuel_w
        rows += [Row(name, what, value, ours[what], 0.10) for what, value in printed]
    return rows


def all_rows() -> list[Row]:
    """Every figure."""
    two, four = table_4_3("nu-two-stroke"), table_4_3("nu-four-stroke")
    return [*two, *four, *own_forces(), *table_2(), *motoring(), *starting(), *other_engines()]
