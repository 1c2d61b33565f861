"""What a campaign varies: read from TOML, drawn by seed and number of the run alone."""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from bench.run import scenarios
from bench.run.resolve import resolve
from controller.motion.choice import check_name
from hil import compiled
from hil.config.base import OneOf, Section
from hil.config.check import check
from hil.config.engine.models import Model
from hil.config.load import build, with_override
from hil.config.prototypes import DEFAULT, PROTOTYPES
from hil.config.resolved import Resolved
from hil.errors import ConfigError
from hil.nearest import listed
from hil.toml import Tree, read_toml

PACKAGED = compiled.root() / "bench" / "campaigns"

TwoChambers = Annotated[str, OneOf(e.name for e in PROTOTYPES.values() if e.chambers == 2)]
Scalar = bool | int | float | str


class Spread(Section):
    """How one key varies: uniform in [low, high], one of `choices`, or nominal times 1 +- relative.

    A relative spread belongs to a figure of the prototype (plant.engine.*).
    """

    low: float | None = None
    high: float | None = None
    choices: tuple[Scalar, ...] | None = None
    relative: float | None = Field(default=None, gt=0.0, lt=1.0)

    @model_validator(mode="after")
    def _is_one_kind(self) -> Spread:
        given = [self.low is not None and self.high is not None, bool(self.choices),
                 self.relative is not None]  # fmt: skip
        if sum(given) != 1 or (self.low is None) != (self.high is None):
            raise ValueError("accepted: low and high, or choices, or relative")
        return self


class LoadSpread(Section):
    """The disturbance: a step or a ramp of the load, on top of an error of the load constant.

    A ramp is a staircase of one step a stroke.
    """

    low: float = Field(default=0.8, ge=0.0, le=10.0)
    high: float = Field(default=1.2, ge=0.0, le=10.0)
    constant_error: float = Field(default=0.1, ge=0.0, lt=1.0)
    at_s: float = Field(default=2.0, ge=0.1, le=1e3)
    ramp_share: float = Field(default=0.25, ge=0.0, le=1.0)
    ramp_s: float = Field(default=0.5, gt=0.0, le=10.0)


class MisfireSpread(Section):
    """Misfires: in a share of the runs, each combustion fails with this probability."""

    run_share: float = Field(default=0.25, ge=0.0, le=1.0)
    probability: float = Field(default=0.01, ge=0.0, le=0.5)


class SilenceSpread(Section):
    """Silences of the link, so many a second, each at any phase: of samples, of answers or of both.

    low_s, high_s: how long; they come from `begin_s` on, and none in the last second of a run
    """

    per_s: float = Field(default=1.0, gt=0.0, le=20.0)
    low_s: float = Field(default=1e-3, gt=0.0, le=0.1)
    high_s: float = Field(default=9e-3, gt=0.0, le=0.1)
    begin_s: float = Field(default=0.3, ge=0.0, le=1e3)


class StopRule(Section):
    """When fewer runs than `runs` are enough: once every law's interval of confidence is narrow.

    figure: a share of the runs (`lost`, `contacts`), or the mean of a figure over those that have
    it; half_width: of the interval, in the figure's unit; least: runs of each law before a look
    """

    figure: Literal[
        "lost", "contacts", "peak_mm", "settling_band_ms", "settling_mean_ms", "sigma_mm", "mean_mm"
    ] = "lost"
    half_width: float = Field(gt=0.0, le=1e6)
    confidence: float = Field(default=0.95, ge=0.5, le=0.9999)
    least: int = Field(default=200, ge=10, le=1_000_000)

    @property
    def is_share(self) -> bool:
        """Whether the figure is a yes or no of each run."""
        return self.figure in ("lost", "contacts")


class Campaign(Section):
    """A campaign: how many runs of what, and what varies; with a stopping rule at most so many."""

    name: str = Field(default="campaign", pattern=r"^[a-z0-9][a-z0-9-]{0,63}$")
    scenario: str = "steady"
    runs: int = Field(ge=1, le=1_000_000)
    seed: int = Field(default=1, ge=0, le=2**31)
    duration_s: float = Field(default=5.0, gt=0.0, le=3600.0)
    controllers: tuple[str, ...] = ("cascade",)
    models: tuple[Model, ...] = ("harmonic",)
    prototypes: tuple[TwoChambers, ...] = (DEFAULT.name,)
    load: LoadSpread = LoadSpread()
    misfires: MisfireSpread | None = None
    silences: SilenceSpread | None = None
    stop: StopRule | None = None
    set: dict[str, Scalar] = Field(default_factory=dict)
    vary: dict[str, Spread] = Field(default_factory=dict)


def packaged() -> list[str]:
    """Return the names of the campaigns that come with the project."""
    return sorted(path.stem for path in PACKAGED.glob("*.toml"))


def read(name: str) -> Campaign:
    """Read a campaign by name or by a path that ends in .toml.

    Raises: ConfigError that names the file and what is accepted
    """
    path = Path(name) if name.endswith(".toml") else PACKAGED / f"{name}.toml"
    if not path.is_file() and (PACKAGED / path.name).is_file():
        path = PACKAGED / path.name
    if not path.is_file():
        raise ConfigError(
            f"campaign {name!r}: accepted is a path to a .toml file, or: {listed(name, packaged())}"
        )
    campaign = check(Campaign, read_toml(path), str(path))
    for law in campaign.controllers:
        check_name(law, f"{path}: controllers")
    return campaign


class Drawn(Section):
    """One run: what was drawn, flat, and the overrides that make it."""

    index: int
    facts: dict[str, Scalar]
    overrides: dict[str, Any]
    silences: tuple[tuple[float, float, str], ...] = ()
    """Each with its beginning and end [s], and of what: samples, answers or both."""


def draw(campaign: Campaign, index: int) -> Drawn:
    """Draw run `index`; the law changes fastest, so that neighbours share all other draws."""
    laws = campaign.controllers
    law, place = laws[index % len(laws)], index // len(laws)
    rng = np.random.default_rng([campaign.seed, place])
    model = str(rng.choice(campaign.models))
    prototype = str(rng.choice(campaign.prototypes))
    facts: dict[str, Scalar] = {"controller": law, "model": model, "prototype": prototype}
    overrides: dict[str, Any] = {
        "run.duration_s": campaign.duration_s,
        "run.seed": int(rng.integers(1, 2**31)),
        "loop.clock": "lockstep",
        "plant.model": model,
        "plant.prototype": prototype,
        "controller.name": law,
        **campaign.set,
    }
    for key, spread in campaign.vary.items():
        value = _value(rng, key, spread, prototype)
        overrides[key] = facts[key] = value
    overrides |= _load_events(campaign.load, rng, facts)
    if campaign.misfires is not None:
        overrides |= _misfire_events(campaign, campaign.misfires, rng, facts)
    silences = () if campaign.silences is None else _silences(campaign, campaign.silences, rng)
    return Drawn(index=index, facts=facts, overrides=overrides, silences=silences)


def _value(rng: np.random.Generator, key: str, spread: Spread, prototype: str) -> Scalar:
    """One value of a spread."""
    if spread.choices is not None:
        return spread.choices[int(rng.integers(len(spread.choices)))]
    if spread.relative is None:
        return float(rng.uniform(spread.low or 0.0, spread.high or 0.0))
    figure = key.rpartition(".")[2]
    nominal = getattr(PROTOTYPES[prototype], figure, None)
    if not key.startswith("plant.engine.") or not isinstance(nominal, float):
        raise ConfigError(f"vary.{key}: relative belongs to a figure of plant.engine")
    return nominal * float(rng.uniform(1.0 - spread.relative, 1.0 + spread.relative))


def _load_events(
    load: LoadSpread, rng: np.random.Generator, facts: dict[str, Scalar]
) -> dict[str, Any]:
    """The error of the load constant from the start, and the step or ramp."""
    constant = float(rng.uniform(1.0 - load.constant_error, 1.0 + load.constant_error))
    value = float(rng.uniform(load.low, load.high))
    fraction = float(rng.uniform(0.0, 1.0))
    ramp = bool(rng.random() < load.ramp_share)
    facts |= {"load_constant": constant, "load": value, "fraction": fraction, "ramp": ramp}
    events: dict[str, Any] = {
        "events.constant": {"kind": "load-scale", "value": constant, "at_s": 0.0}
    }
    steps = max(round(load.ramp_s / 0.025), 2) if ramp else 1
    for k in range(1, steps + 1):
        part = 1.0 + (value - 1.0) * k / steps
        events[f"events.load{'' if steps == 1 else f'_{k:02d}'}"] = {
            "kind": "load-scale",
            "value": constant * part,
            "at_s": load.at_s + (k - 1) * load.ramp_s / steps if ramp else load.at_s,
            "at_stroke_fraction": fraction,
        }
    return events


def _misfire_events(
    campaign: Campaign, misfires: MisfireSpread, rng: np.random.Generator,
    facts: dict[str, Scalar],
) -> dict[str, Any]:  # fmt: skip
    """Misfires at the instants of a Poisson process, in the runs that have them."""
    has_them = bool(rng.random() < misfires.run_share)
    facts["with_misfires"] = has_them
    events: dict[str, Any] = {}
    strokes_per_s = 40.0
    t_s, k = 0.5, 0
    while has_them and misfires.probability > 0.0:
        t_s += float(rng.exponential(1.0 / (misfires.probability * strokes_per_s)))
        if t_s >= _until_s(campaign) or not math.isfinite(t_s):
            break
        k += 1
        events[f"events.misfire_{k:02d}"] = {"kind": "misfire", "at_s": t_s}
    return events


def _silences(
    campaign: Campaign, spread: SilenceSpread, rng: np.random.Generator
) -> tuple[tuple[float, float, str], ...]:
    """Silences at the instants of a Poisson process, none while another one lasts."""
    found: list[tuple[float, float, str]] = []
    t_s = spread.begin_s
    while (t_s := t_s + float(rng.exponential(1.0 / spread.per_s))) < _until_s(campaign):
        end_s = t_s + float(rng.uniform(spread.low_s, spread.high_s))
        found.append((t_s, end_s, str(rng.choice(("samples", "answers", "both")))))
        t_s = end_s + spread.high_s
    return tuple(found)


def _until_s(campaign: Campaign) -> float:
    """When disturbances cease that the engine has to come back from before the run ends [s]."""
    return campaign.duration_s - min(1.0, 0.5 * campaign.duration_s)


@lru_cache(maxsize=32)
def _nominal_preset(scenario: str, model: str, prototype: str, tdc_ref_m: float | None) -> Any:  # noqa: ANN401
    """What the controller believes: the steady state of the unvaried engine on that model."""
    tree = scenarios.tree_of(scenario)
    tree = with_override(tree, "plant.model", model)
    tree = with_override(tree, "plant.prototype", prototype)
    if tdc_ref_m is not None:
        tree = with_override(tree, "controller.tdc_ref_m", tdc_ref_m)
    return resolve(build(tree, scenario)).controller.preset.model_dump()


def tree_of(campaign: Campaign, drawn: Drawn) -> Tree:
    """The scenario of a run as a tree: base, draws, and the preset of the nominal engine."""
    tree = scenarios.tree_of(campaign.scenario)
    tree.pop("expect", None)
    for key, value in drawn.overrides.items():
        tree = with_override(tree, key, value)
    facts = drawn.overrides
    tdc = facts.get("controller.tdc_ref_m")
    preset = _nominal_preset(campaign.scenario, facts["plant.model"], facts["plant.prototype"], tdc)
    return with_override(tree, "controller.preset", preset)


def scenario_of(campaign: Campaign, drawn: Drawn) -> Resolved:
    """The resolved scenario of a run.

    Raises: ConfigError when it cannot begin
    """
    return resolve(build(tree_of(campaign, drawn), f"{campaign.name} run {drawn.index}"))
