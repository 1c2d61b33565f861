"""What a user brings: a law, an engine, and files to begin from."""

import math

import pytest

import hil.log
from bench.logs.replay.replay import OwnFiles, replay_file
from bench.own.beginning import KINDS, write
from bench.own.conformance import law_findings
from bench.run import commands
from bench.run.offline import simulate
from bench.run.resolve import resolve
from bench.run.scenarios import read, read_cases
from bench.studies import tune
from bench.studies.trial import Trial
from hil.config.plant import PlantConfig
from hil.errors import ConfigError, LogError, RunError
from hil.log.part import ALWAYS

LAW = """
class Mine:
    def initial(self):
        return 0.0

    def step(self, state, view):
        {body}
"""
STEADY = "return state + 1.0, view.point.fuel_kg"


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def law(here, body=STEADY, name="mine.py"):
    path = here / name
    path.write_text(LAW.format(body=body))
    return path


def scenario(path, *changes, name="load-decrease"):
    given = [("controller.name", str(path)), ("loop.clock", "lockstep"), ("run.duration_s", 1.0)]
    return resolve(read(name, [*given, *changes]))


def run(path, out):
    changes = [("controller.name", str(path)), ("loop.clock", "lockstep"), ("link.kind", "memory"),
               ("run.duration_s", 0.6)]  # fmt: skip
    commands.run("steady", changes, commands.RunOptions(out, False, False, None))
    return out / "controller.mcap"


def test_a_law_from_the_template_holds_a_load_step_and_conforms(here):
    path = write("law", "my-law", force=False)
    assert len(path.read_text().splitlines()) <= 30
    course = simulate(scenario(path, ("run.duration_s", 3.0)))
    assert course.mode == "generating"
    assert abs(course.dead_centres[-1].x_m) == pytest.approx(0.0155, abs=1e-4)
    assert all(finding.met for finding in law_findings(path))


def test_settings_act_and_are_whole_in_the_configuration(here):
    path = write("law", "my-law", force=False)
    tame, keen = (
        simulate(scenario(path, ("run.duration_s", 1.6), ("controller.own.settings.kp", kp)))
        for kp in (0.0, 3e-4)
    )
    assert [dc.x_m for dc in tame.dead_centres] != [dc.x_m for dc in keen.dead_centres]
    own = scenario(path, ("controller.own.settings.kp", 3e-4)).controller.own
    assert own.settings == {"kp": 3e-4, "ki": 1.0e-4}
    assert (own.name, len(own.sha256)) == ("my-law", 64)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ([("controller.own.settings.kx", 1.0)], "settings.kx: unknown; .*it has|has: kp, ki"),
        ([("controller.own.settings.kp", -1.0)], "settings.kp = -1.0: Input should be greater"),
    ],
)
def test_wrong_settings_are_refused_by_name(here, changes, told):
    with pytest.raises(ConfigError, match=told):
        scenario(write("law", "my-law", force=False), *changes)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("class A:\n  def step(self:", r"bad.py line 2: "),
        ("x = 1 / 0", "bad.py line 1: ZeroDivisionError"),
        ("x = 1", "accepted is one class with step; found: none"),
        ("class A:\n  def step(s, a, b): 0\nclass B(A): 0", "found: A, B"),
    ],
)
def test_a_file_that_is_no_law_is_one_line_that_names_it(here, text, told):
    (here / "bad.py").write_text(text)
    with pytest.raises(ConfigError, match=told):
        scenario(here / "bad.py")


def test_a_name_of_ours_is_refused(here):
    with pytest.raises(ConfigError, match="'cascade' is a law of ours"):
        simulate(scenario(law(here, name="cascade.py")))


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ("return state, float('nan')", "accepted: its next state and the fuel"),
        ("return view.point.fuel_kg", "accepted: its next state and the fuel"),
        ("return state, view.nothing", r"mine.py line 7: AttributeError"),
    ],
)
def test_a_law_that_fails_ends_the_run_with_its_line(here, body, told):
    with pytest.raises(RunError, match=told):
        simulate(scenario(law(here, body)))


@pytest.mark.parametrize(
    ("body", "demand"),
    [
        ("self.n = getattr(self, 'n', 0) + 1; return state, view.point.fuel_kg + self.n * 1e-12",
         "purity: the same answer"),
        ("return [1.0], view.point.fuel_kg", "snapshot"),
        ("return state, 0.1 * view.point.fuel_kg", "the dead centre is held"),
        ("return state, view.point.fuel_kg / state", "range"),
    ],
)  # fmt: skip
def test_what_a_law_does_wrong_is_named(here, body, demand):
    missed = [finding.demand for finding in law_findings(law(here, body)) if not finding.met]
    assert any(one.startswith(demand) for one in missed), missed


def test_its_log_keeps_it_and_is_replayed_by_the_given_file_alone(here):
    path = law(here)
    log = run(path, here / "out")
    with hil.log.open(log) as opened:
        assert opened.attachments["mine.py"].content == path.read_bytes()
    assert replay_file(log, None, ALWAYS, OwnFiles(path)).identical
    with pytest.raises(LogError, match="is of a law of its user's, mine"):
        replay_file(log, None, ALWAYS)
    with pytest.raises(LogError, match="is another file than the one of the run"):
        replay_file(log, None, ALWAYS, OwnFiles(law(here, "return state, 2e-6", "other.py")))
    assert replay_file(here / "out" / "plant.mcap", None, ALWAYS).identical


def test_it_is_tuned_by_the_numbers_of_its_settings(here):
    path = str(write("law", "my-law", force=False))
    assert tune.keys_of(path) == ("own.settings.kp", "own.settings.ki")
    assert tune.gains_in_force(path) == {"own.settings.kp": 1.8e-4, "own.settings.ki": 1.0e-4}
    none = Trial((), ())
    assert "own.settings.kp = 0.00018" in tune.table(path, tune.gains_in_force(path), none, [])
    with pytest.raises(ConfigError, match="declares no number"):
        tune.keys_of(str(law(here)))


def test_an_engine_is_believed_by_both_sides(here):
    path = write("prototype", "my-engine", force=False)
    plant = PlantConfig(prototype=str(path))
    assert (plant.prototype, plant.own.name) == ("nu", "my-engine")
    assert plant.believed().moving_mass_kg == plant.resolved_prototype().moving_mass_kg == 7.5
    preset = resolve(read("steady", [("plant.prototype", str(path))])).controller.preset
    engine = plant.believed()
    half_period_s = math.pi * math.sqrt(7.5 / engine.stiffness_n_m(preset.fuel_kg))
    assert preset.stroke_s == pytest.approx(half_period_s, rel=2e-3)
    course = simulate(resolve(read("load-decrease", [("plant.prototype", str(path))])))
    assert course.mode == "generating"


def test_figures_of_a_model_in_full_are_replaced_by_table(here):
    (here / "mine.toml").write_text('like = "nu"\n[two-stroke.breathing]\nlift_m = 0.005\n')
    from hil.config.detailed import of_plant

    found = of_plant(PlantConfig(prototype=str(here / "mine.toml"), model="two-stroke"))
    assert found.breathing.lift_m == 0.005
    assert of_plant(PlantConfig(model="two-stroke")).breathing.lift_m == 0.004


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('like = "none"', "like = 'none': accepted: bit"),
        ("bore = 1", "bore: unknown key"),
        ("bore_m = -1.0", "bore_m"),
        ("[three-stroke.gas]\ngamma = 1.3", r"\[three-stroke\]: nu has: \[four-stroke.TABLE\]"),
    ],
)
def test_an_engine_that_is_none_is_refused_by_file_and_key(here, text, told):
    (here / "mine.toml").write_text(text)
    with pytest.raises(ConfigError, match=told):
        PlantConfig(prototype=str(here / "mine.toml"))


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_begun_from_runs_as_it_is(here, kind, capsys):
    path = write(kind, "my-own", force=False)
    with pytest.raises(ConfigError, match="exists already"):
        write(kind, "my-own", force=False)
    if kind in ("scenario", "suite"):
        found = read_cases(str(path))
        assert len(found) == (3 if kind == "suite" else 1)
        resolve(found[0].scenario())


@pytest.mark.parametrize("name", ["My", "a b", "", "../x"])
def test_a_name_that_is_none_is_refused(here, name):
    with pytest.raises(ConfigError, match="small letters"):
        write("law", name, force=False)
