"""The calibration of a plant: of its model and engine, with the figures that it has of its own."""

from __future__ import annotations

from pathlib import Path

from hil.config.detailed import OF_THE_ENGINE, Calibration, calibrations, read_file
from hil.config.plant import PlantConfig
from hil.config.prototypes import model_files
from hil.errors import ConfigError
from hil.toml import read_toml


def of_plant(config: PlantConfig) -> Calibration:
    """Return the calibration of a plant's model and engine, its own figures put in.

    A figure that the calibration states itself is not taken from the engine.

    Raises: ConfigError when there is none, or a figure is none that it takes
    """
    known = calibrations()
    found = known.get((config.model, config.prototype))
    if found is None:
        accepted = ", ".join(f"{m} with {e}" for m, e in known)
        raise ConfigError(
            f"plant.model {config.model} has no calibration for plant.prototype "
            f"{config.prototype}; accepted: {accepted}"
        )
    given = config.engine.model_dump(exclude_none=True)
    if not given and not config.own.name:
        return found
    path = model_files(config.prototype)[config.model]
    taken = _taken_from_the_engine(path) & type(config.engine).model_fields.keys()
    for key in given.keys() - taken:
        raise ConfigError(
            f"plant.engine.{key}: model {config.model} takes none such from its engine; accepted "
            f"here: {', '.join(sorted(taken))}"
        )
    own = config.own.models.get(config.model, {})
    return read_file(path, config.resolved_prototype(), own)


def _taken_from_the_engine(path: Path) -> set[str]:
    """The engine's figures that a calibration takes: those that it does not state itself."""
    tree = read_toml(path)
    return {
        figure
        for table, keys in OF_THE_ENGINE.items()
        for key, figure in keys.items()
        if isinstance(tree.get(table), dict) and key not in tree[table]
    }


@lru_cache(maxsize=1)
def literature() -> tuple[Calibration, ...]:
    """Engines of the literature (thesis chapter 2), to be studied by themselves.

    No controller runs them: some are faster than 8 m/s, the most that a position frame holds.

    Raises: ConfigError when one of them cannot be used
    """
    paths = sorted((ENGINES / "literature").glob("*.toml"))
    return tuple(check(Calibration, read_toml(path), str(path)) for path in paths)
