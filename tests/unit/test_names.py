"""The tree of names: every leaf of the configuration, every field of a topic, and nothing else."""

import json
import math

import pytest

from bench.cli import app
from hil.config.scenario import Scenario
from hil.errors import ConfigError
from hil.log import topics
from hil.names import parameters, signals
from hil.names.parameters import parameter_of


def dotted(tree, prefix=""):
    """Keys of a dumped configuration."""
    for name, value in tree.items():
        if isinstance(value, dict) and value:
            yield from dotted(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}"


def test_every_leaf_of_the_configuration_is_a_parameter():
    assert set(dotted(Scenario().model_dump())) - set(parameters.parameters()) == {
        "link.zenoh.tls", "controller.tuning", "controller.stroke_map.sensitivities",
        "controller.supervisory.map", "inputs.x_m", "inputs.v_m_s", "inputs.electric_power_w",
        "inputs.p_left_pa", "inputs.p_right_pa", "inputs.encoder", "outputs.analog.force_n",
        "outputs.analog.load_coefficient_n_s_m", "outputs.analog.throttle",
    }  # fmt: skip  # tables that are not there by default


def test_a_parameter_says_what_its_declaration_says():
    kp = parameter_of("controller.cascade.outer.kp")
    assert (kp.kind, kp.unit, kp.low, kp.high, kp.default) == ("number", "1/s", -1e3, 1e3, 39.0)
    assert kp.live
    assert kp.side == "controller"
    scale = parameter_of("plant.injector.flow_scale_left")
    assert (scale.unit, scale.accepted, scale.live) == ("1", "above 0 to 10", True)
    assert parameter_of("plant.model").choices[:2] == ("closed-form", "harmonic")
    assert not parameter_of("plant.model").live
    assert parameter_of("controller.timing.spark_position_m").optional


def test_every_number_has_a_unit_and_a_default_in_its_range():
    for parameter in parameters.parameters().values():
        if parameter.kind in ("number", "whole number"):
            assert parameter.unit
            if parameter.default is not None:
                assert parameter.checked(parameter.default) == parameter.default


def test_what_is_live_has_a_range_or_choices():
    for parameter in parameters.parameters().values():
        if parameter.live:
            assert parameter.side in ("plant", "controller")
            assert parameter.kind == "boolean" or parameter.accepted, parameter.key


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("controller.cascade.outer.kp", 1e4),
        ("controller.cascade.outer.kp", "40"),
        ("controller.cascade.outer.kp", True),
        ("controller.cascade.outer.kp", math.nan),
        ("controller.cascade.outer.kp", None),
        ("controller.limits.misfires", 2.5),
        ("controller.start.constant_force", 1),
        ("controller.pdf.load_from", "thin air"),
        ("plant.injector.flow_scale_left", 0.0),
    ],
)
def test_what_is_not_accepted_is_one_line_with_what_is(key, value):
    with pytest.raises(ConfigError, match=key) as refused:
        parameter_of(key).checked(value)
    assert "accepted: " in str(refused.value)
    assert "\n" not in str(refused.value)


def test_an_open_parameter_is_given_as_none():
    assert parameter_of("controller.supervisory.target_power_w").checked("none") is None


def test_a_name_that_is_none_tells_those_that_are_like_it():
    with pytest.raises(ConfigError, match=r"controller\.cascade\.outer\.kp"):
        parameter_of("controller.kp")


def test_patterns_match_whole_names_and_parts_are_found():
    assert [p.key for p in parameters.find("*cade.out?r.kp")] == ["controller.cascade.outer.kp"]
    assert len(parameters.find("sensors.noise")) == 2
    assert len(parameters.find()) == len(parameters.parameters())
    with pytest.raises(ConfigError, match="is no parameter"):
        parameters.find("nothing-like-it")


def test_every_field_of_a_topic_is_a_signal_of_each_process_that_puts_it():
    names = signals.signals()
    assert names["plant.truth.x_m"].unit == "m"
    assert "controller.truth.x_m" not in names
    assert names["controller.stroke.tdc_m"].rate == "stroke"
    assert names["controller.frames.sent.data"].is_number is False
    assert names["plant.actuator.pulse_open_t_ns.3"].item == 3
    told = {(s.topic, s.field) for s in names.values()}
    assert told == {(t.name, f.name) for t in topics.EVERY for f in t.layout.fields}


@pytest.mark.parametrize("command", ["parameters", "signals"])
def test_both_are_listed_as_json(command, capsys):
    app([command, "x_m", "--json"], standalone_mode=False)
    rows = json.loads(capsys.readouterr().out)
    assert rows
    assert all(
        row["unit"] in ("m", "ns") or "x_m" in row.get("name", row.get("key")) for row in rows
    )
