"""The thesis's own loops: what they are compared with, what they learn, where they are led."""

import statistics

import pytest

from bench.run.offline import simulate
from bench.run.resolve import resolve
from bench.run.scenarios import find
from controller.motion.balance import EVEN, Balance
from controller.motion.laws import LAWS
from controller.motion.ordered import Ordered
from controller.motion.pid import Loop, pid_step
from controller.supervisory import Supervisor
from hil.config.controller import ControllerConfig, Gains
from hil.config.load import build, with_override
from hil.config.prototypes import NU
from hil.errors import ConfigError
from hil.toml import read_toml

LOOPS = ["cascade", "single-loop"]
LINEAR = ["harmonic", "rectangular"]
LIMIT_M = 0.0195


def run(law, model, duration_s, **settings):
    tree = read_toml(find("steady"))
    settings |= {
        "controller.name": law, "plant.model": model, "run.duration_s": duration_s,
        "loop.clock": "lockstep",
    }  # fmt: skip
    for key, value in settings.items():
        tree = with_override(tree, key, value)
    return simulate(resolve(build(tree, law)))


def moved(law, model, start_m, end_m):
    event = {"kind": "set-point", "tdc_ref_m": end_m, "at_s": 0.1}
    return run(law, model, 0.8, **{"controller.tdc_ref_m": start_m, "events.move": event})


def test_the_derivative_acts_on_what_the_error_has_changed_since_the_stroke_before():
    gains, loop = Gains(kp=2.0, ki=0.5, kd=3.0), Loop(0.25, 0.4)
    after, terms = pid_step(gains, loop, 1.0, -10.0, 10.0)
    assert terms.d == pytest.approx(3.0 * 0.6)
    assert terms.u == pytest.approx(2.0 + 0.25 + 1.8)
    assert after == Loop(0.75, 1.0)
    assert terms.pd == terms.p + terms.d


def test_an_error_counts_against_the_set_point_under_which_its_stroke_was_ordered():
    ordered = Ordered().and_now(0.013)
    assert ordered.for_dead_centre(0.013) == 0.013
    ordered = ordered.and_now(0.013).and_now(0.016)
    assert ordered.for_dead_centre(0.016) == 0.013
    assert ordered.for_mid_stroke(0.016) == pytest.approx(0.0145)
    assert ordered.and_now(0.016).for_dead_centre(0.016) == 0.016


@pytest.mark.parametrize("law", LOOPS)
@pytest.mark.parametrize("model", LINEAR)
@pytest.mark.parametrize(("start_m", "end_m"), [(0.013, 0.016), (0.016, 0.014)])
def test_a_new_set_point_is_reached_without_a_large_overshoot(law, model, start_m, end_m):
    course = moved(law, model, start_m, end_m)
    reached = [abs(dc.x_m) for dc in course.dead_centres]
    assert course.mode == "generating"
    assert not course.events
    assert min(start_m, end_m) - 0.6e-3 < min(reached)
    assert max(reached) < max(start_m, end_m) + 0.6e-3
    assert reached[-1] == pytest.approx(end_m, abs=1e-4)


@pytest.mark.parametrize("law", [name for name in LAWS if name not in ("open-loop", "cycle")])
@pytest.mark.parametrize("model", LINEAR)
def test_a_set_point_near_the_head_is_approached_without_touching_it(law, model):
    course = moved(law, model, 0.0155, 0.0192)
    reached = [abs(dc.x_m) for dc in course.dead_centres]
    assert course.mode == "generating"
    assert max(reached) < LIMIT_M
    assert reached[-1] == pytest.approx(0.0192, abs=1e-4)


def test_a_step_of_the_set_point_leaves_room_for_an_overshoot_as_large_as_itself():
    config = ControllerConfig()
    supervisor = Supervisor(config, NU, 1e-3, LIMIT_M)
    now, _ = supervisor.changed(supervisor.initial(), 0.0194, None)
    for _ in range(20):
        before = now.tdc_ref_m
        now = supervisor.approach(now)
        assert now.tdc_ref_m + (now.tdc_ref_m - before) <= LIMIT_M + 1e-12
        assert now.tdc_ref_m - before <= config.supervisory.tdc_step_m + 1e-12
    assert now.tdc_ref_m == now.tdc_target_m == 0.0194


@pytest.mark.parametrize("law", LOOPS)
@pytest.mark.parametrize("model", [*LINEAR, "nonlinear"])
@pytest.mark.parametrize("share", [0.05, 0.1])
def test_cylinders_that_differ_are_learnt(law, model, share):
    injector = "plant.injector.flow_scale"
    course = run(law, model, 2.2, **{f"{injector}_left": 1 + share, f"{injector}_right": 1 - share})
    late = [1e3 * (abs(dc.x_m) - 0.0155) for dc in course.dead_centres[-20:]]
    assert course.mode == "generating"
    assert max(map(abs, late)) < 0.1
    assert statistics.pstdev(late) < 0.085


@pytest.mark.interpreted("what a method is given is listened to")
@pytest.mark.parametrize("law", LOOPS)
def test_a_load_step_teaches_nothing_of_the_cylinders(law, monkeypatch):
    taught = []
    shared = Balance.shared
    monkeypatch.setattr(
        Balance, "shared", lambda self, *given: taught.append(self.more) or shared(self, *given)
    )
    load = {"kind": "load-scale", "value": 0.85, "at_s": 0.1, "at_stroke_fraction": 0.25}
    assert run(law, "harmonic", 0.8, **{"events.load": load}).mode == "generating"
    assert set(taught) == {EVEN.more}


@pytest.mark.parametrize(("name", "refused"), [("cascade", True), ("open-loop", False)])
def test_a_run_begins_at_no_set_point_that_an_operator_could_not_have(name, refused):
    tree = {"controller": {"name": name, "tdc_ref_m": 0.0193}}
    if not refused:
        resolve(build(tree, "test"))
        return
    with pytest.raises(ConfigError, match=r"tdc_ref_m = 0\.0193: accepted up to 0\.0192"):
        resolve(build(tree, "test"))
