"""The linear machine: load circuit, starting force, and its kinds side by side (section 3.2.4)."""

from __future__ import annotations

import numpy as np

from bench.studies.atlas.entry import Entry, Finding, Found
from bench.studies.engine.operation import operate, started, varied
from bench.web.chart import Chart, series, thinned
from hil.config.detailed import Calibration, read
from hil.config.detailed.machine import Circuit, Dq, Flux
from plant.engines.detailed import layout as at
from plant.engines.detailed.engine import engine_of, running
from plant.engines.detailed.machine import machine_force

_TWO, _START = "nu-two-stroke", "bit-starting"


def machine(_quick: bool) -> Found:
    """The load circuit without inductance and capacitor (eq. 3.55), and the starting force."""
    engine = engine_of(read(_TWO))
    motion = running(engine)
    y, d = motion.y.copy(), motion.d.copy()
    v = np.linspace(-3.0, 3.0, 61)
    force = []
    for speed in v:
        y[at.V] = speed
        force.append(float(machine_force(engine.p, d, y, np.zeros(at.N_Y), 0.0)))
    moving = np.abs(v) > 1e-9
    slope = np.array(force)[moving] / v[moving]
    straight = float(np.ptp(slope))
    findings = {"E3.55-load-circuit": Finding(
        straight < 1e-9, f"{-slope[-1]:.0f} N/(m/s) at every speed"
    ), "A1-motor-force": _starting_force()}  # fmt: skip
    return Found(findings, (Chart("Machine force", "speed [m/s]", "force [N]",
                                  (series("generating", v, force),)),))  # fmt: skip


def _starting_force() -> Finding:
    """Work of the machine over the path is the ordered force, whichever way the piston goes."""
    rows = started(read(_START), 110.0)
    path = float(np.sum(np.abs(np.diff(rows[:, at.REC_X]))))
    work = float(rows[-1, at.REC_SUMS + at.W_MOTORED] - rows[0, at.REC_SUMS + at.W_MOTORED])
    mean = work / path
    return Finding(abs(mean / 110.0 - 1.0) < 0.02, f"{mean:.1f} N in the mean of 110 N")


def kinds() -> dict[str, Calibration]:
    """One engine with each kind of machine, all of one load coefficient and quick windings."""
    c = read(_TWO)
    flux = Flux(air_gap_m=1e-3, turns=300, coil_length_m=0.25, mmf_a=600.0, magnet_m=0.6,
                pole_pitch_m=0.9, resistance_ohm=1.0, inductance_h=5e-4)  # fmt: skip
    k = flux.circuit.thrust_n_a
    dq = Dq(thrust_n_a=k, resistance_ohm=1.0, inductance_h=5e-4, pole_pitch_m=0.03,
            regulator_s=1e-4, supply_v=1e4)  # fmt: skip
    circuit = Circuit(thrust_n_a=k, emf_v_s_m=k, resistance_ohm=1.0, inductance_h=5e-4)
    return {
        "load constant": c,
        "circuit": varied(c, machine={"circuit": circuit}),
        "coil and magnets": varied(c, machine={"flux": flux}),
        "dq": varied(c, machine={"dq": dq}),
    }


def side_by_side(_quick: bool) -> Found:
    """Force and motion of one engine with each kind of machine: they agree where they must."""
    found = {name: operate(c) for name, c in kinds().items()}
    motion = tuple(thinned(series(name, 1e3 * o.trace.x_m, o.trace.v_m_s))
                   for name, o in found.items())  # fmt: skip
    rows = list(found.values())
    order = range(1, len(rows) + 1)
    powers = (
        series("electric", order, [o.figures.electric_w for o in rows], "both"),
        series("winding", order, [o.figures.copper_w for o in rows], "both"),
    )
    which = ", ".join(f"{n} {name}" for n, name in zip(order, found, strict=True))
    return Found({}, (
        Chart("Velocity over displacement", "x [mm]", "velocity [m/s]", motion),
        Chart("Electric power and heat of the winding", which, "power [W]", powers),
    ))  # fmt: skip


ENTRIES = (
    Entry("E3.54", "Kinds of machine on one engine", (), side_by_side),
    Entry("E3.55", "Load circuit", ("E3.55-*", "A1-motor-force"), machine),
)
