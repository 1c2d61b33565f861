"""The control-engineering view of the linear engine."""

import math
import sys

import numpy as np
import pytest
from typer.testing import CliRunner

from bench.cli.engine import app
from hil.config.prototypes import NU
from hil.errors import ConfigError, MissingExtraError
from plant.engines.fast.constants import constants_of
from plant.engines.fast.state_space import (
    LinearModel,
    as_control_system,
    critical_load_n_s_m,
    damping_ratio,
    discrete,
    frequency_response,
    linear_model,
    natural_frequency_rad_s,
    poles,
    root_locus,
    stable,
    state_space,
    step_response,
    transfer_function,
)

ENGINE = constants_of(NU, "harmonic")
RUNNING = linear_model(ENGINE, 2.8185e-6, 810.0)


def test_damping_ratio_running_and_after_a_misfire():
    assert damping_ratio(RUNNING) == pytest.approx(0.46, abs=0.005)
    assert damping_ratio(linear_model(ENGINE, 0.0, 810.0)) == pytest.approx(0.94, abs=0.005)


def test_natural_frequency_is_the_published_one():
    assert natural_frequency_rad_s(RUNNING) / (2 * math.pi) == pytest.approx(19.94, rel=1e-3)


@pytest.mark.parametrize("damping", [0.0, 810.0, 2000.0])
def test_poles_are_the_eigenvalues_of_a(damping):
    model = LinearModel(7.0, damping, 110_000.0)
    expected = np.sort_complex(np.linalg.eigvals(state_space(model).a))
    assert np.sort_complex(poles(model)) == pytest.approx(expected)


def test_poles_are_the_roots_of_the_denominator():
    assert np.sort_complex(np.roots(transfer_function(RUNNING)[1])) == pytest.approx(
        np.sort_complex(poles(RUNNING))
    )


@pytest.mark.parametrize(("damping", "verdict"), [(810.0, True), (2000.0, True), (0.0, False)])
def test_stability_asks_for_positive_damping_only(damping, verdict):
    model = LinearModel(7.0, damping, 110_000.0)
    assert stable(model) is verdict
    assert bool(np.all(poles(model).real < 0.0)) is verdict


@pytest.mark.parametrize("damping", [0.0, 810.0, 1754.9928774784245, 3000.0])
def test_zero_order_hold_is_the_matrix_exponential(damping):
    model = LinearModel(7.0, damping, 110_000.0)
    space, dt = state_space(model), 1e-3
    block = np.block([[space.a, space.b], [np.zeros((1, 3))]]) * dt
    term = total = np.eye(3)
    for n in range(1, 30):
        term = term @ block / n
        total = total + term
    held = discrete(model, dt)
    assert held.a == pytest.approx(total[:2, :2], rel=1e-9, abs=1e-12)
    assert held.b == pytest.approx(total[:2, 2:], rel=1e-7, abs=1e-15)


@pytest.mark.parametrize(("instant", "error_um", "within"), [(0.0, 97.0, 3.0), (0.5, 0.1, 0.1)])
def test_sampling_the_sine_costs_what_is_known(instant, error_um, within):
    """A held sine at 1e-4 s: early by half a step when sampled at the step's start."""
    dt, omega = 1e-4, natural_frequency_rad_s(RUNNING)
    held = discrete(RUNNING, dt)
    f0 = 0.0155 * 810.0 * omega
    state, worst = np.array([[-0.0155], [0.0]]), 0.0
    for step in range(3000):
        force = f0 * math.sin(omega * (step + instant) * dt)
        state = held.a @ state + held.b * force
        exact = -0.0155 * math.cos(omega * (step + 1) * dt)
        worst = max(worst, abs(float(state[0, 0]) - exact)) if step > 1000 else 0.0
    assert worst * 1e6 == pytest.approx(error_um, abs=within)


def test_control_system_has_the_same_poles_and_gain():
    pytest.importorskip("control")
    system = as_control_system(RUNNING)
    assert np.sort_complex(system.poles()) == pytest.approx(np.sort_complex(poles(RUNNING)))
    assert float(system.dcgain()) == pytest.approx(1.0 / RUNNING.stiffness_n_m)
    assert as_control_system(RUNNING, 1e-3).dt == 1e-3


def test_responses_are_those_of_the_control_library():
    library = pytest.importorskip("control")
    system = as_control_system(RUNNING)
    omega, t = np.geomspace(1.0, 1e3, 30), np.linspace(0.0, 0.2, 40)
    expected = np.squeeze(library.frequency_response(system, omega).frdata)
    assert frequency_response(RUNNING, omega) == pytest.approx(expected, rel=1e-9)
    assert step_response(RUNNING, t) == pytest.approx(
        library.step_response(system, t).outputs, abs=1e-11
    )


def test_root_locus_meets_the_axis_at_the_critical_load():
    """And leaves the left half plane nowhere above no load: eq. 5.76 is no limit of stability."""
    critical = critical_load_n_s_m(RUNNING)
    locus = root_locus(RUNNING, np.array([0.0, 0.99 * critical, 1.01 * critical]))
    assert locus[:, 0].real == pytest.approx([0.0, 0.0], abs=1e-9)
    assert abs(locus[0, 1].imag) > 0.0
    assert locus[:, 2].imag == pytest.approx([0.0, 0.0], abs=1e-9)
    assert np.all(locus[:, 1:].real < 0.0)


def test_analysis_tells_both_engines_and_draws_them(tmp_path):
    page = tmp_path / "page.html"
    done = CliRunner().invoke(app, ["analyse", "--out", str(page)])
    assert done.exit_code == 0, done.output
    assert [line.split()[-1] for line in done.output.splitlines() if "damping ratio" in line] == [
        "0.4617",
        "0.9402",
    ]
    assert page.read_text().count("data-plot=") == 4
    assert CliRunner().invoke(app, ["analyse", "--engine", "opposed"]).exit_code != 0


def test_missing_control_library_is_told_in_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'fpeg-hil\[desk\]'"):
        as_control_system(RUNNING)


@pytest.mark.parametrize("dt", [0.0, -1.0, math.nan])
def test_period_must_be_positive(dt):
    with pytest.raises(ConfigError, match="sample period"):
        discrete(RUNNING, dt)
