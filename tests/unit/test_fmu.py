"""A Functional Mock-up Unit as plant: ours gives our own numbers, another hand's is understood."""

import re
import shutil
import sys
import zipfile
from pathlib import Path

import pytest

pytest.importorskip("fmpy", reason="needs the extra fmu")
if shutil.which("cc") is None:
    pytest.skip("needs a C compiler", allow_module_level=True)

from fmpy import simulate_fmu
from fmpy.validation import validate_fmu
from fmu_units import FOREIGN_NAMES, MODELS, changed, folder, foreign, ours, renamed
from hypothesis import given
from hypothesis import strategies as st

from bench.fmu.check import check
from bench.fmu.export import export
from bench.run.offline import simulate
from bench.run.resolve import resolve
from bench.run.scenarios import read
from hil import snapshot
from hil.config.engine.models import FmuConfig
from hil.config.load import build
from hil.config.plant import PlantConfig
from hil.errors import ConfigError, MissingExtraError, RunError
from hil.wire.commands import read_event
from hil.wire.messages import GENERATOR, MOTOR
from hil.wire.pulses import PulseOrder
from plant.build import plant_params
from plant.engines.fmu.archive import open_archive
from plant.engines.fmu.contract import ALL
from plant.engines.fmu.turning import turning_point
from plant.engines.fmu.unit import Unit
from plant.engines.machine import MachineOrder
from plant.rig.beginning import initial_state
from plant.rig.events import AT_REST, IN_MOTION, MISFIRE, SAFE_STATE
from plant.rig.state import Command, PlantState
from plant.rig.step import step
from plant.sensors import sensed

PERIOD_NS = 1_000_000
LOAD = MachineOrder(GENERATOR, 0.0, 810.0)
PUSH = MachineOrder(MOTOR, 300.0, 0.0)
NO_SPARKS = (-1.0, -1.0)


def config(path, **fmu):
    return PlantConfig(model=f"fmu:{path}", fmu=FmuConfig(**fmu).model_dump(exclude={"file"}))


def rig(path, settled=False, events=None, **fmu):
    params = plant_params(config(path, **fmu), PERIOD_NS, events=events)
    state, _ = initial_state(params, 2.8185e-6 if settled else None, 810.0)
    return params, state


def run(params, state, ticks, order=LOAD, pulses=()):
    seen, states = [], []
    for _ in range(ticks):
        state, events = step(params, state, Command(order, tuple(pulses)))
        seen += events
        states.append(state)
    return states, seen


def course(name, model, changes=()):
    return simulate(resolve(read(name, [("plant.model", model), *changes])))


# --- what we export --------------------------------------------------------------------------


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("model", MODELS)
def test_an_exported_unit_passes_the_validator(model, version):
    assert validate_fmu(str(ours(model, version))) == []


@pytest.mark.parametrize("version", [2, 3])
def test_an_exported_unit_moves_in_another_tool_as_our_plant_does(version):
    path = ours("harmonic", version)
    begin = {"start_x_m": -0.0155, "start_fuel_kg": 2.8185e-6, "load_coefficient_n_s_m": 810.0}
    found = simulate_fmu(
        str(path), stop_time=0.1, output_interval=1e-3, start_values=begin, output=["x_m", "v_m_s"]
    )
    unit = Unit(open_archive(path), {}, {})
    x = [unit.start((0.0, 810.0, 0.0, 0.0, *NO_SPARKS), -0.0155, 2.8185e-6)["x_m"]]
    for tick in range(100):
        now = unit.step((0.0, 810.0, 0.0, 0.0, *NO_SPARKS), tick * 1e-3, 1e-3)
        x.append(now["x_m"])
    assert found["x_m"].tolist() == pytest.approx(x, abs=1e-9)


# The non-linear Beijing engine has no settled motion inside its stroke.
@pytest.mark.parametrize(
    ("model", "prototype"), [*((m, "nu") for m in MODELS), *((m, "bit") for m in MODELS[:3])]
)
def test_steady_running_through_a_unit_has_the_bits_of_our_own_model(model, prototype):
    changes = [("run.duration_s", 0.4), ("plant.prototype", prototype)]
    own = course("steady", model, changes)
    there = course("steady", f"fmu:{ours(model, 3, prototype)}", changes)
    assert len(own.dead_centres) > 10
    assert [(d.x_m, d.fuel_kg) for d in own.dead_centres] == [
        (d.x_m, d.fuel_kg) for d in there.dead_centres
    ]


@pytest.mark.parametrize("model", ["harmonic", "nonlinear"])
def test_a_start_from_rest_through_a_unit_has_the_bits_of_our_own_model(model):
    changes = [("run.duration_s", 1.5)]
    own = course("start", model, changes)
    there = course("start", f"fmu:{ours(model, 2)}", changes)
    assert own.mode == there.mode == "generating"
    assert [d.x_m for d in own.dead_centres] == [d.x_m for d in there.dead_centres]


@pytest.mark.parametrize("model", ["harmonic", "rectangular", "nonlinear"])
def test_a_load_step_inside_a_stroke_differs_by_less_than_a_nanometre(model):
    changes = [("run.duration_s", 1.4), ("events.load.value", 1.1)]
    own = course("load-increase", model, changes)
    there = course("load-increase", f"fmu:{ours(model, 3)}", changes)
    assert len(own.dead_centres) == len(there.dead_centres)
    pairs = zip(own.dead_centres, there.dead_centres, strict=True)
    assert max(abs(a.x_m - b.x_m) for a, b in pairs) < 1e-9


def test_varying_combustion_through_a_unit_has_the_bits_of_our_own_model():
    changes = [("run.duration_s", 0.5)]
    own = course("variations", "harmonic", changes)
    there = course("variations", f"fmu:{ours('harmonic', 2)}", changes)
    assert [(d.x_m, d.efficiency) for d in own.dead_centres] == [
        (d.x_m, d.efficiency) for d in there.dead_centres
    ]


def test_every_variable_of_the_contract_is_documented_with_its_unit():
    page = (Path(__file__).parents[2] / "docs" / "fmu.md").read_text()
    for variable in ALL:
        row = next(line for line in page.splitlines() if f"`{variable.name}`" in line)
        assert variable.causality in row
        assert variable.unit in row


def test_an_export_has_the_same_bytes_each_time(tmp_path):
    again = export(tmp_path / "again.fmu", "harmonic", "nu", 3).path
    assert again.read_bytes() == ours("harmonic", 3).read_bytes()


def test_a_parameter_of_the_unit_can_be_set():
    params, state = rig(ours("harmonic", 3), parameters={"moving_mass_kg": 14.0})
    heavy, _ = run(params, state, 10, PUSH)
    light, _ = run(*rig(ours("harmonic", 3)), 10, PUSH)
    assert 0.0 < heavy[-1].x_m < 0.6 * light[-1].x_m


def test_our_unit_says_which_model_and_engine_it_is():
    found = resolve(read("steady", [("plant.model", f"fmu:{ours('rectangular', 2, 'bit')}")]))
    assert (found.plant.fmu.like, found.plant.prototype) == ("rectangular", "bit")
    assert found.plant.fmu.sha256 == open_archive(ours("rectangular", 2, "bit")).sha256
    assert resolve(found) == found


# --- the plant around a unit -----------------------------------------------------------------


def test_a_step_is_a_function_of_its_arguments():
    params, state = rig(ours("harmonic", 3), settled=True)
    states, _ = run(params, state, 40)
    again, _ = step(params, states[20], Command(LOAD))
    assert again == states[21]
    other = plant_params(config(ours("harmonic", 3)), PERIOD_NS)
    assert step(other, states[20], Command(LOAD))[0] == states[21]


def test_the_state_of_a_unit_goes_through_a_snapshot():
    params, state = rig(ours("harmonic", 2), settled=True)
    states, _ = run(params, state, 5)
    assert snapshot.loads(PlantState, snapshot.dumps(states[-1])) == states[-1]


def test_a_lost_controller_brings_the_safe_state_and_rest():
    params, state = rig(ours("harmonic", 3), settled=True)
    seen = []
    for _ in range(600):
        state, events = step(params, state, None)
        seen += events
    codes = [e.code for e in seen]
    assert SAFE_STATE in codes
    assert codes[-1] == AT_REST
    assert state.v_m_s == 0.0
    assert not state.moving


def test_a_resting_piston_that_is_pushed_sets_off():
    states, seen = run(*rig(ours("harmonic", 2)), 3, PUSH)
    assert [e.code for e in seen] == [IN_MOTION]
    assert states[-1].moving


def test_a_forced_misfire_acts_through_a_unit():
    events = {"cough": read_event({"kind": "misfire", "at_s": 0.001, "count": 1})}
    params, state = rig(ours("harmonic", 3), settled=True, events=events)
    pulses = [PulseOrder(1, 5_000, 3_619), PulseOrder(3, 24_000, 500)]
    _, seen = run(params, state, 30, LOAD, pulses)
    assert [e.text for e in seen if e.code == MISFIRE] == ["right: forced, no spark"]


# --- a unit of another hand ------------------------------------------------------------------


@pytest.mark.parametrize("version", [2, 3])
def test_a_foreign_unit_is_valid_and_understood_in_its_own_names_and_units(version):
    assert validate_fmu(str(foreign(version))) == []
    params, state = rig(foreign(version), names=FOREIGN_NAMES)
    states, _ = run(params, state, 200, PUSH)
    swing = max(s.x_m for s in states)
    assert swing == pytest.approx(2.0 * 300.0 / 26.5e3, rel=1e-3)
    assert sensed(params, states[-1]).p_left_pa == 0.0  # it has no pressures


@pytest.mark.parametrize("version", [2, 3])
def test_dead_centres_of_a_foreign_unit_are_found_between_ticks(version):
    params, state = rig(foreign(version), names=FOREIGN_NAMES)
    states, _ = run(params, state, 200, PUSH)
    found = {s.dead_centre.t_ns: s.dead_centre.x_m for s in states if s.dead_centre.number}
    half_period_s = 3.141592653589793 * (7.0 / 26.5e3) ** 0.5
    assert len(found) == 3
    for n, (t_ns, x_m) in enumerate(found.items(), 1):
        assert t_ns * 1e-9 == pytest.approx(n * half_period_s, abs=5e-6)
        assert x_m == pytest.approx((n % 2) * 2.0 * 300.0 / 26.5e3, abs=2e-5)


def test_a_foreign_unit_fires_on_fuel_and_spark_and_misfires_without():
    params, state = rig(foreign(3), names=FOREIGN_NAMES)
    states, _ = run(params, state, 30, PUSH)
    pulses = [PulseOrder(1, 32_000, 3_600), PulseOrder(3, 39_500, 500)]
    lit, seen = run(params, states[-1], 80, MachineOrder(GENERATOR, 0.0, 0.0), pulses)
    assert max(s.dead_centre.fuel_kg for s in lit) == pytest.approx(2.8e-6)
    assert [e.text for e in seen if e.code == MISFIRE] == ["left: no fuel"]


def test_a_foreign_unit_runs_in_the_closed_loop():
    names = [(f"plant.fmu.names.{ours}", its) for ours, its in FOREIGN_NAMES.items()]
    changes = [("run.duration_s", 1.0), *names]
    there = course("start", f"fmu:{foreign(2)}", changes)
    assert max(abs(d.x_m) for d in there.dead_centres) > 0.01


def test_a_unit_that_cannot_be_set_back_can_only_be_stepped_forward():
    params, state = rig(foreign(2), names=FOREIGN_NAMES)
    states, _ = run(params, state, 3, PUSH)
    with pytest.raises(RunError, match="cannot be set back to an earlier state"):
        step(params, states[0], Command(PUSH))


# --- what is refused -------------------------------------------------------------------------


OLD = (
    '<?xml version="1.0"?><fmiModelDescription fmiVersion="1.0" modelName="old" guid="g" '
    'modelIdentifier="old" numberOfContinuousStates="0" numberOfEventIndicators="0">'
    "<ModelVariables/></fmiModelDescription>"
)


def refusal(path, **fmu):
    with pytest.raises(ConfigError) as caught:
        rig(path, **fmu)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_unit_without_a_variable_of_the_contract_is_refused_by_its_name():
    text = refusal(foreign(2))
    assert "has no variable machine_force_n (input, " in text
    assert "plant.fmu.names.machine_force_n" in text
    assert "it has: motor_force, brake, " in text


@pytest.mark.parametrize(
    ("replacements", "told"),
    [
        ({'valueReference="7" causality="output"': 'valueReference="7" causality="local"'},
         "variable piston_position: is local; accepted: output"),
        ({'<Real start="0.0"/>': '<Integer start="0"/>', 'variability="continuous"><I':
          'variability="discrete"><I'}, "variable motor_force: is of type Integer; accepted: Real"),
        ({'unit="mm"': 'unit="mm/s"'}, "variable piston_position: is in mm/s; accepted: m or a"),
        ({"CoSimulation": "ModelExchange"}, "has no co-simulation"),
        ({"{foreign}": "{another}"}, "cannot be loaded: "),
    ],
)  # fmt: skip
def test_a_unit_that_does_not_fit_is_refused_in_one_line(replacements, told):
    path = changed(foreign(2), "changed.fmu", replacements)
    text = refusal(path, names=FOREIGN_NAMES)
    assert text.startswith(str(path))
    assert told in text


def test_a_unit_without_a_binary_for_this_machine_is_refused():
    path = renamed(foreign(2), "elsewhere.fmu", "linux64", "win64")
    assert "it has: win64" in refusal(path, names=FOREIGN_NAMES)


def test_a_unit_of_an_older_standard_is_refused(tmp_path):
    path = tmp_path / "old.fmu"
    with zipfile.ZipFile(path, "w") as unit:
        unit.writestr("modelDescription.xml", OLD)
    assert "is of FMI 1.0; accepted: 2.0 and 3.0" in refusal(path)


def test_unknown_names_and_parameters_are_refused():
    text = refusal(foreign(2), names=FOREIGN_NAMES | {"pressure": "p"})
    assert "plant.fmu.names.pressure: accepted: machine_force_n, " in text
    assert "plant.fmu.parameters.mass: it has: moving_mass_kg" in refusal(
        ours("harmonic", 2), parameters={"mass": 1.0}
    )


def test_a_file_that_is_no_unit_is_refused(tmp_path):
    assert "No such file" in refusal(tmp_path / "none.fmu")
    (tmp_path / "text.fmu").write_text("hello")
    assert "not a ZIP file" in refusal(tmp_path / "text.fmu")


def test_another_file_than_that_of_the_run_is_refused():
    assert "is another file" in refusal(ours("harmonic", 2), sha256="0" * 64)


def test_a_unit_that_cannot_begin_settled_says_so_before_the_run():
    tree = {"plant": {"model": f"fmu:{foreign(2)}", "fmu": {"names": FOREIGN_NAMES}}}
    with pytest.raises(ConfigError, match="accepted: --set begins=at-rest"):
        resolve(build(tree, "test"))


def test_a_model_name_with_no_file_is_refused():
    with pytest.raises(ConfigError, match="needs a file"):
        build({"plant": {"model": "fmu:"}}, "test")


def test_a_missing_library_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "fmpy", None)
    with pytest.raises(MissingExtraError, match=r"needs FMPy: .* -m pip install 'fpeg-hil\[fmu\]'"):
        rig(ours("harmonic", 2))


def test_a_missing_compiler_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(ConfigError, match="needs a C compiler"):
        export(tmp_path / "a.fmu", "harmonic", "nu", 2)


def test_the_check_tells_what_fits_and_what_does_not(capsys):
    assert check(ours("harmonic", 3), []) == 0
    assert "begins settled or at rest" in capsys.readouterr().out
    assert check(foreign(3), []) == 1
    names = [f"{our}={its}" for our, its in FOREIGN_NAMES.items()]
    capsys.readouterr()
    assert check(foreign(3), names) == 0
    assert "piston_position  0.001" in capsys.readouterr().out


def remade(path, name, change):
    """A copy of a unit with one member changed: (name of the member, bytes) -> bytes."""
    new = folder() / name
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(new, "w", zipfile.ZIP_DEFLATED) as unit:
        for member in old.namelist():
            unit.writestr(member, change(member, old.read(member)))
    return new


def in_binary(change):
    return lambda name, data: change(data) if name.endswith(".so") else data


def in_description(pattern, replacement):
    def change(name, data):
        return re.sub(pattern, replacement, data) if name == "modelDescription.xml" else data

    return change


BROKEN_UNITS = {
    "text": in_binary(lambda data: b"hello"),
    "nothing": in_binary(lambda data: b""),
    "half": in_binary(lambda data: data[: len(data) // 2]),
    "other-machine": in_binary(lambda data: data[:18] + b"\xb7\0" + data[20:]),
    "other-guid": in_description(rb'guid="[^"]*"', b'guid="{x}"'),
    "no-guid": in_description(rb' guid="[^"]*"', b""),
    "no-such-reference": in_description(rb'valueReference="6"', b'valueReference="7777"'),
    "no-such-input": in_description(rb'valueReference="(1[0-9])"', rb'valueReference="77\1"'),
    "factor-0": in_description(rb'<BaseUnit m="1" ?/>', b'<BaseUnit m="1" factor="0"/>'),
    "factor-inf": in_description(rb'<BaseUnit m="1" ?/>', b'<BaseUnit m="1" factor="INF"/>'),
    "factor-text": in_description(rb'<BaseUnit m="1" ?/>', b'<BaseUnit m="1" factor="a"/>'),
    "no-variables": in_description(rb"(?s)<ScalarVariable.*</ScalarVariable>", b""),
}


@pytest.mark.parametrize("name", BROKEN_UNITS)
def test_the_check_finds_what_cannot_run(name, capsys):
    path = remade(ours("harmonic", 2), f"{name}.fmu", BROKEN_UNITS[name])
    try:
        assert check(path, []) == 1
    except ConfigError as error:
        line = str(error)
    else:
        line = capsys.readouterr().out.splitlines()[-1]
        assert line.startswith("as plant: ")
    assert "stepped once" not in line
    assert str(path) in line


def test_a_damaged_member_of_a_unit_is_told_by_name():
    path = folder() / "damaged.fmu"
    data = bytearray(ours("harmonic", 2).read_bytes())
    data[data.index(b".so") + 3000] ^= 1
    path.write_bytes(data)
    assert str(path) in refusal(path)


# --- dead centres between samples ------------------------------------------------------------


@given(
    bend=st.floats(-0.9, 0.9), v0=st.floats(0.01, 5.0), end=st.floats(0.1, 0.9),
    x0=st.floats(-0.02, 0.02),
)  # fmt: skip
def test_the_turn_of_a_cubic_motion_is_found_exactly(bend, v0, end, x0):
    """x' = (1 - t/(end h)) (v0 + a t): a cubic whose velocity vanishes at end h."""
    h = 1e-3
    turn, a = end * h, bend * v0 / h

    def v(t):
        return (1.0 - t / turn) * (v0 + a * t)

    def x(t):
        return x0 + v0 * t + (a - v0 / turn) * t**2 / 2.0 - a / turn * t**3 / 3.0

    found = turning_point(x0, v0, x(h), v(h), h)
    assert found is not None
    assert found[0] == pytest.approx(turn, abs=1e-9)
    assert found[1] == pytest.approx(x(turn), abs=1e-12)


def test_a_velocity_that_keeps_its_sign_has_no_turn():
    assert turning_point(0.0, 1.0, 1e-3, 1.0, 1e-3) is None
    assert turning_point(0.0, 0.0, 0.0, 0.0, 1e-3) is None
