"""A loop's first change takes no longer than any other: what is built once is built before it."""

import subprocess
import sys

import pytest

WORK = """
import sys
from hil.config.base import Section
from hil.config.scenario import Scenario
from hil.errors import ConfigError
from hil.names.parameters import apply
from drivers.system.process import rehearse
from hil.values import Value

side, key, value = sys.argv[1:]
rehearse(Value(), getattr(Scenario.model_validate({"name": "one"}), side))
config = getattr(Scenario.model_validate({"name": "one"}), side)


def sections(kind):
    yield kind
    for below in kind.__subclasses__():
        yield from sections(below)


def built():
    return {kind.__name__ for kind in sections(Section) if kind.__pydantic_complete__}


before, modules = built(), set(sys.modules)
try:
    apply(config, {key: float(value)})
except ConfigError as error:
    print(error)
print(sorted(built() - before), sorted(set(sys.modules) - modules))
"""


def told(*arguments):
    done = subprocess.run(
        [sys.executable, "-c", WORK, *arguments], capture_output=True, text=True, check=True
    )
    return done.stdout.splitlines()


@pytest.mark.parametrize(
    ("side", "key", "value"),
    [("controller", "controller.tdc_ref_m", "0.015"), ("plant", "plant.sensors.noise_x_m", "1e-6")],
)
def test_nothing_is_built_or_imported_by_the_first_change(side, key, value):
    assert told(side, key, value) == ["[] []"]


def test_nothing_is_imported_to_refuse_a_key():
    refusal, built = told("controller", "controller.tdc_ref", "0.015")
    assert refusal.startswith("'controller.tdc_ref' is no parameter")
    assert built == "[] []"
