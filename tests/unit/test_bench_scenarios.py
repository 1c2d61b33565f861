from pathlib import Path

import pytest

from bench.run import directory as outdir
from bench.run.commands import overrides
from bench.run.offline import simulate
from bench.run.resolve import resolve
from bench.run.scenarios import find, packaged, read
from hil.config.prototypes import BIT
from hil.errors import ConfigError

PUBLIC = {
    "steady", "load-decrease", "load-increase", "variations", "misfire", "misfire-unloaded",
    "start", "start-restart",
}  # fmt: skip


def test_the_public_scenarios_are_there_under_their_own_names():
    names = {path.stem for path in packaged()}
    assert names >= PUBLIC
    assert all(read(name).name == name for name in names)


@pytest.mark.parametrize("path", packaged(), ids=lambda path: path.stem)
def test_a_scenario_says_what_it_shows_and_resolves(path):
    scenario = read(path.stem)
    resolved = resolve(scenario, Path("/tmp/x"))
    assert scenario.description
    assert scenario.expect
    assert resolved.controller.tdc_ref_m == 0.0155
    assert resolved.link.zenoh.plant_endpoint == "unixsock-stream//tmp/x/plant.sock"
    assert resolve(resolved) == resolved


def test_only_starts_begin_at_rest():
    for path in packaged():
        scenario = read(path.stem)
        assert (scenario.begins == "at-rest") == path.stem.startswith("start")
        assert scenario.controller.running == (scenario.begins == "settled")


def test_an_unknown_scenario_names_the_known_ones():
    with pytest.raises(ConfigError, match=r"accepted is a path.*load-decrease"):
        find("load-decrese")


def test_a_missing_file_is_named():
    with pytest.raises(ConfigError, match=r"nowhere\.toml: no such"):
        find("nowhere.toml")


def test_a_scenario_may_be_a_path(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('name = "mine"\n')
    assert read(str(path)).name == "mine"


@pytest.mark.parametrize(
    ("model", "fuel_mg"),
    [("harmonic", 2.8185), ("closed-form", 2.8185), ("rectangular", 2.474), ("nonlinear", 1.950)],
)
def test_the_preset_is_the_settled_motion_of_the_chosen_model(model, fuel_mg):
    """Fuel for 15.5 mm by thesis eqs. 5.60, 5.52 and 5.21."""
    preset = resolve(read("steady", [("plant.model", model)])).controller.preset
    assert preset.fuel_kg * 1e6 == pytest.approx(fuel_mg, abs=5e-4)


def test_open_loop_runs_on_its_own_fuel():
    changes = [("controller.name", "open-loop"), ("controller.open_loop.fuel_kg", 2.5e-6)]
    assert resolve(read("steady", changes)).controller.preset.fuel_kg == 2.5e-6


@pytest.mark.parametrize("model", ["harmonic", "closed-form", "rectangular"])
def test_open_loop_fuel_is_the_same_in_the_linear_models(model):
    changes = [("controller.name", "open-loop"), ("plant.model", model)]
    assert resolve(read("steady", changes)).controller.open_loop.fuel_kg == 2.8185e-6


def test_a_settled_run_that_would_strike_the_head_is_refused():
    changes = [("controller.preset.fuel_kg", 5.0e-6)]
    with pytest.raises(ConfigError, match=r"cannot begin settled.*the head is at 20 mm"):
        resolve(read("steady", changes))


def test_configured_endpoints_are_kept():
    changes = [("link.zenoh.plant_endpoint", "tcp/127.0.0.1:7555")]
    zenoh = resolve(read("steady", changes), Path("/tmp/x")).link.zenoh
    assert zenoh.plant_endpoint == "tcp/127.0.0.1:7555"
    assert zenoh.controller_endpoint == "unixsock-stream//tmp/x/controller.sock"


def test_flags_come_before_set_and_absent_ones_change_nothing():
    flags = {"plant.model": "nonlinear", "run.seed": None}
    assert overrides(flags, ["run.seed=3"]) == [("plant.model", "nonlinear"), ("run.seed", 3)]


def test_an_earlier_run_is_not_lost_without_force(tmp_path):
    (tmp_path / "plant.mcap").write_bytes(b"precious")
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ConfigError, match="holds an earlier run"):
        outdir.prepare("steady", tmp_path, force=False)
    outdir.prepare("steady", tmp_path, force=True)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_a_directory_with_other_files_may_be_used(tmp_path):
    (tmp_path / "mine.toml").write_text("")
    assert outdir.prepare("steady", tmp_path, force=False).directory == tmp_path


def test_a_directory_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="--out"):
        outdir.prepare("steady", tmp_path / "file" / "out", force=False)


def test_two_runs_in_a_second_get_two_directories(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(outdir.time, "strftime", lambda _: "20240101-000000")
    first = outdir.prepare("steady", None, force=False)
    assert outdir.prepare("steady", None, force=False).directory != first.directory


def test_the_beijing_engine_wide_open_gets_the_fuel_of_eq_5_28():
    changes = [("plant.prototype", "bit"), ("controller.name", "open-loop")]
    wide_open = resolve(read("steady", changes))
    assert wide_open.controller.open_loop.fuel_kg == BIT.full_throttle_fuel_kg
    assert wide_open.controller.limits.fuel_max_kg == BIT.fuel_max_kg
    assert {round(dc.fuel_kg * 1e6, 3) for dc in simulate(wide_open).dead_centres} == {6.023}


def test_the_fuel_limit_is_the_engines_unless_it_is_given():
    given = resolve(read("steady", [("controller.limits.fuel_max_kg", 5e-6)]))
    assert given.controller.limits.fuel_max_kg == 5e-6
