"""What `hil replay` says."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.table import Table

from bench.logs.replay.differences import Difference, Records
from bench.logs.replay.outcome import Found, Outcome
from bench.report.quantities import thousands
from hil.log import Log, topics

_SHOWN = 12
_MG = 1e6


def show(console: Console, path: Path, outcome: Outcome, log: Log) -> None:
    """Print the verdict and, where there is a difference, what is known about it."""
    ticks = f"{thousands(outcome.ticks)} ticks"
    speed = outcome.simulated_s / max(outcome.cpu_s, 1e-9)
    for note in outcome.notes:
        console.print(f"  note: {note}", style="dim")
    for gap in outcome.gaps:
        console.print(f"  note: {gap_line(gap.first_tick, gap.next_tick)}", style="yellow")
    if outcome.found is None:
        line = f"{path}: identical, {ticks} ({outcome.process}, {speed:.0f} × real time)"
        console.print(line, style="green")
        return
    found = outcome.found
    first = found.differences[0]
    console.print(
        f"{path}: differs first at tick {found.tick} (t = {first.t_ns * 1e-9:.6f} s, "
        f"{outcome.process}); {thousands(outcome.different)} of {ticks} differ",
        style="red",
    )
    console.print(_fields(found.differences))
    strokes = _strokes(Records(log), found)
    if strokes is not None:
        console.print(strokes)


def gap_line(first_tick: int, next_tick: int) -> str:
    """Say which ticks are not in a log."""
    if next_tick < 0:
        return f"from tick {first_tick} on ticks are missing, and no snapshot follows"
    return (
        f"ticks are missing from {first_tick} on: the replay goes on from the snapshot of tick "
        f"{next_tick}"
    )


def _fields(differences: tuple[Difference, ...]) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 2), header_style="dim")
    for title in ("field", "recorded", "replayed", "difference"):
        table.add_column(title, justify="left" if title == "field" else "right")
    for d in differences[:_SHOWN]:
        unit = f" [{d.unit}]" if d.unit else ""
        table.add_row(f"{d.topic} {d.field}{unit}", _shown(d.recorded), _shown(d.replayed), _gap(d))
    if len(differences) > _SHOWN:
        table.add_row(f"and {len(differences) - _SHOWN} more", "", "", "")
    return table


def _shown(value: object) -> str:
    text = value.hex() if isinstance(value, bytes) else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _gap(d: Difference) -> str:
    both = (d.recorded, d.replayed)
    if all(isinstance(v, (int, float)) for v in both):
        return f"{d.replayed - d.recorded:+.3g}"  # type: ignore[operator]
    return ""


def _strokes(records: Records, found: Found) -> Table | None:
    """Set the strokes around the first difference side by side."""
    then, now = {}, {}
    for recorded, replayed in found.around:
        then.update(_dead_centres(records.then(recorded)))
        now.update(_dead_centres(records.now(replayed)))
    if not then:
        return None
    table = Table(box=None, padding=(0, 2, 0, 2), header_style="dim")
    titles = ("stroke", "t [s]", "TDC recorded [mm]", "replayed [mm]", "fuel recorded [mg]",
              "replayed [mg]")  # fmt: skip
    for title in titles:
        table.add_column(title, justify="right")
    for index, (t_ns, tdc_m, fuel_kg) in sorted(then.items()):
        _, other_tdc_m, other_fuel_kg = now.get(index, (0, float("nan"), float("nan")))
        table.add_row(
            str(index), f"{t_ns * 1e-9:.4f}", f"{tdc_m * 1e3:.6f}", f"{other_tdc_m * 1e3:.6f}",
            f"{fuel_kg * _MG:.6f}", f"{other_fuel_kg * _MG:.6f}",
        )  # fmt: skip
    return table


def _dead_centres(
    decoded: list[tuple[str, dict[str, object]]],
) -> dict[int, tuple[int, float, float]]:
    """Return (instant, distance, fuel) by number, from whichever topic has them."""
    found: dict[int, tuple[int, float, float]] = {}
    for name, values in decoded:
        v: dict[str, float] = values  # type: ignore[assignment]
        if name == topics.STROKE.name:
            found[int(v["index"])] = (int(v["t_ns"]), v["tdc_m"], v["fuel_kg"])
        elif name == topics.TRUTH.name:
            found[int(v["dc_index"])] = (int(v["dc_t_ns"]), abs(v["dc_x_m"]), v["fuel_kg"])
    return found
