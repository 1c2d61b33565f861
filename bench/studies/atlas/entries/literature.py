"""Engines of the literature (chapter 2): each run and drawn, as far as a table describes it."""

from __future__ import annotations

from bench.studies.atlas.entry import Entry, Finding, Found
from bench.studies.engine.charts import pressure_volume
from bench.studies.engine.operation import BAR, Operation, operate
from bench.web.chart import Chart, series, thinned
from hil.config.detailed import read

_FITTED = "calibrated on it; what no table has is assumed in its calibration"


def drawn(o: Operation) -> tuple[Chart, ...]:
    """Speed over position and pressure over volume of a settled engine."""
    name, t = o.engine.calibration.name, o.trace
    return (
        Chart("Velocity over position", "x [mm]", "velocity [m/s]",
              (thinned(series(name, 1e3 * t.x_m, t.v_m_s)),)),
        Chart("Left cylinder", "volume [cm³]", "pressure [bar]",
              (thinned(pressure_volume(name, t)),)),
    )  # fmt: skip


def _running(o: Operation) -> str:
    f = o.figures
    return (f"{f.speed_rpm / 60.0:.1f} Hz, {f.electric_w:.0f} W, ratio {f.compression_ratio:.1f}, "
            f"{f.p_max_pa / BAR:.0f} bar")  # fmt: skip


def west_virginia(_quick: bool) -> Found:
    """Two pistons on one shaft; its machine is a circuit."""
    o = operate(read("wvu"))
    f = o.figures
    return Found({
        "S2.3.2-wvu-power": Finding(f.electric_w, _FITTED),
        "S2.3.2-wvu-frequency": Finding(f.speed_rpm / 60.0, _FITTED),
    }, drawn(o))  # fmt: skip


def bounce_chamber(_quick: bool) -> Found:
    """A single piston against a bounce chamber."""
    o = operate(read("bounce-chamber"))
    c, x = o.engine.calibration, o.trace.x_m
    ratio = (c.right.length_m - float(x.min())) / (c.right.length_m - float(x.max()))
    stroke = 2.0 * (c.left.length_m - _CLEARANCE_M)
    height = stroke - (c.cycle.intake_opens_m or 0.0)
    return Found({
        "T2.5-stroke": Finding(1e3 * stroke, "less a clearance of 2.5 mm at either end"),
        "T2.5-port-height": Finding(1e3 * height),
        "T2.5-cr": Finding(o.figures.compression_ratio, _running(o)),
        "T2.5-bounce-cr": Finding(ratio, "of the volumes between its dead centres"),
    }, drawn(o))  # fmt: skip


_CLEARANCE_M = 2.5e-3


def energy_converter(_quick: bool) -> Found:
    """Two pistons on one shaft, 45 kW."""
    o = operate(read("fpec"))
    return Found({
        "T2.7-peak-power": Finding(1e-3 * o.figures.electric_w, f"{_FITTED}; {_running(o)}")
    }, drawn(o))  # fmt: skip


def ulsan(_quick: bool) -> Found:
    """Two pistons on one shaft; its machine is a coil and its magnets."""
    o = operate(read("ulsan"))
    c, f = o.engine.calibration, o.figures
    flux = c.machine.flux
    assert flux is not None
    total = flux.circuit.thrust_n_a**2 / c.machine.load_coefficient_n_s_m
    return Found({
        "T2.13-resistance": Finding(total - flux.resistance_ohm, "of the load, without the coil's"),
        "S2.3.2-ulsan-frequency": Finding(f.speed_rpm / 60.0, _FITTED),
        "S2.3.2-ulsan-power": Finding(f.electric_w, _FITTED),
    }, drawn(o))  # fmt: skip


def gas_spring(_quick: bool) -> Found:
    """A single piston against a gas spring."""
    o = operate(read("gas-spring"))
    return Found({
        "S2.3.1-dlr-frequency": Finding(o.figures.speed_rpm / 60.0, _FITTED),
        "S2.3.1-dlr-power": Finding(1e-3 * o.figures.electric_w, _FITTED),
    }, drawn(o))  # fmt: skip


def mechanical_spring(_quick: bool) -> Found:
    """Four strokes against a mechanical spring."""
    o = operate(read("mechanical-spring"))
    f = o.figures
    return Found({
        "S2.3.4-nit-power": Finding(1e-3 * f.electric_w, _FITTED),
        "S2.3.4-nit-efficiency": Finding(100.0 * f.electric_w / f.fuel_w, "electric over fuel"),
    }, drawn(o))  # fmt: skip


def opposed(_quick: bool) -> Found:
    """Opposed pistons that move as one; no result of it is printed."""
    return Found({}, drawn(operate(read("opposed"))))


ENTRIES = (
    Entry("T2.4", "West Virginia engine, spark-ignited", ("S2.3.2-wvu-*",), west_virginia),
    Entry("T2.5", "Newcastle engine with a bounce chamber",
          ("T2.5-stroke", "T2.5-port-height", "T2.5-cr", "T2.5-bounce-cr"), bounce_chamber),
    Entry("T2.6", "Sandia engine", (), opposed),
    Entry("T2.7", "FPEC engine", ("T2.7-peak-power",), energy_converter),
    Entry("T2.9", "German Aerospace engine", ("S2.3.1-*",), gas_spring),
    Entry("T2.13", "Ulsan engine", ("T2.13-resistance", "S2.3.2-ulsan-*"), ulsan),
    Entry("S2.3.4", "Nanjing engine, four-stroke with a spring", ("S2.3.4-*",), mechanical_spring),
)  # fmt: skip
