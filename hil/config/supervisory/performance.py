"""What an engine delivers at which dead centre and load: a map that a command makes of a model."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Self

from pydantic import Field, model_validator

from hil.config.base import Section

Positive = Annotated[float, Field(gt=0.0, le=1.0e5)]
Row = Annotated[tuple[Positive, ...], Field(min_length=2)]
Rows = Annotated[tuple[Row, ...], Field(min_length=1)]
Reason = Annotated[str, Field(min_length=1, max_length=80)]

FIGURES = ("power_w", "fuel_kg", "v_mid_m_s", "stroke_s", "efficiency", "throttle")


class MapOrigin(Section):
    """Where a map comes from; for people, nothing acts on it.

    controller: law that held the dead centres
    strokes: of which each point is the mean
    """

    model: str
    prototype: str
    controller: str
    version: str
    strokes: int = Field(ge=1)


class PerformanceMap(Section):
    """Steady running: a row for each dead centre, in it a value for each load, by rising load.

    tdc_m: dead centres of the rows, rising
    efficiency: electric energy as a share of that of the fuel
    throttle: opening with which it was reached
    ends: what keeps the engine from more than the last load of each row
    """

    origin: MapOrigin
    tdc_m: Annotated[tuple[Positive, ...], Field(min_length=1)]
    load_n_s_m: Rows
    power_w: Rows
    fuel_kg: Rows
    v_mid_m_s: Rows
    stroke_s: Rows
    efficiency: Rows
    throttle: Rows
    ends: tuple[Reason, ...]

    @model_validator(mode="after")
    def _is_a_table(self) -> Self:
        sizes = [len(row) for row in self.load_n_s_m]
        for name in FIGURES:
            if [len(row) for row in getattr(self, name)] != sizes:
                raise ValueError(f"{name} needs a value for each of load_n_s_m")
        if not len(self.tdc_m) == len(self.ends) == len(sizes):
            raise ValueError("tdc_m and ends need a value for each row of load_n_s_m")
        return self

    @model_validator(mode="after")
    def _rises(self) -> Self:
        for name in ("load_n_s_m", "power_w"):
            if not all(map(_is_rising, getattr(self, name))):
                raise ValueError(f"{name} must rise from one value of a row to the next")
        if not _is_rising(self.tdc_m):
            raise ValueError("tdc_m must rise from one row to the next")
        return self


def _is_rising(values: tuple[float, ...]) -> bool:
    return all(a < b for a, b in pairwise(values))
