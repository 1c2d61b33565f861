"""The command `hil engine sensitivities`: a stroke map of any engine, as table and as scenario."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from bench.progress import progress
from bench.run.resolve import resolve
from bench.run.scenarios import find
from bench.run.sensitivities import FRACTIONS, identify
from bench.studies.campaign.table import to_toml
from hil.config.load import build, with_override
from hil.config.motion.stroke_map import Effects, SensitivitiesConfig
from hil.files import Output
from hil.toml import assignments_of, read_toml


def run(model: str, assignments: list[str], out: Path | None, *, force: bool) -> int:
    """Find the sensitivities, print them, and write a scenario that runs with them.

    Raises: ConfigError when the engine cannot run so, or the file cannot be written
    """
    file = None if out is None else Output("--out", out, force)
    if file is not None:
        file.check(".toml")
    tree: dict[str, Any] = read_toml(find("steady"))
    for key, value in [("plant.model", model), *assignments_of(assignments)]:
        tree = with_override(tree, key, value)
    scenario = resolve(build(tree, f"engine sensitivities of {model}"))
    with progress("sensitivities", len(FRACTIONS), "places of a stroke") as advance:
        found = identify(scenario, advance)
    print(table(found))
    if file is not None:
        given = {"kind": "sensitivities", "sensitivities": found.model_dump()}
        file.write(to_toml(with_override(tree, "controller.stroke_map", given)))
        print(f"{out}: hil run {out}")
    return 0


def table(found: SensitivitiesConfig) -> str:
    """The settled stroke and what each of its figures gains by start, fuel and load."""
    rows = (
        ("end [mm]", found.tdc_m, found.end), ("duration [ms]", found.stroke_s, found.duration),
        ("mid-stroke speed [mm/s]", found.v_mid_m_s, found.speed),
        ("mid-stroke at [ms]", found.mid_s, found.passing),
    )  # fmt: skip
    lines = [
        found.origin,
        f"{'':24}{'settled':>10}{'a mm start':>12}{'1 % fuel':>10}{'1 % load':>10}",
    ]
    return "\n".join([*lines, *(_row(*row) for row in rows)])


def _row(name: str, settled: float, effects: Effects) -> str:
    return (
        f"{name:24}{1e3 * settled:10.3f}{effects.start:12.4f}{10.0 * effects.fuel:10.4f}"
        f"{10.0 * effects.load:10.4f}"
    )
