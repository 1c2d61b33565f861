"""Port injection: the film's equation, the intake that closes, and what the laws make of it."""

import math

import pytest

from bench.run import scenarios
from bench.run.offline import simulate
from bench.run.resolve import resolve
from hil.config.charge.injection import InjectorConfig
from hil.config.load import build, with_override
from hil.config.plant import PlantConfig
from hil.errors import ConfigError
from hil.wire.messages import INJECTOR_LEFT
from hil.wire.pulses import PulseOrder, follow
from plant.rig import actuation
from plant.rig.params import injector_of
from plant.rig.port import Port, Wall, crossing_share, later

US = 1000
WALL = Wall(share=0.3, tau_ns=0.25e9, closes_m=-0.014)


def scenario(name="load-decrease", **changes):
    tree = {**scenarios.tree_of(name), "expect": {}}
    changes = {"plant.injector.kind": "port", **changes}
    for key, value in changes.items():
        tree = with_override(tree, key, value)
    return resolve(build(tree, name))


def ends_mm(course, since_s=0.0):
    return [1e3 * abs(dc.x_m) for dc in course.dead_centres if dc.t_ns > since_s * 1e9]


def test_the_film_follows_its_equation_and_keeps_all_mass():
    """dm/dt = X m_inj' - m / tau by Euler's rule; film and vapour are all there is."""
    q, from_ns, to_ns, until_ns = 1e-3, 2e6, 5e6, 40e6
    port = later(WALL, Port(0.0, 1.2e-6, 0.1e-6), q, from_ns, to_ns, until_ns)
    film_kg, step_ns = 1.2e-6, 1e3
    for n in range(round(until_ns / step_ns)):
        flows = from_ns <= (n + 0.5) * step_ns < to_ns
        film_kg += 1e-9 * step_ns * (WALL.share * q * flows - film_kg / (1e-9 * WALL.tau_ns))
    assert port.film_kg == pytest.approx(film_kg, rel=1e-5)
    fed_kg = q * 1e-9 * (to_ns - from_ns)
    assert port.film_kg + port.vapour_kg == pytest.approx(1.3e-6 + fed_kg, rel=1e-12)
    halves = later(WALL, later(WALL, Port(0.0, 1.2e-6, 0.1e-6), q, from_ns, to_ns, 3e6),
                   q, from_ns, to_ns, until_ns)  # fmt: skip
    assert halves.film_kg == pytest.approx(port.film_kg, rel=1e-12)


def test_what_has_not_gone_in_as_the_intake_closes_waits_for_the_next():
    """Half of the injection flows before the closing: X = 0 leaves no film, so exactly half."""
    config = InjectorConfig(kind="port", film_share=0.0)
    injector = injector_of(config, PlantConfig().resolved_prototype().half_stroke_m)
    before = actuation.Actuation()
    orders = (PulseOrder(INJECTOR_LEFT, 0, 2800),)
    table, _ = follow(before.table, True, orders, 0)
    lines = actuation.advance(actuation.with_table(before, table), injector, 1800.0 * US)
    lines = actuation.shut(lines, injector, 0, 1800.0 * US, 7)
    assert actuation.fuel_until(lines, injector, 0, 1800.0 * US) == pytest.approx(1e-6)
    lines = actuation.advance(lines, injector, 5000.0 * US)
    assert actuation.fuel_until(lines, injector, 0, 5000.0 * US) == pytest.approx(1e-6)
    assert lines.ports[0].vapour_kg == pytest.approx(1e-6)
    lines = actuation.scavenge(lines, injector, 0, 20_000.0 * US)
    lines = actuation.shut(lines, injector, 0, 50_000.0 * US, 9)
    assert actuation.fuel_until(lines, injector, 0, 50_000.0 * US) == pytest.approx(1e-6)


def test_the_closing_is_found_between_two_positions():
    """A sine through both of them, in steps of a millisecond."""
    w, x = math.pi / 0.025, 0.0155

    def at(t):
        return -x * math.cos(w * t), x * w * math.sin(w * t)

    closes_s = math.acos(0.014 / x) / w
    begin = 1e-3 * math.floor(closes_s * 1e3)
    share = crossing_share(*at(begin), *at(begin + 1e-3), 1e-3, -0.014)
    assert begin + 1e-3 * share == pytest.approx(closes_s, abs=1e-7)


def test_a_settled_engine_stays_settled_on_compensated_injections():
    course = simulate(scenario("steady", **{"controller.name": "open-loop", "run.duration_s": 0.9}))
    burnt = [dc.fuel_kg for dc in course.dead_centres]
    assert max(burnt) - min(burnt) < 2e-3 * burnt[0]
    assert not course.events


def test_a_film_that_is_not_known_of_is_felt_when_the_fuel_changes():
    """Of a step in the injected mass 1 - X b acts at once, the rest from cycle to cycle."""
    found = {}
    for known in (0.3, 0.0):
        changes = {"controller.injector.film_share": known, "controller.name": "pdf"}
        course = simulate(scenario(**changes, **{"run.duration_s": 1.6}))
        found[known] = [abs(x - 15.5) for x in ends_mm(course, 1.2)]
    assert max(found[0.0]) > 2.0 * max(found[0.3])


def test_port_injection_costs_a_stroke_and_no_more():
    """Of -15 % at mid-stroke: what is in the cylinder burns, so a second dead centre is too far."""
    late = {}
    for kind in ("direct", "port"):
        course = simulate(scenario(**{"plant.injector.kind": kind, "controller.name": "pdf",
                                      "run.duration_s": 1.5}))  # fmt: skip
        late[kind] = sum(abs(x - 15.5) > 0.1 for x in ends_mm(course, 1.0))
    assert late["port"] == late["direct"] + 1


@pytest.mark.parametrize("law", ["cascade", "single-loop", "predictive", "machine"])
def test_every_law_survives_load_steps_on_port_injection(law):
    course = simulate(scenario(**{"controller.name": law, "run.duration_s": 1.9}))
    assert {e.code for e in course.events} == {"disturbance"}
    assert max(abs(x - 15.5) for x in ends_mm(course, 1.8)) < 0.1


def test_an_engine_starts_on_port_injection():
    course = simulate(scenario("start", **{"controller.name": "pdf"}))
    assert course.mode == "generating"
    assert ends_mm(course)[-1] == pytest.approx(15.5, abs=0.02)
    assert {e.code for e in course.events} == {"in-motion"}


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        pytest.param({"plant.model": "four-stroke"}, "accepted: direct", marks=pytest.mark.slow),
        ({"controller.injector.kind": "direct"}, "controller.injector.kind = 'direct'"),
    ],
)
def test_what_cannot_work_is_refused_by_name(changes, told):
    with pytest.raises(ConfigError, match=told):
        scenario(**changes)
