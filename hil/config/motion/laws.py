"""The model-based laws, a section each, and what several of them share."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from hil.config.base import Section, Tunable


class LearningConfig(Tunable):
    """How the model-based laws learn what share of the fuel acts, by cylinder.

    gain: part of what a stroke shows that is believed
    most: largest error of a charge that one stroke may show, as a share
    load_change: change of the load within a stroke, as a share, from which it teaches nothing
    inertia_gain: part of what a stroke's duration shows of the moving mass that is believed
    near_m: distance from the set point within which a law that takes over learns from the fuel
    offset_m: largest error of a predicted dead centre that is taken up
    """

    gain: float = Field(default=0.2, ge=0.0, le=1.0)
    inertia_gain: float = Field(default=0.15, ge=0.0, le=1.0)
    most: float = Field(default=0.2, gt=0.0, le=1.0)
    load_change: float = Field(default=0.04, gt=0.0, le=1.0)
    share_min: float = Field(default=0.5, gt=0.0, le=1.0)
    share_max: float = Field(default=2.0, ge=1.0, le=5.0)
    near_m: float = Field(default=0.3e-3, gt=0.0, le=0.01)
    offset_m: float = Field(default=2.0e-3, ge=0.0, le=0.01)


class QuietConfig(Tunable):
    """What the laws leave of their gains while dead centres scatter by combustion noise alone.

    share: of the gains
    least_m: scatter of the dead centres from which there is anything to be quiet about
    gate: an error of so many times the scatter is a change
    mean_gain: part by which the mean of one side's errors moves; beyond `gate` times its own
        scatter it is a change as well
    strokes: for which a change brings back all of the gains
    """

    enabled: bool = True
    share: float = Field(default=0.1, ge=0.0, le=1.0)
    least_m: float = Field(default=8.0e-5, gt=0.0, le=0.01)
    gate: float = Field(default=4.0, gt=0.0, le=100.0)
    mean_gain: float = Field(default=0.2, gt=0.0, le=1.0)
    strokes: int = Field(default=12, ge=1, le=1000)


class LoadEstimateConfig(Tunable):
    """The load from electric power and velocity.

    slowest_m_s: below this speed the power tells nothing of the load
    drift: standard deviation by which the scale of the load moves from one measurement to the next
    gate: innovations beyond so many standard deviations are a load step
    step_min: least change of the scale that counts as one
    retrim: change of the load, as a share, that is worth another fuel
    """

    slowest_m_s: float = Field(default=0.4, gt=0.0, le=5.0)
    power_grid_w: float = Field(default=0.6, gt=0.0, le=100.0)
    drift: float = Field(default=3.0e-4, ge=0.0, le=0.1)
    gate: float = Field(default=4.5, gt=0.0, le=100.0)
    step_min: float = Field(default=5.0e-3, ge=0.0, le=1.0)
    noise_floor_m_s: float = Field(default=1.0e-3, gt=0.0, le=1.0)
    noise_gain: float = Field(default=0.02, ge=0.0, le=1.0)
    retrim: float = Field(default=2.0e-3, ge=0.0, le=1.0)


class PdfConfig(Tunable):
    """Where the load that is fed forward comes from: measured power, or the command alone."""

    load_from: Literal["power", "command"] = "power"


class PredictiveConfig(Tunable):
    """The load from mid-stroke velocity; all are shares of the load.

    drift: standard deviation by which the load moves in a stroke
    gate: innovations beyond so many standard deviations are a load step
    poor_map_trust: part of an inference that is believed where the map misses the steady speed
    """

    poor_map_trust: float = Field(default=0.2, gt=0.0, le=1.0)
    drift: float = Field(default=4.0e-3, ge=0.0, le=1.0)
    gate: float = Field(default=3.0, gt=0.0, le=100.0)
    noise_floor: float = Field(default=1.0e-3, gt=0.0, le=1.0)
    noise_gain: float = Field(default=0.1, ge=0.0, le=1.0)


class ObserverConfig(Tunable):
    """The extended state observer.

    drift_n_s_m, drift_m_s: standard deviations by which load and velocity move in a tick unforeseen
    step_min_m_s, slowest_m_s: least innovation and least speed at which one is a load step
    charge_spread: standard deviation of a charge about what was asked for, as a share
    load_jump: size of a load step, as a share, that an innovation beyond the gate stands for
    """

    drift_n_s_m: float = Field(default=1.0, ge=0.0, le=100.0)
    drift_m_s: float = Field(default=3.0e-4, ge=0.0, le=1.0)
    slowest_m_s: float = Field(default=0.4, ge=0.0, le=5.0)
    charge_spread: float = Field(default=0.01, gt=0.0, le=1.0)
    load_jump: float = Field(default=0.2, gt=0.0, le=1.0)
    gate: float = Field(default=4.0, gt=0.0, le=100.0)
    step_min_m_s: float = Field(default=3.0e-3, ge=0.0, le=1.0)
    noise_floor_m_s: float = Field(default=1.0e-3, gt=0.0, le=1.0)
    noise_gain: float = Field(default=0.02, ge=0.0, le=1.0)


class MachineLawConfig(Tunable):
    """The machine's part within a stroke.

    gain: share of the predicted TDC error that one tick's order is to remove
    least, most: limits of the load as shares of the one that the supervisory layer wants
    begin_s: time after a dead centre before which the load is left alone
    release_s: time before the dead centre from which the load is let go
    """

    gain: float = Field(default=0.8, gt=0.0, le=1.0)
    least: float = Field(default=0.3, ge=0.0, le=1.0)
    most: float = Field(default=2.0, ge=1.0, le=5.0)
    begin_s: float = Field(default=2.0e-3, ge=0.0, le=0.1)
    release_s: float = Field(default=1.0e-3, ge=0.0, le=0.1)


class OwnLawConfig(Section):
    """A law of the user's own: `name = "./my_law.py"`, or the name that a package offers.

    name: by which it is known; file, sha256: where it is, and of what content
    settings: what its `Settings` declares; signals: what it tells of itself, meaning by name
    """

    name: str = ""
    file: str = ""
    sha256: str = ""
    settings: dict[str, float | bool | str] = Field(default_factory=dict)
    signals: dict[str, str] = Field(default_factory=dict)
