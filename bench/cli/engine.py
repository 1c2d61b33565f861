"""`hil engine`: the detailed engines by themselves, without controller or link."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from bench.cli.options import STUDIES, Assignments, Commands, Force

if TYPE_CHECKING:
    from bench.web.chart import Chart
    from hil.files import Output

app = Commands("engine", "The detailed engines: tables, studies, precision.")

DETAILED = ("F4.8", "F4.9", "T4.3", "A1-T2", "A1-F10")
"""Tables and figures of the thesis that say how its detailed engines run."""

Over = Literal["throttle", "ignition", "load", "motor-force", "fuel"]
EngineName = Annotated[
    str, typer.Option("--engine", metavar="NAME", help="Calibration: {engines}.")
]


@app.command()
def table() -> None:
    """Print the thesis's figures beside ours; exit code 1: a deviation has no reason told."""
    from bench.studies.atlas.command import print_table

    raise typer.Exit(print_table(DETAILED))


@app.command()
def sweep(
    over: Annotated[Over, typer.Option(help="What is varied.")],
    *,
    engine: EngineName = "nu-two-stroke",
    out: Annotated[Path | None, typer.Option(help="Picture to write (.svg, .png, .pdf).")] = None,
    force: Force = False,
) -> None:
    """Repeat a parameter study of the thesis: its figures as a table, and as a picture."""
    from hil.files import Output

    file = None if out is None else Output("--out", out, force)
    if file is not None:
        file.check(".svg", ".png", ".pdf")
    if over == "fuel":
        _fuel(file)
    elif engine == "bit-starting" and over == "motor-force":
        _starting(file)
    else:
        _settled(over, engine, file)


@app.command()
def ignition(
    prototype: Annotated[str, typer.Option(help="Engine of two chambers: nu or bit.")] = "nu",
    *,
    estimate: Annotated[
        str | None,
        typer.Option(
            metavar="MODEL", help="Also estimate dead centres, and run that model beside."
        ),
    ] = None,
) -> None:
    """Print best-torque and knock-limited ignition, and what the spark's place is worth."""
    from bench.studies.engine import ignition_page

    ignition_page.show(prototype, estimate)


def _settled(over: Over, engine: str, out: Output | None) -> None:
    from bench.studies.engine import charts
    from bench.studies.engine import sweep as engine_sweep

    points = engine_sweep.sweep(over, engine)
    unit = engine_sweep.SWEEPS[over].unit
    print(f"{over} [{unit}]  rpm  bar  CR  indicated W  electric W  friction W  motoring W  eff. %")
    for point in points:
        f = point.figures
        if f is None:
            print(f"{point.value:8g}  {point.reason}")
            continue
        print(
            f"{point.value:8g}  {f.speed_rpm:7.1f}  {f.p_max_pa * 1e-5:6.2f}"
            f"  {f.compression_ratio:6.3f}  {f.indicated_w:7.1f}  {f.electric_w:7.1f}"
            f"  {f.friction_w:6.1f}  {f.motoring_w:6.1f}  {100.0 * f.efficiency:5.2f}"
        )
    if out is not None:
        _draw(out, charts.charts(points, over, engine))


def _starting(out: Output | None) -> None:
    from bench.studies.engine import charts
    from bench.studies.engine import sweep as engine_sweep

    peaks = engine_sweep.starting_study()
    print("motor force [N]  peak pressure of the right cylinder by cycle [bar]")
    for force, bars in peaks.items():
        print(f"{force:8g}  " + " ".join(f"{bar:5.1f}" for bar in bars))
    if out is not None:
        _draw(out, (charts.starting_chart(peaks),))


def _fuel(out: Output | None) -> None:
    from bench.studies.engine import charts
    from bench.studies.engine import sweep as engine_sweep

    rows = engine_sweep.fuel_study()
    print("change of fuel  TDC [mm]  rpm   (fast model, heads disregarded)")
    for change, tdc_m, speed in rows:
        print(f"{change:+8.0%}  {tdc_m * 1e3:8.2f}  {speed:7.1f}")
    if out is not None:
        _draw(out, charts.fuel_charts(rows))


def _draw(out: Output, drawn: Sequence[Chart]) -> None:
    from bench.report.chart_picture import save

    with out.writing() as beside:
        save(drawn, beside)


@app.command()
def analyse(
    engine: Annotated[
        str, typer.Option("--engine", metavar="NAME", help="Engine: {two_chambers}.")
    ] = "nu",
    *,
    fuel_mg: Annotated[
        float | None, typer.Option("--fuel-mg", min=0.0, max=100.0, help="Fuel of a stroke.")
    ] = None,
    load: Annotated[
        float | None, typer.Option(min=0.0, max=1e5, help="Load coefficient [N/(m/s)].")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Page to write (.html).")] = None,
    force: Force = False,
) -> None:
    """Analyse the linear engine: A, B, C, poles, damping, Bode, step, root locus over the load."""
    from bench.studies.engine import analysis
    from hil.files import Output

    file = None if out is None else Output("--out", out, force)
    if file is not None:
        file.check(".html")
    found = analysis.cases(engine, None if fuel_mg is None else 1e-6 * fuel_mg, load)
    for case in found:
        print(case.name)
        for name, text in analysis.told(case):
            print(f"  {name:18} {text}")
    if file is not None:
        file.write(analysis.page(engine, found))


@app.command()
def precision(
    *,
    engine: EngineName = "nu-two-stroke",
    out: Annotated[Path | None, typer.Option(help="Table to write (.csv).")] = None,
    force: Force = False,
) -> None:
    """Measure work against precision: the fixed step beside scipy's LSODA and RK45."""
    from bench.studies.engine.precision import measure
    from hil.files import Output

    file = None if out is None else Output("--out", out, force)
    if file is not None:
        file.check(".csv")

    lines = ["method,step_s_or_rtol,times_real_time,tdc_error_um,peak_pressure_error_percent"]
    lines += [
        f"{p.method},{p.setting:g},{p.times_real_time:.2f},{p.tdc_error_m * 1e6:.4f},"
        f"{p.peak_error * 100.0:.6f}"
        for p in measure(engine)
    ]
    print("\n".join(lines))
    if file is not None:
        file.write("\n".join(lines) + "\n")


@app.command()
def sensitivities(
    model: Annotated[str, typer.Option(help="Engine model: {models}, or fmu:FILE.")] = "two-stroke",
    *,
    out: Annotated[Path | None, typer.Option(help="Scenario to write (.toml), with them.")] = None,
    force: Force = False,
    assignments: Assignments = None,
) -> None:
    """Find how strokes answer to small changes: a stroke map for the laws, of any engine."""
    from bench.studies.engine import sensitivities as work

    raise typer.Exit(work.run(model, assignments or [], out, force=force))


def register(root: typer.Typer) -> None:
    """Put the commands under `hil engine`."""
    root.add_typer(app, rich_help_panel=STUDIES)
