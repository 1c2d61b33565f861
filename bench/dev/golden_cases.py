"""What the golden runs are: scenarios of the project, cut short, one declaration each.

Their bits hold on every machine: plain float arithmetic and the C library's mathematics, no
compiled engine. Those that depend on the machine's compiler are in bench/dev/reference.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce
from typing import Any, Final, NamedTuple

from bench.run import scenarios
from bench.run.resolve import resolve
from hil.config.load import build, with_override
from hil.config.resolved import Resolved

Changes = tuple[tuple[str, Any], ...]

LOCKSTEP: Final[Changes] = (("link.kind", "memory"), ("loop.clock", "lockstep"))


class Order(NamedTuple):
    """A command that comes over the command key while the engine runs."""

    at_s: float
    command: Mapping[str, object]


class Case(NamedTuple):
    """One golden run.

    changes: keys of the scenario with their values; a whole event may be added too
    """

    name: str
    scenario: str
    changes: Changes
    orders: tuple[Order, ...] = ()


def scenario_for(case: Case, changes: Changes = LOCKSTEP) -> Resolved:
    """Return the whole configuration of a golden run."""
    tree = scenarios.tree_of(case.scenario)
    given = reduce(lambda t, change: with_override(t, *change), (*case.changes, *changes), tree)
    return resolve(build(given, f"golden run {case.name}"))


def _short(duration_s: float, *changes: tuple[str, Any]) -> Changes:
    return (*changes, ("run.duration_s", duration_s))


def _load_step(*changes: tuple[str, Any], duration_s: float = 0.3) -> Changes:
    return _short(duration_s, ("events.load.at_s", 0.12), *changes)


_MODELS: Final = ("harmonic", "rectangular", "nonlinear", "closed-form")
_LAWS: Final = ("open-loop", "pdf", "predictive", "observer", "machine")
_MODEL_BASED: Final = _LAWS[1:]

_SENSOR_FAULTS: Final = tuple(
    Case(
        f"sensor-{signal}-{substitute}", "steady",
        _short(0.3, ("events.sensor", {
            "kind": "sensor-fault", "signal": signal, "substitute": substitute,
            "value": value, "at_s": 0.1, "duration_s": 0.04,
        })),
    )
    for signal, substitute, value in (
        ("x", "hold", 0.0), ("x", "value", 0.002), ("x", "offset", 0.0003),
        ("v", "hold", 0.0), ("v", "value", 1.0), ("v", "offset", 0.05),
    )
)  # fmt: skip

_LIVE: Final = (
    Case(
        "live-set-points", "steady", _short(0.4),
        (
            Order(0.05, {"kind": "set-point", "tdc_ref_m": 0.0152}),
            Order(0.15, {"kind": "set-point", "target_power_w": 300.0}),
            Order(0.25, {"kind": "set-point", "tdc_ref_m": 0.2}),
            Order(0.3, {"kind": "set-point", "tdc_ref_m": 0.0155, "target_power_w": 500.0}),
        ),
    ),
    Case(
        "live-laws", "load-decrease", _load_step(("plant.model", "nonlinear"), duration_s=0.55),
        tuple(
            Order(0.05 + 0.07 * n, {"kind": "law", "law": law})
            for n, law in enumerate((*_MODEL_BASED, "single-loop", "cascade", "open-loop"))
        ),
    ),
    Case(
        "live-stop-start", "steady", _short(0.6),
        (Order(0.06, {"kind": "stop"}), Order(0.25, {"kind": "start"})),
    ),
    Case(
        "live-emergency", "steady",
        _short(
            0.4,
            ("events.mark", {"kind": "mark", "text": "planned", "at_s": 0.02}),
            ("events.end", {"kind": "emergency-stop", "at_s": 0.3}),
        ),
        (
            Order(0.06, {"kind": "mark", "text": "on its way"}),
            Order(0.1, {"kind": "emergency-stop"}),
            Order(0.2, {"kind": "start"}),
        ),
    ),
    Case(
        "pre-ignition", "steady",
        _short(
            0.3, ("plant.ignition.work", "map"),
            ("plant.ignition.lead_s", [0.0, 0.003, 0.006]),
            ("plant.ignition.factor", [0.9, 1.0, 0.94]),
            ("events.early", {"kind": "pre-ignition", "at_s": 0.02, "at_stroke_fraction": 0.8}),
        ),
        (Order(0.12, {"kind": "pre-ignition", "at_stroke_fraction": 0.75}),),
    ),
    Case(
        "live-faults", "steady", _short(0.5),
        (
            Order(0.05, {"kind": "misfire", "count": 2, "cause": "fuel"}),
            Order(0.14, {"kind": "load-scale", "value": 0.9, "until_s": 0.24}),
            Order(0.2, {"kind": "efficiency", "low": 0.96, "high": 0.99}),
            Order(0.3, {"kind": "load-scale", "value": -1.0}),
            Order(0.35, {
                "kind": "sensor-fault", "signal": "x", "substitute": "offset", "value": 1e-4,
                "duration_s": 0.05,
            }),
            Order(0.45, {"kind": "sensor-fault", "signal": "v", "duration_s": 1.0}),
        ),
    ),
)  # fmt: skip

_OPERATOR: Final = Case(
    "operator", "steady",
    _short(
        0.6,
        ("events.tdc", {"kind": "set-point", "tdc_ref_m": 0.0153, "at_s": 0.04}),
        ("events.power", {"kind": "set-point", "target_power_w": 350.0, "at_s": 0.1}),
        ("events.law", {"kind": "law", "law": "predictive", "at_s": 0.16}),
        ("events.stop", {"kind": "stop", "at_s": 0.22}),
        ("events.begin", {"kind": "start", "at_s": 0.4}),
    ),
)  # fmt: skip

CASES: tuple[Case, ...] = (
    *(
        Case(model, "load-decrease", _load_step(("plant.model", model), duration_s=0.4))
        for model in _MODELS
    ),
    Case("single-loop", "load-increase", _load_step(
        ("controller.name", "single-loop"), duration_s=0.4)),
    Case("misfire", "misfire", _short(0.5, ("events.misfire.at_s", 0.1))),
    Case("start", "start", _short(0.8)),
    *(Case(law, "load-decrease", _load_step(("controller.name", law))) for law in _LAWS),
    *(
        Case(f"{law}-nonlinear", "load-increase", _load_step(
            ("controller.name", law), ("plant.model", "nonlinear")))
        for law in ("pdf", "predictive")
    ),
    Case("pdf-command", "load-decrease", _load_step(
        ("controller.name", "pdf"), ("controller.pdf.load_from", "command"))),
    *_LIVE,
    _OPERATOR,
    *_SENSOR_FAULTS,
    Case("sensor-implausible", "steady", _short(0.3, ("events.sensor", {
        "kind": "sensor-fault", "signal": "x", "substitute": "value", "value": -0.03,
        "at_s": 0.1, "duration_s": 0.08}))),
    Case("sensor-noise", "variations", _short(
        0.3, ("plant.sensors.noise_x_m", 2e-6), ("plant.sensors.noise_v_m_s", 2e-3),
        ("plant.sensors.resolution_x_m", 1e-6), ("plant.sensors.resolution_v_m_s", 1e-3))),
    Case("command-delay", "load-decrease", _load_step(
        ("plant.command_delay_ticks", 2), ("controller.timing.act_ticks", 3))),
    Case("unequal-injectors", "steady", _short(
        0.3, ("plant.injector.flow_scale_left", 0.98), ("plant.injector.flow_scale_right", 1.01))),
    *(
        Case(f"bit-{model}", "load-decrease", _load_step(
            ("plant.prototype", "bit"), ("plant.model", model)))
        for model in ("harmonic", "rectangular")
    ),
    Case("own-engine", "steady", _short(
        0.3, ("plant.engine.moving_mass_kg", 8.0), ("plant.engine.compression_ratio", 10.0))),
    Case("misfire-fuel", "misfire", _short(
        0.4, ("events.misfire.at_s", 0.05), ("events.misfire.count", 3),
        ("events.misfire.cause", "fuel"))),
    Case("misfire-part-load", "misfire-part-load", _short(
        0.4, ("events.misfire.at_s", 0.05), ("events.load.at_s", 0.05))),
    Case("misfire-unloaded", "misfire-unloaded", _short(
        0.4, ("events.misfire.at_s", 0.05), ("events.load.at_s", 0.05))),
    Case("no-load", "steady", _short(
        0.3, ("events.load", {"kind": "load-scale", "value": 0.0, "at_s": 0.05}))),
    Case("target-power", "load-increase", _load_step(
        ("controller.supervisory.target_power_w", 400.0),
        ("controller.supervisory.throttle", 0.8))),
    Case("contact", "load-decrease", _short(
        0.3, ("controller.name", "open-loop"), ("plant.model", "nonlinear"),
        ("events.load.at_s", 0.05), ("events.load.value", 0.4))),
    Case("start-nonlinear", "start", _short(
        0.6, ("plant.model", "nonlinear"), ("controller.start.constant_force", True),
        ("events.start.at_s", 0.02), ("controller.start.force_n", 300.0))),
    Case("faster", "load-decrease", _short(
        0.15, ("events.load.at_s", 0.05), ("loop.rate_hz", 2500))),
)  # fmt: skip
"""All golden runs; their names are the folders of tests/golden."""
