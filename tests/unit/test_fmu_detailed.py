"""A detailed engine as a unit: its own compiled step outside of Python, and the same motion."""

import shutil

import pytest

pytest.importorskip("fmpy", reason="needs the extra fmu")
pytest.importorskip("numba", reason="needs the extra detailed")
if shutil.which("cc") is None:
    pytest.skip("needs a C compiler", allow_module_level=True)

from fmpy import simulate_fmu
from fmpy.validation import validate_fmu
from fmu_units import ours

from bench.fmu.export import export
from bench.run.offline import simulate
from bench.run.resolve import resolve
from bench.run.scenarios import read
from hil.errors import ConfigError
from plant.build import make_params
from plant.rig.beginning import initial_state
from plant.rig.state import Command
from plant.rig.step import step
from plant.sensors import sensed

pytestmark = pytest.mark.slow


def course(name, model, changes=()):
    return simulate(resolve(read(name, [("plant.model", model), *changes])))


@pytest.mark.parametrize(
    ("model", "prototype"), [("two-stroke", "nu"), ("starting", "bit"), ("four-stroke", "nu")]
)
def test_steady_running_through_a_unit_differs_by_less_than_a_nanometre(model, prototype):
    path = ours(model, 3, prototype)
    assert validate_fmu(str(path)) == []
    changes = [("run.duration_s", 0.5)]
    own = course("steady", model, changes)
    there = course("steady", f"fmu:{path}", changes)
    assert len(own.dead_centres) == len(there.dead_centres) > 10
    for a, b in zip(own.dead_centres, there.dead_centres, strict=True):
        assert b.x_m == pytest.approx(a.x_m, abs=1e-9)
        assert b.fuel_kg == a.fuel_kg
    assert own.events == there.events == []


def test_a_start_from_rest_through_a_unit_reaches_the_same_strokes():
    changes = [("run.duration_s", 1.5)]
    own = course("start", "two-stroke", changes)
    there = course("start", f"fmu:{ours('two-stroke', 2)}", changes)
    assert own.mode == there.mode == "generating"
    pairs = zip(own.dead_centres, there.dead_centres, strict=True)
    assert max(abs(a.x_m - b.x_m) for a, b in pairs) < 1e-9


def test_a_detailed_unit_moves_in_another_tool():
    begin = {"start_fuel_kg": 4.0e-6, "load_coefficient_n_s_m": 810.0}
    outputs = ["x_m", "p_left_pa", "dead_centres", "fuel_burnt_kg"]
    found = simulate_fmu(
        str(ours("two-stroke", 2)), stop_time=0.03, output_interval=1e-3, start_values=begin,
        output=outputs,
    )  # fmt: skip
    assert found["p_left_pa"].max() > 20e5
    assert found["dead_centres"].tolist()[0] == 1
    assert found["dead_centres"].tolist()[-1] == 2
    assert found["fuel_burnt_kg"].tolist()[-1] == 0.0  # nothing was lit on the right


@pytest.mark.parametrize(("model", "prototype"), [("starting", "bit"), ("four-stroke", "nu")])
def test_a_unit_tells_the_power_that_our_plant_tells(model, prototype):
    powers = []
    for name in (model, f"fmu:{ours(model, 3, prototype)}"):
        scenario = resolve(read("steady", [("plant.model", name)]))
        p = make_params(scenario)
        control = scenario.controller
        load = control.supervisory.load_coefficient_n_s_m
        s, _ = initial_state(p, control.preset.fuel_kg, load)
        told = []
        for _ in range(30):
            s, _ = step(p, s, Command())
            told.append(sensed(p, s).electric_power_w)
        powers.append(told)
    assert powers[1] == pytest.approx(powers[0], rel=1e-6, abs=1e-6)
    assert max(map(abs, powers[0])) > 1.0


def test_a_prototype_without_a_calibration_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"has no calibration for plant\.prototype bit"):
        export(tmp_path / "a.fmu", "four-stroke", "bit", 2)
