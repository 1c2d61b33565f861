"""Configuration of what the controller believes of a stroke."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from hil.config.base import Section

Numbers = tuple[float, ...]

STATIONS_MIN = 4


class Effects(Section):
    """What one figure of a stroke gains by its start [1/m], and by ln fuel and ln load."""

    start: float
    fuel: float
    load: float


class Stations(Section):
    """Places along the stroke, in order, and what a piston that is there has still before it.

    z_m, v_m_s, left_s: position, velocity there, time to the dead centre
    pull_m_s2: acceleration but for the load; pull_by_fuel: what twice the fuel adds
    end_by_v, end_by_fuel, end_by_load: of the distance of the dead centre [s], [m], [m]
    left_by_v, left_by_fuel, left_by_load: of the time left [s2/m], [s], [s]
    """

    z_m: Numbers = Field(min_length=STATIONS_MIN)
    v_m_s: Numbers
    left_s: Numbers
    pull_m_s2: Numbers
    pull_by_fuel: Numbers
    end_by_v: Numbers
    end_by_fuel: Numbers
    end_by_load: Numbers
    left_by_v: Numbers
    left_by_fuel: Numbers
    left_by_load: Numbers

    @model_validator(mode="after")
    def _even(self) -> Stations:
        """As many figures of each kind as there are places, and the places in order."""
        lengths = {len(getattr(self, name)) for name in type(self).model_fields}
        rising = all(a < b for a, b in zip(self.z_m, self.z_m[1:], strict=False))
        if len(lengths) > 1 or not rising:
            raise ValueError("stations need rising z_m and as many of each other figure")
        return self


class SensitivitiesConfig(Section):
    """A settled engine, and how its strokes answer to small changes (`hil engine sensitivities`).

    origin: what they are of, and how they were found; for people, nothing acts on it
    tdc_m, fuel_kg, load_n_s_m, mass_kg: of the settled engine
    stroke_s, v_mid_m_s, mid_s: duration of its strokes, speed at mid-stroke, and when
    end, duration, speed, passing: of where a stroke ends, how long it takes, its mid-stroke speed
        and when that is
    """

    origin: str
    tdc_m: float = Field(gt=0.0, le=0.05)
    fuel_kg: float = Field(gt=0.0, le=1.0e-4)
    load_n_s_m: float = Field(gt=0.0, le=5000.0)
    mass_kg: float = Field(gt=0.0, le=1000.0)
    stroke_s: float = Field(gt=0.0, le=1.0)
    v_mid_m_s: float = Field(gt=0.0, le=50.0)
    mid_s: float = Field(gt=0.0, le=1.0)
    end: Effects
    duration: Effects
    speed: Effects
    passing: Effects
    stations: Stations


class StrokeMapConfig(Section):
    """What the model-based laws and the timing believe of a stroke (docs/control.md).

    kind: which map; the bench gives the one of the plant's model. `auto` is the linear one where
        that meets the preset's three figures, else the gas law where that does
    sensitivities: of the kind `sensitivities`; the bench computes them for a law that needs a map
    """

    kind: Literal["auto", "linear", "gas-law", "sensitivities"] = "auto"
    sensitivities: SensitivitiesConfig | None = None
