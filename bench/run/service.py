"""What the units start: one process as a service, and what prepares a reload of its set points.

python -m bench.run.service plant|controller --config FILE [--logs DIRECTORY]
python -m bench.run.service sensors --config FILE     in place of the plant: analogue inputs
python -m bench.run.service set-points --config FILE --out FILE
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from bench.run.resolve import resolve
from drivers.system.process import guarded
from drivers.system.service import Service, log_file
from hil.config.load import read_scenario
from hil.config.resolved import Resolved
from hil.errors import ConfigError
from hil.files import Output
from hil.wire import commands


def serve(process: str, config: Path, logs: Path | None) -> int:
    """Run one process until it is asked to end.

    Raises: HilError with the line that goes to the journal
    """
    scenario = read(config)
    service = Service(process, scenario.loop.rate_hz)
    if process == "sensors":
        from drivers.analog.source import run as run_sensors

        return run_sensors(scenario, service)
    log = None if logs is None else log_file(logs, process)
    if process == "plant":
        from plant.main import run as run_plant

        return run_plant(scenario, log, service)
    from controller.main import run as run_controller

    return run_controller(scenario, log, service)


def read(config: Path) -> Resolved:
    """Read and resolve the scenario of a service; refuse what only a run of the bench can do.

    Raises: ConfigError
    """
    scenario = resolve(read_scenario(config))
    if scenario.loop.clock != "realtime":
        raise ConfigError(f"{config}: loop.clock: a service runs in real time only")
    if scenario.link.kind == "memory":
        raise ConfigError(f"{config}: link.kind: memory joins nothing across processes")
    return scenario


def prepare_set_points(config: Path, out: Path) -> int:
    """Check a changed configuration and leave its set points where the controller finds them."""
    file = Output("--out", out, force=True)
    file.check()
    controller = read(config).controller
    set_points = {
        "tdc_ref_m": controller.tdc_ref_m,
        "target_power_w": controller.supervisory.target_power_w,
    }
    command = commands.read({"kind": "set-point", **set_points}, "reload")
    file.write(commands.write(command))
    return 0


def run(argv: list[str] | None = None) -> int:
    """Read the arguments and do what they say."""
    parser = argparse.ArgumentParser(prog="service", description=__doc__)
    parser.add_argument("what", choices=("plant", "controller", "sensors", "set-points"))
    parser.add_argument("--config", type=Path, required=True)
    parser.add_argument("--logs", type=Path)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args(argv)
    if given.what != "set-points":
        return serve(given.what, given.config, given.logs)
    if given.out is None:
        parser.error("set-points needs --out")
    return prepare_set_points(given.config, given.out)


def main() -> int:
    """Entry point of `python -m bench.run.service`."""
    return guarded(run)


if __name__ == "__main__":
    sys.exit(main())
