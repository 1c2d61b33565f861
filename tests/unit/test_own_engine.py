"""An engine of one's own: a file or an installed package of Python, used as one of ours."""

import math
import sys

import pytest

import hil.log
from bench.logs.replay.replay import OwnFiles, replay_file
from bench.own import watching
from bench.own.beginning import write
from bench.own.conformance import engine_findings
from bench.run import commands
from bench.run.offline import simulate
from bench.run.resolve import resolve
from bench.run.scenarios import read
from hil import brought
from hil.config.plant import PlantConfig
from hil.config.terms import terms_of
from hil.errors import ConfigError, LogError, RunError
from hil.log.part import ALWAYS
from hil.wire.commands import read_event
from hil.wire.messages import GENERATOR, MOTOR
from plant.build import plant_params
from plant.engines import build_engine
from plant.engines.machine import MachineOrder
from plant.engines.protocol import BY_SPARK
from plant.rig.beginning import initial_state
from plant.rig.events import AT_REST, CONTACT, IN_MOTION
from plant.rig.state import Command
from plant.rig.step import step

PERIOD_NS = 1_000_000
PUSH = MachineOrder(MOTOR, 500.0, 0.0)
BRAKE = MachineOrder(GENERATOR, 0.0, 600.0)
FUEL_KG = 1.7e-6

PENDULUM = """
import math

W = 100.0


class Pendulum:
    like = "harmonic"

    def __init__(self, figures):
        self.figures = figures

    def begin(self, x_m):
        return x_m, 0.0

    def advance(self, state, inputs, span_s):
        x, v = state
        c, s = math.cos(W * span_s), math.sin(W * span_s)
        {body}

    def sensed(self, state, machine):
        return 1e5, 2e5
"""
SWING = "return c * x + s * v / W, c * v - W * s * x"


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def template(here):
    return write("engine", "my-engine", force=False)


def pendulum(here, body=SWING, name="pendulum.py"):
    path = here / name
    path.write_text(PENDULUM.format(body=body))
    return path


def scenario(path, *changes, name="load-decrease"):
    given = [("plant.model", str(path)), ("loop.clock", "lockstep"), ("run.duration_s", 1.0)]
    return resolve(read(name, [*given, *changes]))


def run(path, out, name="steady"):
    changes = [("plant.model", str(path)), ("loop.clock", "lockstep"), ("link.kind", "memory"),
               ("run.duration_s", 0.6)]  # fmt: skip
    commands.run(name, changes, commands.RunOptions(out, False, False, None))
    return out


# --- its physics -------------------------------------------------------------------------------


def test_the_template_moves_as_our_model_of_the_same_equations(template):
    """m x'' = A (p_l - p_r) - c x' + F: both integrate it, ours with a step by the gap."""
    courses = [
        simulate(scenario(model, ("run.duration_s", 1.6))) for model in (template, "nonlinear")
    ]
    theirs, ours = (course.dead_centres for course in courses)
    assert len(theirs) == len(ours) > 60
    assert theirs[1].x_m == pytest.approx(ours[1].x_m, abs=1e-8)
    # An injection of a microsecond more is 3.4 um of dead centre: both are commanded in whole ones.
    assert max(abs(a.x_m - b.x_m) for a, b in zip(theirs, ours, strict=True)) < 3 * 3.4e-6


def test_it_conforms_from_rest_to_misfire(template):
    missed = [finding for finding in engine_findings(template) if not finding.met]
    assert not missed


def test_dead_centres_are_found_where_the_velocity_turns(here):
    """x'' = -w^2 x: half a period, and no metre lost."""
    engine = PlantConfig(model=str(pendulum(here)))
    params = plant_params(engine, PERIOD_NS)
    state, _ = initial_state(params, FUEL_KG, 810.0)
    first_m = abs(state.x_m)
    for _ in range(400):
        state, _ = step(params, state, Command(BRAKE))
    number = state.dead_centre.number
    assert number == 1 + int(0.4 / (math.pi / 100.0))
    assert state.dead_centre.t_ns == pytest.approx((number - 1) * math.pi / 100.0 * 1e9, abs=20)
    assert abs(state.dead_centre.x_m) == pytest.approx(first_m, rel=1e-9)


def test_a_load_step_in_mid_stroke_acts_at_its_instant(template):
    load = read_event({"kind": "load-scale", "value": 0.5, "at_s": 0.0, "at_stroke_fraction": 0.25})
    seen = {}
    for model in (str(template), "nonlinear"):
        params = plant_params(PlantConfig(model=model), PERIOD_NS, 0, {"load": load})
        state, events = initial_state(params, FUEL_KG, 810.0)
        for _ in range(40):
            state, more = step(params, state, Command(BRAKE))
            events += more
        seen[model] = [e.t_ns for e in events if e.code == "disturbance"]
    theirs, ours = seen.values()
    assert theirs == pytest.approx(ours, abs=2e3)


def test_it_sets_off_strikes_a_head_and_comes_to_rest(template):
    params = plant_params(PlantConfig(model=str(template)), PERIOD_NS)
    state, _ = initial_state(params)
    codes = []
    for tick in range(1500):
        order = MachineOrder(MOTOR, math.copysign(500.0, state.v_m_s), 0.0)
        state, events = step(params, state, Command(order if tick < 250 else BRAKE))
        codes += [event.code for event in events]
    assert (codes[0], codes[-1]) == (IN_MOTION, AT_REST)
    assert CONTACT in codes
    assert not state.moving


def test_settings_act(template):
    easy, stiff = (
        simulate(scenario(template, ("plant.own.settings.friction_n_s_m", friction)))
        for friction in (0.0, 100.0)
    )
    assert stiff.dead_centres[-1].fuel_kg > 1.02 * easy.dead_centres[-1].fuel_kg


SPARKED = """
    def light(self, state, side, fuel_kg):
        if (state[0] < 0.0) != (side == 0):
            return None
        heat_j = fuel_kg * self.figures.energy_j_kg
        return state[0], state[1], heat_j * (side == 0), heat_j * (side == 1)
"""


def test_one_that_is_lit_by_sparks_runs(here, template):
    """The charge burns at its spark, before the dead centre: another engine, and controlled."""
    text = template.read_text()
    at = text.index("    def turn(")
    path = here / "sparked.py"
    path.write_text(text[:at] + SPARKED.lstrip("\n") + "\n" + text[text.index("    def sensed") :])
    found = scenario(path, ("run.duration_s", 1.6))
    engine = build_engine(found.plant, PERIOD_NS)
    assert engine.ignition == BY_SPARK
    course = simulate(found)
    assert course.mode == "generating"
    assert not [e for e in course.events if e.code == "misfire"]
    assert abs(course.dead_centres[-1].x_m) == pytest.approx(0.0155, abs=3e-4)


# --- what is refused ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ("return [x, v]", "advance gave .*accepted: a tuple, position"),
        ("return float('nan'), v", "advance gave .*accepted: a tuple, position"),
        ("return x, self.nothing", "pendulum.py line 19: AttributeError"),
    ],
)
def test_one_that_fails_ends_the_run_with_its_line(here, body, told):
    with pytest.raises(RunError, match=told):
        simulate(scenario(pendulum(here, body)))


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("plant.model", "harmonik", "plant.model: Input should be 'closed-form', 'harmonic'"),
        ("plant.model", "./none.py", "none.py: No such file"),
        ("plant.own.settings.kx", 1.0, "plant.own.settings.kx: unknown; .* has: friction_n_s_m"),
        ("plant.own.settings.friction_n_s_m", -1.0, "friction_n_s_m = -1.0: Input should be gr"),
        ("plant.own.like", "mine", "plant.own.like: Input should be 'closed-form'"),
        ("plant.own.sha256", "00", "my_engine.py: is another file than the one of the run"),
    ],
)
def test_what_is_wrong_is_refused_by_key(template, key, value, told):
    with pytest.raises(ConfigError, match=told):
        scenario(template, (key, value))


def test_a_file_without_its_model_is_refused(template):
    with pytest.raises(ConfigError, match=r"own.file needs its model; model = 'harmonic'"):
        resolve(read("steady", [("plant.own.file", str(template))]))


@pytest.mark.parametrize(
    ("body", "demand"),
    [
        ("self.n = getattr(self, 'n', 0) + 1; return x, v + self.n * 1e-9", "purity: the same"),
        ("return c * x + s * v / W, 1.001 * (c * v - W * s * x)", "energy: without fuel"),
        ("return c * x + s * v / W + 10.0 * span_s**2, c * v - W * s * x", "consistency"),
    ],
)
def test_what_an_engine_does_wrong_is_named(here, body, demand, monkeypatch):
    monkeypatch.setattr(watching, "CASES", (("steady", 0.2),))
    missed = [
        finding.demand for finding in engine_findings(pendulum(here, body)) if not finding.met
    ]
    assert any(one.startswith(demand) for one in missed), missed


# --- the log -----------------------------------------------------------------------------------


def test_its_log_keeps_it_and_is_replayed_by_the_given_file_alone(here, template):
    out = run(template, here / "out")
    log = out / "plant.mcap"
    with hil.log.open(log) as opened:
        assert opened.attachments["my_engine.py"].content == template.read_bytes()
    assert replay_file(log, None, ALWAYS, OwnFiles(engine=template)).identical
    with pytest.raises(LogError, match="is of an engine of its user's, my-engine"):
        replay_file(log, None, ALWAYS)
    with pytest.raises(LogError, match="is another file than the one of the run"):
        replay_file(log, None, ALWAYS, OwnFiles(engine=pendulum(here)))
    template.unlink()
    assert replay_file(out / "controller.mcap", None, ALWAYS).identical
    assert commands.report(out, None, force=True) in (0, 1)


def test_both_sides_must_have_the_same_engine(here, template):
    mine = scenario(template)
    template.write_text(template.read_text() + "\n# changed\n")
    assert terms_of(mine) != terms_of(scenario(template))
    elsewhere = mine.plant.own.model_copy(update={"file": "/elsewhere/my_engine.py"})
    moved = mine.model_copy(update={"plant": mine.plant.model_copy(update={"own": elsewhere})})
    assert terms_of(mine) == terms_of(moved)


# --- installed packages ------------------------------------------------------------------------


@pytest.fixture
def package(here, template, monkeypatch):
    """A package that is installed: its modules and what pip writes beside them."""
    site = here / "site"
    written = site / "bought-1.0.dist-info"
    written.mkdir(parents=True)
    law = write("law", "my-law", force=False)
    (site / "bought_engine.py").write_text(template.read_text())
    (site / "bought_law.py").write_text(law.read_text())
    (written / "METADATA").write_text("Metadata-Version: 2.1\nName: bought\nVersion: 1.0\n")
    (written / "entry_points.txt").write_text(
        f"[{brought.LAWS}]\nbought-law = bought_law:Law\n"
        f"[{brought.ENGINES}]\nbought-engine = bought_engine:Engine\n"
    )
    monkeypatch.syspath_prepend(str(site))
    monkeypatch.setenv("PYTHONPATH", str(site))
    brought.installed.cache_clear()
    yield site
    brought.installed.cache_clear()
    for name in ("bought_engine", "bought_law"):
        sys.modules.pop(name, None)


def test_an_installed_package_offers_law_and_engine_by_name(here, package):
    changes = [("controller.name", "bought-law"), ("plant.model", "bought-engine"),
               ("loop.clock", "lockstep"), ("link.kind", "memory"), ("run.duration_s", 0.6),
               ("controller.own.settings.kp", 2e-4)]  # fmt: skip
    commands.run("steady", changes, commands.RunOptions(here / "out", False, False, None))
    for side, module in (("plant", "bought_engine.py"), ("controller", "bought_law.py")):
        log = here / "out" / f"{side}.mcap"
        with hil.log.open(log) as opened:
            assert opened.attachments[module].content == (package / module).read_bytes()
        assert replay_file(log, None, ALWAYS).identical


def test_a_package_that_has_changed_is_not_the_runs(package):
    found = scenario("bought-engine")
    (package / "bought_engine.py").write_text("# another\n")
    with pytest.raises(ConfigError, match="is another file than the run's"):
        build_engine(found.plant, PERIOD_NS)


def test_a_package_that_is_gone_is_told(package):
    found = scenario("bought-engine")
    (package / "bought-1.0.dist-info" / "entry_points.txt").unlink()
    brought.installed.cache_clear()
    with pytest.raises(ConfigError, match="no installed package offers 'bought-engine'"):
        build_engine(found.plant, PERIOD_NS)
