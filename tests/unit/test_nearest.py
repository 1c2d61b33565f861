"""A name that there is not is answered with what may have been meant, by every command."""

import subprocess
import sys

import pytest

from bench.run import scenarios
from bench.run.checks.signals import source_of
from bench.run.resolve import resolve
from bench.studies.campaign import config as campaigns
from bench.studies.tune import keys_of
from controller.motion.choice import check_name
from hil.config import detailed
from hil.errors import ConfigError
from hil.names import parameters, signals
from hil.nearest import did_you_mean, nearest
from hil.toml import assignments_of


def test_the_likest_come_first_and_none_that_are_like_nothing():
    assert nearest("cascde", ["observer", "cascade"]) == ["cascade"]
    assert did_you_mean("cascde", ["observer", "cascade"]) == "; did you mean cascade?"
    assert did_you_mean("xyz", ["observer", "cascade"]) == ""
    assert did_you_mean(1.5, ["observer", "cascade"]) == ""


def test_case_and_underscores_are_no_difference():
    assert nearest("Load_Decrease", ["load-decrease"]) == ["load-decrease"]


def test_a_key_without_its_tables_is_found_by_its_last_name():
    known = ["controller.tdc_ref_m", "plant.engine.tdc_ref_m", "controller.start.force_n"]
    assert set(nearest("tdc_ref_m", known)) == set(known[:2])
    assert set(nearest("tdx_ref_m", known)) == set(known[:2])
    assert nearest("plant.tdc_ref_m", known)[0] == "plant.engine.tdc_ref_m"


def _read(*assignments):
    return resolve(scenarios.read("load-decrease", assignments_of(assignments)))


@pytest.mark.parametrize(
    ("wrong", "meant"),
    [
        (lambda: scenarios.read("lod-decrease"), "load-decrease"),
        (lambda: campaigns.read("robustnes"), "robustness"),
        (lambda: check_name("cascde", "--controllers"), "cascade"),
        (lambda: keys_of("predictiv"), "predictive"),
        (lambda: detailed.read("nu-two-strok"), "nu-two-stroke"),
        (lambda: source_of("plant.sensor.xm"), "plant.sensor.x_m"),
        (lambda: parameters.find("tdx_ref_m"), "controller.tdc_ref_m"),
        (lambda: parameters.parameter_of("controller.cascade.outer.kpp"),
         "controller.cascade.outer.kp"),
        (lambda: signals.find("fuel_kgg"), "fuel_kg"),
        (lambda: _read("plant.model=harmnic"), "harmonic"),
        (lambda: _read("controller.name=cascde"), "cascade"),
        (lambda: _read("tdc_ref_m=0.015"), "controller.tdc_ref_m"),
        (lambda: _read("controler.tdc_ref_m=0.015"), "controller"),
        (lambda: _read("controller.tdc_re_m=0.015"), "tdc_ref_m"),
        (lambda: _read("events.lod.value=0.9"), "load"),
        (lambda: _read("events.load.valu=0.9"), "value"),
        (lambda: _read("events.load.kind=lod-scale"), "load-scale"),
        (lambda: _read("events.load.kind=rampp"), "ramp"),
        (lambda: _read("expect.tdc.event=mifire"), "misfire"),
        (lambda: _read("expect.tdc.withn_mm=1"), "within_mm"),
    ],
)  # fmt: skip
def test_every_refusal_of_a_name_says_what_may_have_been_meant(wrong, meant):
    with pytest.raises(ConfigError, match=r"; did you mean [^;]*\?$") as refusal:
        wrong()
    hint = str(refusal.value).rpartition("did you mean ")[2]
    assert meant in hint


def test_a_command_that_goes_well_does_not_load_the_search():
    code = "import sys, bench.run.resolve, hil.nearest; print('difflib' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
