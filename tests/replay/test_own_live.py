"""Settings of one's own law and engine change while they run, and the change is replayed."""

import pytest
from runs import LOCKSTEP

import hil.log
from bench.dev import golden
from bench.dev.golden_cases import Order
from bench.logs.replay.replay import OwnFiles, replay_file
from bench.own.beginning import write
from bench.run import scenarios
from bench.run.resolve import resolve
from hil.errors import ConfigError, RunError
from hil.log.part import ALWAYS
from hil.names import parameters
from hil.wire import changes

KP = "controller.own.settings.kp"
FRICTION = "plant.own.settings.friction_n_s_m"


RAMP = f"""
name = "ramp"
include = "load-decrease"

[events.friction]
kind = "ramp"
parameter = "{FRICTION}"
value = 80.0
over_s = 0.3
at_s = 0.2
"""


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return write("law", "my-law", force=False), write("engine", "my-engine", force=False)


def recorded(files, out, *orders, name="load-decrease"):
    law, engine = files
    given = [("controller.name", str(law)), ("plant.model", str(engine)), *LOCKSTEP,
             ("events.load.at_s", 0.2), ("run.duration_s", 0.8)]  # fmt: skip
    out.mkdir()
    golden.record(resolve(scenarios.read(name, given)), out, orders)
    return out


def events(path):
    with hil.log.open(path) as log:
        return [event.text for event in log.records("/event")]


def replayed(out, files):
    own = OwnFiles(*files)
    return all(
        replay_file(out / f"{side}.mcap", None, ALWAYS, own).identical
        for side in ("plant", "controller")
    )


def test_a_change_of_both_acts_and_is_replayed_bit_by_bit(files, tmp_path):
    still = recorded(files, tmp_path / "still")
    out = recorded(
        files, tmp_path / "out",
        Order(0.3, changes.encode(changes.SET, {KP: 3.0e-4})),
        Order(0.4, changes.encode(changes.SET, {FRICTION: 60.0})),
    )  # fmt: skip
    assert any(f"{KP} = 0.0003 (was 0.00018)" in text for text in events(out / "controller.mcap"))
    assert any(f"{FRICTION} = 60.0 (was 0.0)" in text for text in events(out / "plant.mcap"))
    assert replayed(out, files)
    with hil.log.open(still / "plant.mcap") as before, hil.log.open(out / "plant.mcap") as after:
        last = [list(log.records("/truth"))[-1].dc_x_m for log in (before, after)]
    assert abs(last[0] - last[1]) > 1e-6


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [(KP, -1.0, "kp = -1.0: Input should be greater"), (f"{KP}x", 1.0, "kpx: unknown; ")],
)
def test_what_it_does_not_accept_is_refused_and_told(files, tmp_path, key, value, told):
    out = recorded(files, tmp_path / "out", Order(0.3, changes.encode(changes.SET, {key: value})))
    assert any(told in text for text in events(out / "controller.mcap"))
    assert replayed(out, files)


def test_a_scenario_ramps_a_setting(files, tmp_path):
    (tmp_path / "ramp.toml").write_text(RAMP)
    out = recorded(files, tmp_path / "out", name="ramp.toml")
    assert replayed(out, files)
    with hil.log.open(out / "plant.mcap") as log:
        assert list(log.records("/stimulus"))[-1].value[0] == 80.0


TELLS = """
class Tells:
    signals = {"error_m": "dead centre beyond its set point", "asked_kg": "fuel asked for"}

    def initial(self):
        return 0.0, 0.0

    def step(self, state, view):
        error_m = view.motion.tdc_m - view.tdc_ref_m
        fuel_kg = view.point.fuel_kg - 1.8e-4 * error_m
        return (error_m, fuel_kg), fuel_kg

    def tell(self, state):
        return {"error_m": state[0], "asked_kg": BODY}
"""


def test_what_a_law_tells_of_itself_stands_in_its_log_by_name_and_unit(files, tmp_path):
    law = tmp_path / "tells.py"
    law.write_text(TELLS.replace("BODY", "state[1]"))
    out = recorded((law, files[1]), tmp_path / "out")
    with hil.log.open(out / "controller.mcap") as log:
        told, demands = list(log.records("/law")), list(log.records("/demand"))
        fields = {field.name: field.unit for field in log.topics["/law"].fields}
    assert fields["error_m"] == "m"
    assert fields["asked_kg"] == "kg"
    assert [row.tick for row in told] == [row.tick for row in demands]
    assert [row.asked_kg for row in told] == [row.fuel_kg for row in demands]
    assert max(abs(row.error_m) for row in told) > 1e-5
    assert replayed(out, (law, files[1]))


@pytest.mark.parametrize("body", ["None", "{}"])
def test_a_law_that_tells_no_number_ends_the_run_with_its_line(files, tmp_path, body):
    law = tmp_path / "tells.py"
    law.write_text(TELLS.replace("BODY", body))
    with pytest.raises(
        RunError, match=r"tells\.py: tell gave .* accepted: a number for each of err"
    ):
        recorded((law, files[1]), tmp_path / "out")


@pytest.mark.parametrize(
    ("signals", "told"),
    [("{'Error': ''}", "'Error': accepted is a name like error_m"), ("7", "accepted is a table")],
)
def test_signals_that_are_none_are_refused(files, tmp_path, signals, told):
    law = tmp_path / "tells.py"
    law.write_text(f"class Tells:\n    signals = {signals}\n    def step(self, s, v): ...\n")
    with pytest.raises(ConfigError, match=told):
        recorded((law, files[1]), tmp_path / "out")


def test_a_panel_is_offered_the_settings(files):
    law, engine = files
    found = resolve(
        scenarios.read("steady", [("controller.name", str(law)), ("plant.model", str(engine))])
    )
    assert {p.key: p.kind for p in parameters.settings(found)} == {
        FRICTION: "number", KP: "number", KP.replace("kp", "ki"): "number",
    }  # fmt: skip
