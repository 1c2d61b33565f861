"""Configuration: every mistake is one line that names file, key, what was given and accepted."""

import json
import subprocess
import sys

import pytest

from bench.run.resolve import resolve
from drivers.system.process import read_arguments
from hil.config.load import build, load, read_scenario, with_override
from hil.config.resolved import Resolved, read_resolved
from hil.config.scenario import Scenario
from hil.errors import ConfigError
from hil.toml import parse_assignment, read_toml

SCENARIO = """
name = "example"
[run]
duration_s = 2.5
[events.load]
kind = "load-scale"
value = 0.85
at_s = 1.1
[expect.tdc]
event = "load"
within_mm = 0.1
"""


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "example.toml"
    path.write_text(SCENARIO)
    return path


def line_of(call, *args):
    with pytest.raises(ConfigError) as caught:
        call(*args)
    line = str(caught.value)
    assert "\n" not in line
    assert len(line) < 500
    assert caught.value.exit_code == 2
    return line


def refused(path, text):
    path.write_text(text)
    line = line_of(load, path)
    assert line.startswith(f"{path}: ")
    return line.removeprefix(f"{path}: ")


def overridden(path, *assignments):
    return load(path, [parse_assignment(text) for text in assignments])


def refused_override(path, assignment):
    return line_of(overridden, path, assignment).removeprefix(f"{path} with --set: ")


def test_defaults_are_those_that_the_documentation_promises():
    s = Scenario()
    assert (s.link.kind, s.loop.clock, s.loop.rate_hz) == ("zenoh", "realtime", 1000)
    assert (s.plant.model, s.plant.prototype, s.controller.name) == ("harmonic", "nu", "cascade")
    assert s.plant.sensors.noise_x_m == s.plant.sensors.noise_v_m_s == 0.0
    assert s.link.zenoh.plant_endpoint == ""
    assert not s.link.zenoh.allow_insecure


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("foo = 1", "foo: unknown key; accepted here: name, description, begins, run, loop"),
        ("[run]\nduration = 3", "run.duration: unknown key; accepted here: duration_s, seed"),
        ("[run]\nduration_s = 'long'", "run.duration_s: Input should be a valid number"),
        ("[run]\nduration_s = 'long'", "(given: 'long'); accepted: 0.0 to 86400.0"),
        ("[run]\nduration_s = 0", "greater than 0 (given: 0)"),
        ("[run]\nduration_s = nan", "run.duration_s: Input should be a finite number (given: nan)"),
        ("run = 3", "run: Input should be a valid dictionary"),
        ("[loop]\nrate_hz = 10", "loop.rate_hz: Input should be greater than or equal to 100"),
        ("[loop]\nrate_hz = 1.5", "loop.rate_hz: Input should be a valid integer"),
        ("[loop]\nclock = 'fast'", "loop.clock: Input should be 'lockstep' or 'realtime'"),
        (
            "[plant]\nmodel = 'big'",
            "plant.model: Input should be 'closed-form', 'harmonic', 'rectangular'",
        ),
        ("[plant.sensors]\nnoise_x_m = nan", "plant.sensors.noise_x_m: "),
        ("[plant.engine]\nbore_m = 5.0", "(given: 5.0); accepted: 0.001 to 1.0"),
        (
            "[plant.injector]\nflow = 5.0",
            "plant.injector.flow: unknown key; accepted here: kind, static",
        ),
        ("[controller]\ntdc_ref_m = 0.06", "(given: 0.06); accepted: 0.001 to 0.05"),
        ("[controller.cascade.outer]\nkp = 1\nki = 1\nkx = 1", "outer.kx: unknown key; accepted"),
        ("[link.zenoh.tls]\nx = 1", "link.zenoh.tls.root_ca_certificate: Field required (and 3"),
        ("name = 'A name'", "name: String should match pattern"),
        ("[expect.a]\nevent = 'nix'", "expect.a.event: 'nix' is no event; known: none"),
        ("events = 3", "events: Input should be a valid dictionary (given: 3)"),
        ("events.a = 3", "events.a: must be a table with a kind: start, "),
        ("[events.a]\nat_s = 1", "events.a.kind must be one of start, stop, set-point, law, "),
        (
            "[events.a]\nkind = 'bang'",
            "events.a.kind must be one of start, stop, set-point, law, em",
        ),
        ("[events.a]\nkind = 'start'", "events.a.at_s is missing; accepted: 0 to 1e+06"),
        ("[events.a]\nkind = 'stop'\nat_s = 1\nx = 2", "events.a.x: unknown key; accepted here: k"),
        ("[events.a]\nkind = 'load-scale'\nvalue = 20", "events.a.value = 20; accepted: 0 to 10"),
        ("[events.a]\nkind = 'load-scale'\nvalue = '2'", "events.a.value = '2'; accepted: 0 to"),
        (
            "[events.a]\nkind = 'misfire'\ncause = 'x'",
            "events.a.cause = 'x'; accepted: spark, fuel",
        ),
        (
            "[events.a]\nkind = 'load-scale'\nvalue = 1\nat_s = 2\nuntil_s = 1",
            "events.a: until_s must be greater than at_s = 2",
        ),
        (
            "[events.a]\nkind = 'efficiency'\nlow = 0.9\nhigh = 0.8",
            "events.a: low must not exceed high = 0.8",
        ),
        (
            "[events.a]\nkind = 'set-point'\nat_s = 1",
            "events.a: a set-point needs tdc_ref_m or target_power_w",
        ),
        (
            "[events.a]\nkind = 'start'\nat_s = 1\ntdc_ref_m = 0.01",
            "events.a.tdc_ref_m: unknown key; accepted here: kind, at_s",
        ),
    ],
)
def test_mistake_in_a_file_is_one_line_with_file_key_and_what_is_accepted(path, text, line):
    assert line in refused(path, text)


def test_text_that_is_no_toml_is_told_with_line_and_column(path):
    assert "not a TOML file: " in refused(path, "[run\n")
    assert "line 1" in refused(path, "[run\n")
    path.write_bytes(b"\xff\xfe")
    assert "not a TOML file" in line_of(load, path)


@pytest.mark.parametrize("name", ["none.toml", "none.json"])
def test_missing_file_is_named(tmp_path, name):
    assert line_of(read_scenario, tmp_path / name).endswith(f"{name}: No such file or directory")


def test_directory_in_place_of_a_file_is_named(tmp_path):
    assert line_of(read_toml, tmp_path) == f"{tmp_path}: Is a directory"


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("run.duration_s=3", 3),
        ("run.duration_s = 3.5 ", 3.5),
        ("plant.model=rectangular", "rectangular"),
        ("plant.model='rectangular'", "rectangular"),
        ("realtime.lock_memory=true", True),
        ("link.bus=socketcan:can0", "socketcan:can0"),
        ("description=a = b", "a = b"),
        ("description=", ""),
    ],
)
def test_assignment_is_read_as_toml_with_or_without_quotes(text, value):
    key = text.partition("=")[0].strip()
    assert parse_assignment(text) == (key, value)


@pytest.mark.parametrize("text", ["", "=3", "run.duration_s", "a..b=3", ".a=3", "a.=3"])
def test_assignment_without_key_or_equals_sign_is_refused(text):
    line = line_of(parse_assignment, text)
    assert line == f"--set {text!r}: accepted is key=value, as in run.duration_s=2.5"


def test_overrides_apply_in_their_order(path):
    scenario = overridden(path, "run.duration_s=1", "run.duration_s=3", "events.load.value=1.15")
    assert scenario.run.duration_s == 3.0
    assert scenario.events["load"].number("value") == 1.15


def test_override_makes_the_tables_that_are_missing_and_leaves_the_original_alone():
    tree = {"run": {"seed": 1}}
    changed = with_override(tree, "controller.cascade.outer.kp", 2.0)
    assert changed == {"run": {"seed": 1}, "controller": {"cascade": {"outer": {"kp": 2.0}}}}
    assert with_override(tree, "run.seed", 2) == {"run": {"seed": 2}}
    assert tree == {"run": {"seed": 1}}


@pytest.mark.parametrize(
    ("assignment", "line"),
    [
        ("run.duration_s=x", "run.duration_s: Input should be a valid number"),
        ("run.duration=1", "run.duration: unknown key; accepted here: duration_s, seed"),
        ("nix=1", "nix: unknown key; accepted here: name, "),
        ("run=3", "run: Input should be a valid dictionary or instance of RunConfig (given: 3)"),
        ("events.load.value=20", "events.load.value = 20; accepted: 0 to 10"),
        ("events.load.valeu=1", "events.load.valeu: unknown key; accepted here: kind, at_s, value"),
        ("events.load.kind=bang", "events.load.kind must be one of start, stop, "),
        ("events.load=3", "events.load: must be a table with a kind"),
        ("expect.tdc.event=nix", "expect.tdc.event: 'nix' is no event; known: load"),
        ("expect.tdc.mode=nix", "expect.tdc.mode: Input should be 'off', 'motoring', "),
    ],
)
def test_override_that_does_not_fit_is_one_line_with_file_and_key(path, assignment, line):
    said = line_of(overridden, path, assignment)
    assert said.startswith(f"{path} with --set: ")
    assert line in said


@pytest.mark.parametrize(
    ("assignment", "line"),
    [
        ("events.laod.value=1", "--set events.laod.value: this scenario has no events.laod;"),
        ("events.laod.value=1", "it has: load"),
        ("expect.x.mode=off", "--set expect.x.mode: this scenario has no expect.x; it has: tdc"),
        ("events=3", "--set events: accepted is events.NAME.KEY=value"),
        ("run.duration_s.x=1", "--set run.duration_s.x: run.duration_s is a value (2.5), not a"),
        (
            "events.load.value.x=1",
            "--set events.load.value.x: events.load.value is a value (0.85), not a table",
        ),
    ],
)
def test_override_of_nothing_that_is_there_is_refused_with_its_whole_key(path, assignment, line):
    assert line in refused_override(path, assignment)


def test_override_of_events_that_are_no_table_is_refused(path):
    path.write_text("events = 3")
    assert "this scenario has no events.a; it has: none" in refused_override(path, "events.a.x=1")


@pytest.fixture
def written(tmp_path, path):
    """What a run leaves behind."""
    written = tmp_path / "scenario.json"
    written.write_text(resolve(load(path)).model_dump_json())
    return written


def test_resolved_scenario_survives_json(path, written):
    assert read_resolved(written) == resolve(load(path))
    assert read_scenario(written).model_dump() == resolve(load(path)).model_dump()


@pytest.mark.parametrize("key", [
    "plant.load_coefficient_n_s_m", "controller.tdc_ref_m", "controller.open_loop.fuel_kg",
    "controller.supervisory.load_coefficient_n_s_m", "controller.limits.tdc_m",
    "controller.preset.fuel_kg", "controller.preset.v_mid_m_s", "controller.preset.stroke_s",
])  # fmt: skip
def test_what_leaves_a_figure_open_starts_no_process(written, key):
    tree = with_override(json.loads(written.read_text()), key, None)
    written.write_text(json.dumps(tree))
    said = line_of(read_arguments, "plant", ["--config", str(written)])
    assert said.startswith(f"{written}: {key}: Input should be a valid number (given: None)")
    assert "accepted: the scenario.json of a run" in said
    assert isinstance(resolve(read_scenario(written)), Resolved)


def test_scenario_as_a_user_writes_it_starts_no_process(path):
    said = line_of(read_arguments, "controller", ["--config", str(path)])
    assert said.startswith(f"{path}: plant: Field required")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("{", "Invalid JSON"),
        ("x" * 5000, "Invalid JSON"),
        ("[1]", "Input should be an object"),
        (json.dumps({"run": {"duration_s": -1}}), "run.duration_s: Input should be greater than 0"),
        (json.dumps({"nix": 1}), "nix: unknown key"),
    ],
)
def test_mistake_in_a_json_scenario_is_one_line_too(tmp_path, text, line):
    path = tmp_path / "scenario.json"
    path.write_text(text)
    said = line_of(read_scenario, path)
    assert said.startswith(f"{path}: ")
    assert line in said


def test_configuration_cannot_be_changed_afterwards():
    with pytest.raises(ValueError, match="frozen"):
        Scenario().run.seed = 2


def test_tree_of_another_origin_is_named_by_it():
    assert line_of(build, {"nix": 1}, "here").startswith("here: nix: unknown key")


def test_process_reads_its_scenario_and_log(written):
    given = read_arguments("plant", ["--config", str(written), "--log", "plant.mcap"])
    assert given.scenario.name == "example"
    assert given.log.name == "plant.mcap"
    assert read_arguments("plant", ["--config", str(written)]).log is None


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[run]\nduration_s = true", "run.duration_s: accepted is a number (given: True)"),
        ('[run]\nduration_s = "2.5"', "run.duration_s: accepted is a number (given: '2.5')"),
        ('[loop]\nrate_hz = "1000"', "loop.rate_hz: accepted is a number (given: '1000')"),
        ("[run]\nseed = true", "run.seed: accepted is a number (given: True)"),
        ("[realtime]\nlock_memory = 1", "accepted is true or false (given: 1)"),
        ('[realtime]\nlock_memory = "yes"', "accepted is true or false (given: 'yes')"),
        (f"[run]\nduration_s = {'9' * 5000}", "not a TOML file: a number of more digits"),
        (f"[run]\nduration_s = {'9' * 400}", "run.duration_s: Input should be a valid number"),
        (f"[run]\nseed = {'9' * 4000}", "run.seed: "),
        (f"a = {'[' * 5000}{']' * 5000}", "not a TOML file: values nested too deep"),
        ("a = {}{}{}".format("{b=" * 3000, 1, "}" * 3000), "not a TOML file: values nested too"),
        ("name = 'x\x00'", "not a TOML file"),
    ],
)
def test_a_value_of_another_type_is_refused_in_one_line(tmp_path, text, told):
    path = tmp_path / "scenario.toml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load(path)
    line = str(caught.value)
    assert told in line
    assert line.startswith(f"{path}: ")
    assert "\n" not in line
    assert len(line) < 500


def test_numbers_are_taken_as_they_may_be_written(tmp_path):
    path = tmp_path / "scenario.toml"
    path.write_text("[run]\nduration_s = 2\n[loop]\nrate_hz = 1e3\n")
    scenario = load(path)
    assert (scenario.run.duration_s, scenario.loop.rate_hz) == (2.0, 1000)


def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path):
    path = tmp_path / "scenario.toml"
    path.write_bytes(b"\xef\xbb\xbf" + SCENARIO.encode())
    assert load(path).name == "example"


def test_what_a_process_is_given_as_json_has_its_types_too(tmp_path):
    path = tmp_path / "scenario.json"
    tree = json.loads(resolve(build({"name": "x"}, "test")).model_dump_json())
    path.write_text(json.dumps(tree))
    assert read_resolved(path).name == "x"
    tree["loop"]["rate_hz"] = "1000"
    path.write_text(json.dumps(tree))
    with pytest.raises(ConfigError, match=r"loop\.rate_hz: accepted is a number"):
        read_resolved(path)


def test_an_override_with_too_many_digits_is_refused():
    with pytest.raises(ConfigError, match=r"--set run\.seed='999.*more digits"):
        parse_assignment(f"run.seed={'9' * 5000}")


@pytest.mark.parametrize("module", ["plant.main", "controller.main"])
def test_an_engine_that_cannot_be_read_is_one_line_of_a_process(module, tmp_path):
    """The figures are read while the modules are imported, before any command has begun."""
    code = (
        "import sys, pathlib, hil.toml as base, hil.errors as errors\n"
        "def broken(path): raise errors.ConfigError(f'{path}: not a TOML file')\n"
        "base.read_toml = broken\n"
        f"import {module}\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert done.stderr.endswith("engine.toml: not a TOML file\n")
