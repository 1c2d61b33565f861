"""Gas, heat and flow of the detailed engines against their equations."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.config.detailed import read
from hil.config.prototypes import ENGINES
from hil.errors import ConfigError
from plant.engines.detailed import layout as at
from plant.engines.detailed.engine import at_rest, begin, engine_of, run_for, running, strokes
from plant.engines.detailed.gas import flow, heat_release, heat_to_wall
from plant.engines.detailed.kernel import case_pressure, pressure, rates
from plant.engines.detailed.solver import scratch
from plant.engines.detailed.steps import linearise, rosenbrock, valve_rate

ENGINE = engine_of(read("nu-two-stroke"))
P = ENGINE.p
GAMMA = P[at.GAMMA]


def orifice(cda, p_up, t_up, p_down):
    """Eq. 3.15 with the root over the whole bracket."""
    r = p_down / p_up
    scale = cda * p_up / math.sqrt(P[at.R_GAS] * t_up)
    if r <= (2 / (GAMMA + 1)) ** (GAMMA / (GAMMA - 1)):
        choked = (2 / (GAMMA + 1)) ** ((GAMMA + 1) / (2 * (GAMMA - 1)))
        return scale * math.sqrt(GAMMA) * choked
    bracket = 2 * GAMMA / (GAMMA - 1) * (1 - r ** ((GAMMA - 1) / GAMMA))
    return scale * r ** (1 / GAMMA) * math.sqrt(bracket)


@settings(deadline=None)  # the first call compiles
@given(ratio=st.floats(0.01, 0.989), p_up=st.floats(5e4, 1e7), t_up=st.floats(250, 3000))
def test_flow_is_that_of_a_nozzle(ratio, p_up, t_up):
    expected = orifice(1e-4, p_up, t_up, ratio * p_up)
    assert flow(P, 1e-4, p_up, t_up, ratio * p_up) == pytest.approx(expected, rel=1e-10)


def test_small_flow_joins_the_nozzle_with_value_and_slope():
    z, eps = P[at.SMALL], 1e-7
    at_z = [flow(P, 1e-4, 1e5, 300.0, 1e5 * (1 - z + k * eps)) for k in (-2, -1, 1, 2)]
    assert at_z[1] == pytest.approx(at_z[2], rel=1e-4)
    assert at_z[0] - at_z[1] == pytest.approx(at_z[2] - at_z[3], rel=1e-3)
    assert flow(P, 1e-4, 1e5, 300.0, 1e5) == 0.0


def test_flow_chokes_at_the_critical_ratio():
    critical = P[at.CRITICAL]
    below = flow(P, 1e-4, 1e6, 400.0, 0.2e6)
    assert flow(P, 1e-4, 1e6, 400.0, critical * 1e6) == pytest.approx(below, rel=1e-12)


def test_heat_release_sums_to_the_charge():
    t = np.linspace(0.0, P[at.BURNT_S], 20_001)
    rate = [heat_release(P, 185.9, float(x)) for x in t]
    assert np.trapezoid(rate, t) == pytest.approx(185.9, rel=1e-7)
    burnt = np.trapezoid([heat_release(P, 1.0, x) for x in t[t <= 5e-3]], t[t <= 5e-3])
    assert burnt == pytest.approx(1.0 - math.exp(-5.0), rel=1e-3)


def test_heat_to_the_wall_is_hohenbergs():
    v_p, gap, p_gas, t_gas = 2.0, 0.005, 30e5, 1500.0
    area, bore = math.pi * 0.05**2 / 4, 0.05
    h = 130 * (area * gap) ** -0.06 * 30**0.8 * t_gas**-0.4 * (v_p + 1.4) ** 0.8
    h *= read("nu-two-stroke").heat.hohenberg
    expected = h * (2 * area + math.pi * bore * gap) * (t_gas - 420.0)
    heat = P[at.HOHENBERG] * (v_p + 1.4) ** 0.8
    found = heat_to_wall(P, 0, heat, area * gap, gap, p_gas, t_gas)
    assert found == pytest.approx(expected, rel=1e-12)


def test_closed_cylinder_without_losses_is_an_isentrope():
    c = read("bit-starting")
    side = c.left.model_copy(update={"leak_m2": 0.0, "walls": 0.0})
    far = {"exhaust_opens_m": None, "exhaust_closes_m": None, "intake_opens_m": None,
           "intake_closes_m": None}  # fmt: skip
    c = c.model_copy(update={"left": side, "right": side, "pump": None,
                             "cycle": c.cycle.model_copy(update=far)})  # fmt: skip
    engine = engine_of(c)
    motion = at_rest(engine)
    begin(engine, motion, 1)
    run_for(engine, motion, 0.4)
    gap = 0.035 + motion.y[at.X]
    area = math.pi * 0.0525**2 / 4
    p_gas = (c.gas.gamma - 1) * motion.y[at.U] / (area * gap)
    assert p_gas == pytest.approx(1e5 * (0.035 / gap) ** c.gas.gamma, rel=1e-7)
    assert len(strokes(motion)) > 3


def test_rings_leak_to_the_scavenge_pressure():
    """Appendix I eq. 15: with a pump, nothing passes the rings at the pressure beneath them."""
    engine = engine_of(read("bit-starting"))
    motion = at_rest(engine)
    out = np.zeros(at.N_Y)
    y = motion.y
    y[at.CASE_U] *= 1.3
    y[at.CASE_M] *= 1.3
    level = case_pressure(engine.p, y, 0) / pressure(engine.p, y, 0)
    flows = []
    for ratio in (level, 2.0 * level, 0.5 * level):
        there = y.copy()
        there[at.U] *= ratio
        there[at.M] *= ratio
        rates(engine.p, motion.d, there, out, 0.0)
        flows.append((out[at.SUM + at.M_LEAK], out[at.CASE_M]))
    assert flows[0][0] == pytest.approx(0.0, abs=1e-12)
    assert flows[1][0] > 0.0 > flows[2][0]
    assert [case for _, case in flows[1:]] == [leak for leak, _ in flows[1:]]


@pytest.mark.parametrize("path", sorted(ENGINES.glob("*/*.toml")), ids=lambda p: p.parent.name)
def test_each_figure_has_a_reason(path):
    for line in path.read_text().splitlines():
        if "=" in line.split("#")[0] and not line.startswith(("name", "title")):
            assert "#" in line, line


def test_unknown_engine_is_refused_by_name():
    with pytest.raises(ConfigError, match=r"'v8': accepted are bit-running"):
        read("v8")


def test_implicit_step_is_of_third_order_and_follows_a_stiff_valve():
    """Halving the step with open valves divides the error by eight; long steps stay stable."""
    engine = engine_of(read("nu-four-stroke"))
    motion = running(engine)
    run_for(engine, motion, 0.05)  # intake of one cylinder, exhaust of the other
    work = scratch()
    ends = {}
    for steps in (1, 4, 8, 256):
        y, t, h = motion.y.copy(), motion.d[at.T], 4e-4 / steps
        for n in range(steps):
            rates(engine.p, motion.d, y, work[0], t)
            linearise(engine.p, motion.d, y, work, 0)
            linearise(engine.p, motion.d, y, work, 1)
            rosenbrock(engine.p, motion.d, y, work, t + n * h, h)
            y = work[5].copy()
        ends[steps] = y
    assert valve_rate(engine.p, motion.d, motion.y) * 4e-4 > 10.0
    errors = [np.abs(ends[n][: at.CASE_U] / ends[256][: at.CASE_U] - 1.0).max() for n in (1, 4, 8)]
    assert errors[0] < 1e-3
    assert errors[1] / errors[2] > 5.0


def test_vectors_of_the_jacobian_keep_mass_and_energy():
    engine = engine_of(read("nu-four-stroke"))
    motion = running(engine)
    run_for(engine, motion, 0.05)
    work = scratch()
    linearise(engine.p, motion.d, motion.y, work, 0)
    g, s = work[12], at.SUM
    assert g[at.U] != 0.0
    assert g[at.U] == pytest.approx(g[s + at.H_IN] - g[s + at.H_EX], rel=1e-14)
    assert g[at.M] == pytest.approx(g[s + at.M_IN] - g[s + at.M_EX], rel=1e-14)
