"""The engines' files: the only source of their figures, each stated once, mistakes in one line."""

import shutil
import tomllib

import pytest

from bench.run.resolve import resolve
from bench.run.scenarios import read as read_scenario
from hil.config.detailed import calibrations, read_file
from hil.config.prototypes import ENGINES, PROTOTYPES, model_files, read
from hil.errors import ConfigError


@pytest.fixture
def nu(tmp_path):
    return shutil.copytree(ENGINES / "nu", tmp_path / "nu")


def with_line(path, key, line):
    """Replace the first line of a key; add it at the top when there is none."""
    lines = path.read_text().splitlines()
    at = next((n for n, text in enumerate(lines) if text.startswith(f"{key} =")), None)
    lines[0 if at is None else at : 0 if at is None else at + 1] = [line]
    path.write_text("\n".join(lines))


def line_of(call, *args):
    with pytest.raises(ConfigError) as caught:
        call(*args)
    assert caught.value.exit_code == 2
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("key", "line", "said"),
    [
        ("bore_m", "bore_m = 5.0", "bore_m: Input should be less than or equal to 1"),
        ("bore_m", "bore_m = 5.0", "(given: 5.0); accepted: 0.001 to 1.0"),
        ("bore_m", "bore_m = nan", "bore_m: Input should be a finite number"),
        ("bore_m", "", "bore_m: Field required"),
        ("colour", "colour = 1", "colour: unknown key; accepted here: moving_mass_kg, bore_m"),
        ("chambers", "chambers = 3", "(given: 3); accepted: 1 to 2"),
    ],
)
def test_mistake_in_an_engine_names_file_key_and_what_is_accepted(nu, key, line, said):
    path = nu / "engine.toml"
    with_line(path, key, line)
    told = line_of(read, nu)
    assert told.startswith(f"{path}: ")
    assert said in told


@pytest.mark.parametrize(
    ("key", "line", "said"),
    [
        ("gamma", "gamma = 2.0", "gas.gamma: Input should be less than or equal to 1.67"),
        ("gamma", "gamma = 2.0", "(given: 2.0); accepted: 1.01 to 1.67"),
        ("gamma", "gama = 1.3", "gas.gama: unknown key; accepted here: gamma, "),
        ("kind", 'kind = "speed"', "cycle: kind = 'speed' needs acceleration_m_s2, servo_s, "),
    ],
)
def test_mistake_in_a_calibration_names_file_key_and_what_is_accepted(nu, key, line, said):
    path = nu / "two-stroke.toml"
    with_line(path, key, line)
    told = line_of(read_file, path, PROTOTYPES["nu"])
    assert told.startswith(f"{path}: ")
    assert said in told


def test_engine_is_found_by_its_directory(nu):
    assert read(nu) == PROTOTYPES["nu"]
    found = read(nu.rename(nu.with_name("other")))
    assert found.model_dump(exclude={"name"}) == PROTOTYPES["nu"].model_dump(exclude={"name"})


def test_calibration_takes_from_its_engine_what_it_does_not_state():
    for (model, name), c in calibrations().items():
        tree = tomllib.loads(model_files(name)[model].read_text())
        engine = PROTOTYPES[name]
        assert c.mover.mass_kg == engine.moving_mass_kg
        assert (c.left.bore_m, c.left.length_m) == (engine.bore_m, engine.half_stroke_m)
        load = tree["machine"].get("load_coefficient_n_s_m", engine.load_coefficient_n_s_m)
        assert c.machine.load_coefficient_n_s_m == load


def test_run_has_the_figures_of_its_engine_unless_they_are_given(monkeypatch):
    """Also an engine that is not the default one is believed by its controller as it is built."""
    other = {"injector_kg_s": 2e-3, "injector_dead_s": 1e-3, "fuel_max_kg": 7e-6}
    changed = PROTOTYPES["bit"].model_copy(update=other | {"start_force_n": 90.0})
    monkeypatch.setitem(PROTOTYPES, "bit", changed)
    given = [("plant.prototype", "bit"), ("controller.injector.dead_time_s", 0.9e-3)]
    resolved = resolve(read_scenario("steady", given))
    assert resolved.plant.injector.static_flow_kg_s == 2e-3
    assert resolved.plant.injector.dead_time_s == 1e-3
    assert resolved.controller.injector.static_flow_kg_s == 2e-3
    assert resolved.controller.injector.dead_time_s == 0.9e-3
    assert resolved.controller.limits.fuel_max_kg == 7e-6
    assert resolved.controller.start.force_n == 90.0
