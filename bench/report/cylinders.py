"""The part of a report that looks into the cylinders of a detailed engine."""

from __future__ import annotations

import html
from typing import Final, NamedTuple

from bench.report import indicator, plots_engine
from bench.report.indicator import Cycle
from bench.report.page import small_tile, table
from bench.run.directory import RunFiles
from bench.web.page import Page
from hil.config.resolved import Resolved
from hil.errors import MissingExtraError


class Row(NamedTuple):
    """A figure of the table: name, attribute of Figures, unit, form, factor."""

    name: str
    key: str
    unit: str
    form: str = "{:.0f}"
    factor: float = 1.0


_TABLE: Final = (
    Row("equivalent speed", "speed_rpm", "rpm"),
    Row("peak velocity", "v_max_m_s", "m/s", "{:.2f}"),
    Row("mean velocity", "v_mean_m_s", "m/s", "{:.2f}"),
    Row("peak pressure", "p_max_pa", "bar", "{:.1f}", 1e-5),
    Row("top dead centre", "tdc_m", "mm from mid-stroke", "{:.2f}", 1e3),
    Row("effective compression ratio", "compression_ratio", "", "{:.2f}"),
    Row("indicated power", "indicated_w", "W"),
    Row("friction", "friction_w", "W"),
    Row("motor's drive", "motoring_w", "W"),
    Row("scavenging pumps", "pump_w", "W"),
    Row("heat of the winding", "copper_w", "W"),
    Row("electric power", "electric_w", "W"),
    Row("heat to the walls", "heat_w", "W"),
    Row("exhaust less intake", "exhaust_w", "W"),
    Row("past the rings", "leak_w", "W"),
    Row("power of the fuel", "fuel_w", "W"),
    Row("indicated efficiency", "efficiency", "%", "{:.1f}", 100.0),
    Row("fuel for the indicated work", "fuel_kg_kwh", "kg/kWh", "{:.3f}"),
)


def section(page: Page, scenario: Resolved, files: RunFiles) -> str:
    """Return the section of a page as HTML, empty for a model without a gas.

    Where there is nothing to show it says why.
    """
    if not indicator.is_detailed(scenario):
        return ""
    try:
        cycle, why = indicator.last_cycle(scenario, files)
    except MissingExtraError as error:
        cycle, why = None, str(error)
    if cycle is None:
        return f"<section><h2>Engine cycle</h2><p>Not shown: {html.escape(why)}.</p></section>"
    rows = page.row([plots_engine.pressure_volume(cycle), plots_engine.pressure_volume_log(cycle)])
    if cycle.figures.fuel_w > 0.0:
        rows += f'<div class="row">{plots_engine.power(cycle)}</div>'
    return (
        f'<section class="pictures"><h2>Engine cycle</h2>{_tiles(cycle)}{rows}</section>'
        f"<details><summary>Figures of the last cycles</summary>{_table(cycle)}</details>"
    )


def _tiles(cycle: Cycle) -> str:
    """The figures that one looks for first; those of the combustion only where there is one."""
    f = cycle.figures
    cells = [
        small_tile("Indicated power", f"{f.indicated_w:.0f}", "W",
                   f"of {f.fuel_w:.0f} W fuel" if f.fuel_w > 0.0 else "nothing burns"),
        small_tile("Electric power, last cycles", f"{f.electric_w:.0f}", "W",
                   "less the drive's" if f.motoring_w > 0.0 and f.fuel_w > 0.0
                   else "at the terminals"),
        small_tile("Compression ratio", f"{f.compression_ratio:.2f}", "", "effective"),
        small_tile("Peak pressure", f"{f.p_max_pa * 1e-5:.1f}", "bar",
                   f"mean {cycle.mean_pressure_pa * 1e-5:.2f} bar"),
        small_tile("Equivalent speed", f"{f.speed_rpm:.0f}", "rpm", f"up to {f.v_max_m_s:.2f} m/s"),
    ]  # fmt: skip
    if f.fuel_w > 0.0:
        electric = f"electric {100.0 * f.electric_w / f.fuel_w:.1f} %"
        cells += [
            small_tile("Efficiency", f"{100.0 * f.efficiency:.1f}", "%", electric),
            small_tile("Fuel", f"{f.fuel_kg_kwh * 1e3:.0f}", "g/kWh", "indicated"),
        ]
    return f'<section class="tiles">{"".join(cells)}</section>'


def _table(cycle: Cycle) -> str:
    f = cycle.figures
    rows = [
        (row.name, f"{row.form.format(getattr(f, row.key) * row.factor)} {row.unit}".strip())
        for row in _TABLE
    ]
    rest = f.fuel_w - f.heat_w - f.exhaust_w - f.leak_w - f.indicated_w
    rows.append(("balance: stored, or not settled", f"{rest:+.0f} W"))
    mean = cycle.mean_pressure_pa * 1e-5
    rows.append(("indicated mean effective pressure of a cylinder", f"{mean:.2f} bar"))
    return table("Figures of the last cycles", ("figure", "value"), rows, "figures")
