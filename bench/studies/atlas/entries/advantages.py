"""What parts the two cycles: machine forces, advantages, fuel (thesis sections 4.2 and 4.4)."""

from __future__ import annotations

import numpy as np

from bench.studies.atlas.entries.cycles import both
from bench.studies.atlas.entry import Entry, Finding, Found
from bench.studies.atlas.facts import printed
from bench.studies.engine.operation import BAR, operate, varied
from hil.config.detailed import Calibration, read
from plant.engines.detailed import layout as at
from plant.engines.detailed.engine import engine_of, run_for, running


def table_4_2(_quick: bool) -> Found:
    """The four-stroke engine with Table 4.2's own forces, and without any braking."""
    c = read("nu-four-stroke")
    own = varied(c, cycle={
        **{f"motor_{n}_n": printed(f"T4.2-motor-{n}") for n in range(1, 5)},
        "switch_1_m": 0.010, "switch_4_m": -0.010,
    })  # fmt: skip
    with_own = operate(own).figures
    plain = varied(c, cycle={"motor_2_n": c.cycle.motor_1_n, "switch_4_m": -0.0199,
                             "motor_4_n": 0.0})  # fmt: skip
    rows = operate(c).engine.programme
    generates = [at.GENERATE in rows[n, :, 1] for n in range(4)]
    ours = operate(c).figures
    told = (f"with the forces of Table 4.2 themselves the peak is {with_own.p_max_pa / BAR:.0f} bar"
            f" and the compression ratio {with_own.compression_ratio:.1f}, not"
            f" {ours.p_max_pa / BAR:.0f} and {ours.compression_ratio:.1f}")  # fmt: skip
    findings = {f"T4.2-motor-{n}": Finding(getattr(c.cycle, f"motor_{n}_n"), told)
                for n in range(1, 5)}  # fmt: skip
    findings["T4.2-generator-3"] = Finding(generates[2])
    findings["T4.2-generator-4"] = Finding(generates[3])
    findings["S4.2.2-head-contact"] = Finding(_strikes(plain), "with motor 1 through stroke 1")
    return Found(findings)


def _strikes(c: Calibration) -> bool:
    """Whether the piston meets a head within the first second."""
    engine = engine_of(c)
    motion = running(engine)
    while motion.d[at.T] < 1.0 and motion.d[at.CONTACTS] == 0.0:
        run_for(engine, motion, 0.01)
    return bool(motion.d[at.CONTACTS] > 0.0)


def advantages(_quick: bool) -> Found:
    """Table 4.4: the advantages of either cycle."""
    two, four = both()
    f2, f4 = two.figures, four.figures
    shake = [float(np.max(np.abs(np.gradient(o.trace.v_m_s, o.trace.t_s)))) for o in (two, four)]
    orders = len(np.flatnonzero(np.isin(four.engine.programme[:, :, 1], (at.MOTOR, at.GENERATE))))
    power = Finding(f2.electric_w > f4.electric_w, f"{f2.electric_w:.0f} and {f4.electric_w:.0f} W")
    vibration = Finding(
        shake[0] < shake[1],
        f"by the peak acceleration of the mover, {shake[0]:.0f} and {shake[1]:.0f} m/s²",
    )
    return Found({
        "T4.4-two-power": power,
        "T4.4-four-power": power,
        "T4.4-two-speed": Finding(
            f2.speed_rpm > f4.speed_rpm, f"{f2.speed_rpm:.0f} and {f4.speed_rpm:.0f} rpm"
        ),
        "T4.4-two-self": Finding(f2.motoring_w == 0.0, "the machine motors with 0 W"),
        "T4.4-four-efficiency": Finding(
            f4.efficiency > f2.efficiency, f"{f4.efficiency:.1%} and {f2.efficiency:.1%}"
        ),
        "T4.4-four-fuel": Finding(
            f4.fuel_kg_kwh < f2.fuel_kg_kwh,
            f"{f4.fuel_kg_kwh:.3f} and {f2.fuel_kg_kwh:.3f} kg/(kW h)",
        ),
        "T4.4-four-cr": Finding(
            f4.compression_ratio > f2.compression_ratio,
            f"{f4.compression_ratio:.1f} and {f2.compression_ratio:.1f}",
        ),
        "T4.4-four-drive": Finding(f4.motoring_w > 0.0, f"{f4.motoring_w:.0f} W"),
        "T4.4-four-control": Finding(orders > 0, f"{orders} orders to the machine a cycle, not 1"),
        "T4.4-two-vibration": vibration,
        "T4.4-four-vibration": vibration,
        "S3.4-balance": Finding(
            f2.motoring_w == 0.0 and f4.motoring_w > 0.0,
            f"the machine motors with {f2.motoring_w:.0f} and {f4.motoring_w:.0f} W",
        ),
    })  # fmt: skip


def charges(_quick: bool) -> Found:
    """Fuel of a charge in both cycles, and what the same fuel does (section 4.2.1)."""
    two, four = both()
    q2, q4 = (o.engine.energy_j for o in (two, four))
    same = operate(varied(four.engine.calibration, heat={"energy_j": q2})).figures
    f2 = two.figures
    return Found({
        "S4.2.1-fuel-higher": Finding(q4 > q2, f"{q4:.1f} and {q2:.1f} J a charge"),
        "S4.2.1-cr-same-fuel": Finding(
            same.tdc_m > f2.tdc_m and same.compression_ratio > f2.compression_ratio,
            f"with {q2:.1f} J {1e3 * same.tdc_m:.2f} mm and {same.compression_ratio:.1f}, against "
            f"{1e3 * f2.tdc_m:.2f} mm and {f2.compression_ratio:.1f}",
        ),
    })  # fmt: skip


ENTRIES = (
    Entry("T4.2", "Machine forces of the four-stroke cycle",
          ("T4.2-*", "S4.2.2-head-contact"), table_4_2),
    Entry("T4.4", "Advantages of both cycles",
          ("T4.4-two-[pv]*", "T4.4-two-speed", "T4.4-two-self", "T4.4-four-[epfcdv]*",
           "S3.4-balance"), advantages),
    Entry("S4.2.1", "Fuel of both cycles", ("S4.2.1-fuel-higher", "S4.2.1-cr-same-fuel"), charges),
)  # fmt: skip
