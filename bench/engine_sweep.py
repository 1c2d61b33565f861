"""The thesis's parameter studies: throttle, ignition, load, motor force (Figs 4.15 to 4.20)."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from bench.engine import figures_at, starting_peaks
from hil.config.detailed import Calibration, read
from hil.errors import ConfigError, HilError
from plant.detailed import layout as at
from plant.detailed.engine import engine_of
from plant.detailed.figures import Figures, figures, settled

_FORCES = ("motor_1_n", "motor_2_n", "motor_3_n")


class Sweep(NamedTuple):
    """What is varied, over which values, and how a value becomes figures."""

    unit: str
    values: tuple[float, ...]
    run: Callable[[Calibration, float], Figures]


class SweepPoint(NamedTuple):
    """A value with its figures, or with the reason why there are none."""

    value: float
    figures: Figures | None
    reason: str = ""


def _throttle(c: Calibration, value: float) -> Figures:
    """Fuel and intake opening by the throttle; the load goes down with it (thesis 4.3.1)."""
    machine = c.machine.model_copy(
        update={"load_coefficient_n_s_m": c.machine.load_coefficient_n_s_m * value}
    )
    if c.name == "bit-running":
        return figures_at(c, value)
    engine = engine_of(c.model_copy(update={"machine": machine}), throttle=value)
    return figures(engine, settled(engine))


def _ignition(c: Calibration, degrees: float) -> Figures:
    """Spark at dx = S/2 (1 - cos dtheta) before the nominal TDC (thesis eq. 4.3, corrected)."""
    nominal = 2.0 * c.left.length_m * 0.5 * (1.0 - math.cos(math.radians(degrees)))
    settled_gap = c.left.length_m - _nominal_tdc(c)
    cycle = c.cycle.model_copy(update={"ignition_from_head_m": settled_gap + nominal})
    engine = engine_of(c.model_copy(update={"cycle": cycle}))
    return figures(engine, settled(engine))


def _nominal_tdc(c: Calibration) -> float:
    engine = engine_of(c)
    return figures(engine, settled(engine)).tdc_m


def _load(c: Calibration, scale: float) -> Figures:
    """Change the load of the settled engine, fuel and ignition position left alone."""
    machine = c.machine.model_copy(
        update={"load_coefficient_n_s_m": c.machine.load_coefficient_n_s_m * scale}
    )
    nominal = settled(engine_of(c))
    engine = engine_of(c.model_copy(update={"machine": machine}))
    nominal.d[at.LOAD] = machine.load_coefficient_n_s_m
    return figures(engine, settled(engine, motion=nominal))


def _motor_force(c: Calibration, scale: float) -> Figures:
    """Motor 1 with motors 2 and 3 in proportion (thesis 4.3.3)."""
    forces = {key: getattr(c.cycle, key) * scale for key in _FORCES}
    engine = engine_of(c.model_copy(update={"cycle": c.cycle.model_copy(update=forces)}))
    return figures(engine, settled(engine))


SWEEPS = {
    "throttle": Sweep("of wide open", (0.5, 0.6, 0.7, 0.8, 0.9, 1.0), _throttle),
    "ignition": Sweep("degrees before TDC", (15.0, 16.0, 18.0, 20.0, 22.0, 24.0), _ignition),
    "load": Sweep("of nominal", (0.90, 0.95, 0.97, 1.0, 1.01, 1.02, 1.03, 1.05), _load),
    "motor-force": Sweep("of nominal", (0.95, 0.97, 1.0, 1.03, 1.05, 1.10), _motor_force),
}


def sweep(over: str, name: str) -> list[SweepPoint]:
    """Run a study; where the engine stops or strikes a head there is a reason for a figure.

    Raises: ConfigError when the study means nothing for that engine
    """
    c = read(name)
    if over == "motor-force" and c.cycle.kind != "four-stroke":
        raise ConfigError(f"--over motor-force: engine {name} has no motoring strokes")
    if c.cycle.kind == "motoring":
        raise ConfigError(f"--over {over}: engine {name} is motored; accepted: `hil engine table`")
    points = []
    for value in SWEEPS[over].values:
        try:
            points.append(SweepPoint(value, SWEEPS[over].run(c, value)))
        except HilError as error:
            points.append(SweepPoint(value, None, str(error)))
    return points


def draw(points: list[SweepPoint], over: str, name: str, path: Path) -> None:
    """Draw powers and compression ratio over what was varied."""
    from matplotlib.figure import Figure

    good = [p for p in points if p.figures is not None]
    x = [p.value for p in good]
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    axes: Any = figure.subplots(1, 2)
    shown = (("indicated", "indicated_w"), ("electric", "electric_w"), ("friction", "friction_w"),
             ("motoring", "motoring_w"))  # fmt: skip
    for label, key in shown:
        axes[0].plot(x, [getattr(p.figures, key) for p in good], "o-", label=label)
    axes[0].set(xlabel=f"{over} [{SWEEPS[over].unit}]", ylabel="power [W]", title=name)
    axes[0].legend()
    axes[1].plot(x, [p.figures.compression_ratio for p in good if p.figures], "o-")
    axes[1].set(xlabel=f"{over} [{SWEEPS[over].unit}]", ylabel="compression ratio")
    figure.savefig(path)


def starting_study() -> dict[float, list[float]]:
    """Peak pressures by cycle for the motor forces of App. I Fig. 10."""
    return {force: starting_peaks(force) for force in (70.0, 90.0, 110.0, 130.0)}
