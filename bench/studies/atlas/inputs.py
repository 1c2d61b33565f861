"""Where the printed settings stand in ours: a value in SI by fact, as the configuration has it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from bench.run import scenarios
from bench.studies.atlas.entries.beijing import GENERATOR
from bench.studies.atlas.entries.starting import CYCLES, READY_BAR
from bench.studies.atlas.entry import Finding
from bench.studies.atlas.facts import Fact, in_unit
from bench.studies.engine.operation import PART_LOADS
from bench.studies.engine.sweep import DEGREES, STARTING_FORCES_N
from hil.config.detailed import read
from hil.config.prototypes import PROTOTYPES

Read = Callable[[], float]


def finding(fact: Fact) -> Finding | None:
    """Return ours for a printed setting; None for one that no configuration of ours has."""
    source = INPUTS.get(fact.id)
    if source is None:
        return None
    return Finding(in_unit(fact, source()), TOLD.get(fact.id, ""))


def _of(engine: str, key: str) -> Read:
    """A figure of an engine, as `nu moving_mass_kg`."""
    return lambda: float(getattr(PROTOTYPES[engine], key))


def _in(calibration: str, path: str, factor: float = 1.0) -> Read:
    """A figure of an engine in full, as `nu-two-stroke heat.burn_s`."""

    def get() -> float:
        found: Any = read(calibration)
        for name in path.split("."):
            found = getattr(found, name)
        return factor * float(found)

    return get


def _set(scenario: str, path: str, less: float = 0.0) -> Read:
    """A value of a scenario, as `load-decrease events.load.value`; a step is told less 1."""

    def get() -> float:
        tree: Any = scenarios.tree_of(scenario)
        for name in path.split("."):
            tree = tree[name]
        return float(tree) - less

    return get


def _is(value: float) -> Read:
    return lambda: value


def _area(engine: str) -> float:
    return PROTOTYPES[engine].area_m2


def _wiebe(calibration: str, prefix: str) -> dict[str, Read]:
    return {
        f"{prefix}-a": _in(calibration, "heat.wiebe_a"),
        f"{prefix}-b": _in(calibration, "heat.wiebe_b"),
        f"{prefix}-duration": _in(calibration, "heat.burn_s"),
    }


_TWO, _FOUR, _DRIVE, _RUN, _START = (
    "nu-two-stroke", "nu-four-stroke", "nu-motoring", "bit-running", "bit-starting",
)  # fmt: skip

_NEWCASTLE: dict[str, Read] = {
    "S3.2.2-rings": _is(2.0),
    "S3.2.2-p0": _in(_TWO, "friction.p_reference_pa"),
    "S3.2.2-d0": _in(_TWO, "friction.bore_reference_m"),
    **_wiebe(_TWO, "E3.19"),
    "T3.2-mass": _of("nu", "moving_mass_kg"),
    "T3.2-bore": _of("nu", "bore_m"),
    "T3.2-stroke": lambda: 2.0 * PROTOTYPES["nu"].half_stroke_m,
    "T3.2-valve-lift": _in(_TWO, "breathing.lift_m"),
    "T3.2-intake-diameter": _in(_TWO, "breathing.intake_diameter_m"),
    "T3.2-exhaust-diameter": _in(_TWO, "breathing.exhaust_diameter_m"),
    "T3.2-intake-pressure": _in(_TWO, "breathing.intake_pa"),
    "T3.2-exhaust-pressure": _in(_TWO, "breathing.exhaust_pa"),
    "T3.2-ignition": _in(_TWO, "cycle.ignition_from_head_m"),
    "T3.2-load": _in(_TWO, "machine.load_coefficient_n_s_m"),
    "S3.3.3-compression-stroke-two": _in(_TWO, "cycle.exhaust_closes_m"),
    "T3.3-ivo": _in(_TWO, "cycle.intake_opens_m"),
    "T3.3-ivc": _in(_TWO, "cycle.intake_closes_m"),
    "T3.3-evo": _in(_TWO, "cycle.exhaust_opens_m"),
    "T3.3-evc": _in(_TWO, "cycle.exhaust_closes_m"),
    "S3.3.3-compression-stroke-four": lambda: 2.0 * read(_FOUR).left.length_m,
    "S3.3.3-volume-four": lambda: 2.0 * read(_FOUR).left.length_m * _area("nu"),
    "S3.3.3-volume-two": lambda: (read(_TWO).cycle.exhaust_closes_m or 0.0) * _area("nu"),
    "S4.1.1-valve-lift": _in(_TWO, "breathing.lift_m"),
    "E4.2-two-stroke-compensation": _in(_TWO, "cycle.motor_1_n"),
    "T4.1-target-1": _in(_DRIVE, "cycle.turn_at_m"),
    "T4.1-target-2": _in(_DRIVE, "cycle.turn_at_m", -1.0),
    "T4.1-speed": _in(_DRIVE, "cycle.speed_m_s"),
    "T4.1-acceleration": _in(_DRIVE, "cycle.acceleration_m_s2"),
    "T4.1-deceleration": _in(_DRIVE, "cycle.acceleration_m_s2"),
    "F4.6-position-1": _in(_DRIVE, "cycle.turn_at_m"),
    "F4.6-position-2": _in(_DRIVE, "cycle.turn_at_m", -1.0),
    "F4.6-speed": _in(_DRIVE, "cycle.speed_m_s"),
    "F4.6-acceleration": _in(_DRIVE, "cycle.acceleration_m_s2"),
    "F4.6-deceleration": _in(_DRIVE, "cycle.acceleration_m_s2"),
    "F4.8-evc": _in(_DRIVE, "cycle.exhaust_closes_m"),
    **{f"F4.17-timing-{n}": _is(degrees) for n, degrees in enumerate(DEGREES, 1)},
}

_FAST: dict[str, Read] = {
    "E5.37-expansion-point": _is(0.0),
    "E5.26-throttle-low": _is(0.0),
    "E5.26-throttle-high": _is(1.0),
    "T5.2-bore": _of("bit", "bore_m"),
    "T5.2-stroke": lambda: 2.0 * PROTOTYPES["bit"].half_stroke_m,
    "T5.2-compression-stroke": _of("bit", "half_stroke_m"),
    "T5.2-mass": _of("bit", "moving_mass_kg"),
    "F5.8-step": _set("load-decrease", "events.load.value", 1.0),
    "F5.10-efficiency-low": _set("variations", "events.efficiency.low"),
    "F5.10-efficiency-high": _set("variations", "events.efficiency.high"),
    "F5.12-step": _set("load-decrease-variations", "events.load.value", 1.0),
    "F5.12-efficiency-low": _set("load-decrease-variations", "events.efficiency.low"),
    "F5.12-efficiency-high": _set("load-decrease-variations", "events.efficiency.high"),
    "F6.2-stroke-low": lambda: -PROTOTYPES["nu"].half_stroke_m,
    "F6.2-stroke-high": _of("nu", "half_stroke_m"),
    "S6.2.1-stroke": lambda: 2.0 * PROTOTYPES["nu"].half_stroke_m,
    "S6.2.3-target": _of("nu", "tdc_ref_m"),
    "S6.2.3-target-gap": lambda: PROTOTYPES["nu"].half_stroke_m - PROTOTYPES["nu"].tdc_ref_m,
    "F6.7-step": _set("load-decrease", "events.load.value", 1.0),
    "F6.7-time": _set("load-decrease", "events.load.at_s"),
    "F6.9-step": _set("load-increase", "events.load.value", 1.0),
    "F6.9-time": _set("load-increase", "events.load.at_s"),
}

_BEIJING: dict[str, Read] = {
    "A1-T1-bore": _of("bit", "bore_m"),
    "A1-T1-stroke": lambda: 2.0 * PROTOTYPES["bit"].half_stroke_m,
    "A1-T1-effective-stroke": _in(_RUN, "cycle.exhaust_closes_m"),
    "A1-T1-mass": _of("bit", "moving_mass_kg"),
    "A1-T1-thrust": _in(_START, "machine.dq.thrust_n_a"),
    "A1-T1-back-emf": _in(_START, "machine.dq.thrust_n_a", math.sqrt(3.0) / 1.5),
    "A1-T1-coil": _in(_START, "machine.dq.resistance_ohm", 2.0),
    **_wiebe(_RUN, "A1-wiebe"),
    "A1-friction-d0": _in(_RUN, "friction.bore_reference_m"),
    "A1-friction-p0": _in(_RUN, "friction.p_reference_pa"),
    "A1-F6-force": _of("bit", "start_force_n"),
    "A1-F8-cycles": _is(float(CYCLES)),
    "A1-F10-target": _is(1e5 * READY_BAR),
    "A1-S4.3-generator-efficiency": _is(GENERATOR),
    "A1-F10-force-low": _is(STARTING_FORCES_N[0]),
    "A1-F10-force-high": _is(STARTING_FORCES_N[-1]),
    "A1-F10-force-step": _is(STARTING_FORCES_N[1] - STARTING_FORCES_N[0]),
    "A1-F11-load-low": _is(PART_LOADS[0]),
    "A1-F11-load-high": _is(PART_LOADS[-1]),
    "A1-F11-load-step": _is(PART_LOADS[1] - PART_LOADS[0]),
    "A1-F11-ignition": lambda: read(_RUN).left.length_m - read(_RUN).cycle.ignition_from_head_m,
    "A2-T2-stroke": lambda: 2.0 * PROTOTYPES["bit"].half_stroke_m,
    "A2-T2-compression-stroke": _of("bit", "half_stroke_m"),
    "A2-T2-mass": _of("bit", "moving_mass_kg"),
    "A2-T2-load": _of("bit", "load_coefficient_n_s_m"),
    "A2-T2-bore": _of("bit", "bore_m"),
}

_LITERATURE: dict[str, Read] = {
    "T2.4-bore": _in("wvu", "left.bore_m"),
    "T2.4-max-stroke": _in("wvu", "left.length_m", 2.0),
    "T2.4-intake-pressure": _in("wvu", "breathing.intake_pa"),
    "T2.4-intake-temperature": _in("wvu", "breathing.intake_k"),
    "T2.5-bore": _in("bounce-chamber", "left.bore_m"),
    "T2.5-mass": _in("bounce-chamber", "mover.mass_kg"),
    "T2.5-bounce-bore": _in("bounce-chamber", "right.bore_m"),
    "T2.5-back-pressure": _in("bounce-chamber", "breathing.exhaust_pa"),
    "T2.6-cylinder-length": _in("opposed", "left.length_m", 2.0),
    "T2.6-bore": _in("opposed", "left.bore_m"),
    "T2.6-mass": _in("opposed", "mover.mass_kg", 0.5),
    "T2.6-intake-temperature": _in("opposed", "breathing.intake_k"),
    "T2.6-intake-pressure": _in("opposed", "breathing.intake_pa"),
    "T2.6-exhaust-pressure": _in("opposed", "breathing.exhaust_pa"),
    "T2.7-peak-force": _in("fpec", "machine.peak_force_n"),
    "T2.7-bore": _in("fpec", "left.bore_m"),
    "T2.7-mass": _in("fpec", "mover.mass_kg"),
    "T2.9-bore": _in("gas-spring", "left.bore_m"),
    "T2.9-mass": _in("gas-spring", "mover.mass_kg"),
    "T2.11-piston-diameter": _in("wvu", "left.bore_m"),
    "T2.13-air-gap": _in("ulsan", "machine.flux.air_gap_m"),
    "T2.13-bore": _in("ulsan", "left.bore_m"),
    "T2.13-stroke": _in("ulsan", "left.length_m", 2.0),
    "T2.13-mass": _in("ulsan", "mover.mass_kg"),
}

INPUTS: dict[str, Read] = {**_LITERATURE, **_NEWCASTLE, **_FAST, **_BEIJING}

TOLD = {
    "T2.6-mass": "of one piston: two move as one",
    "S3.2.2-rings": "the ring law of a calibration stands for a piston's whole set",
    "A1-T1-back-emf": "from line to line: sqrt(3) of the phase's, which follows from the thrust",
    "A1-T1-coil": "from line to line: two phases",
}
