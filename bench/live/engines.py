"""Which engine is meant: that of a run's directory, or the one that runs.

Read without the configuration's classes, whose import takes longer than a command may.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final, NamedTuple

from bench.live.sockets import running
from drivers.zenoh import sockets
from drivers.zenoh.channels import ZenohOperator
from drivers.zenoh.node import ZenohNode
from drivers.zenoh.sockets import Endpoints, ZenohSection
from hil.errors import ConfigError, LinkError
from hil.files import read_regular

_SIDES: Final = ("plant", "controller")
_ENDPOINTS: Final = ("engine", "plant_endpoint", "controller_endpoint", "allow_insecure")


class Engine(NamedTuple):
    """A pair of processes, by where they can be met.

    where: directory of its run, or that of its sockets
    """

    section: ZenohSection
    lockstep: bool
    link: str
    where: str

    def operator(self, name: str) -> ZenohOperator:
        """Join it as an operator.

        Raises: ConfigError for a run in memory, LinkError when the session does not open
        """
        if self.link == "memory":
            raise ConfigError(
                f"{self.where}: link.kind: a run in memory has no keys to ask it over"
            )
        return ZenohOperator(ZenohNode("bench", self.section, lockstep=self.lockstep), name)

    def records_of(self, side: sockets.Side) -> Path:
        """Return where what a process records can be seen, see drivers/recorder/tap.py."""
        return sockets.records_socket(self.section, side)


def engine_of(run: Path | None) -> Engine:
    """Return the engine of a run (its directory, scenario.json or a .toml file), or the one there.

    Raises: ConfigError when several run, naming them; LinkError when none does
    """
    if run is not None:
        directory = run.parent if run.suffix == ".mcap" else run
        return _of_file(directory / "scenario.json" if directory.is_dir() else run)
    found = [_of_file(each / "scenario.json") for each in running()]
    found += [_at_default(name) for name in _names()]
    if len(found) > 1:
        names = ", ".join(sorted(engine.where for engine in found))
        raise ConfigError(f"several engines run; accepted is --run with one of: {names}")
    if not found:
        raise LinkError("no engine runs (of this user, or as a service)")
    return found[0]


def _of_file(path: Path) -> Engine:
    """The engine of a scenario; one with certificates, or a .toml file, is read as a whole."""
    if path.suffix == ".json":
        tree = _json(path)
        link = tree.get("link", {})
        zenoh = link.get("zenoh", {})
        if not zenoh.get("tls"):
            given = {key: zenoh[key] for key in _ENDPOINTS if key in zenoh}
            lockstep = tree.get("loop", {}).get("clock") == "lockstep"
            return Engine(Endpoints(**given), lockstep, link.get("kind", "zenoh"), str(path.parent))
    from hil.config.load import read_scenario

    scenario = read_scenario(path)
    lockstep = scenario.loop.clock == "lockstep"
    return Engine(scenario.link.zenoh, lockstep, scenario.link.kind, str(path))


def _json(path: Path) -> dict[str, Any]:
    try:
        tree = json.loads(read_regular(path))
    except ValueError as error:
        raise ConfigError(f"{path}: not JSON: {error}") from None
    if not isinstance(tree, dict):
        raise ConfigError(f"{path}: no scenario")
    return tree


def _names() -> list[str]:
    """Names of the engines whose sockets are in this user's directory, or the services'."""
    ends = tuple(f"-{side}.sock" for side in _SIDES)
    found = set()
    for folder in {sockets.own_directory(), sockets.SERVICES}:
        try:
            files = [file.name for file in folder.iterdir() if sockets.is_served(file)]
        except OSError:  # there is none, or it is closed to this user
            continue
        found |= {name.removesuffix(end) for name in files for end in ends if name.endswith(end)}
    return sorted(found)


def _at_default(name: str) -> Engine:
    section = Endpoints(name)
    return Engine(section, False, "zenoh", f"engine {name} in {sockets.found(name)}")
