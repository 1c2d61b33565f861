"""From a resolved scenario and given ports to the controller's parameters, state and loop."""

from __future__ import annotations

from typing import Final

from controller.live.stimulation import Stimulation
from controller.live.tuning import limit_of, params_of
from controller.loop import ControllerLoop
from controller.mode.operation import Operation
from controller.mode.start_restart import Mode
from controller.motion.calibration import calibrate
from controller.motion.choice import check_names, make_laws
from controller.motion.drive import Cycle
from controller.motion.fuelling import Fuelling
from controller.motion.law import NO_DEMAND
from controller.observe.estimate import Motion
from controller.state import Params, State
from controller.supervisory import Supervisor
from controller.timing import port
from controller.timing.plan import NO_PLAN, Plan
from controller.timing.valve_table import table_of
from controller.timing.valves import initial as timing_of_valves
from hil.config.controller import ControllerConfig
from hil.config.prototypes import Prototype
from hil.config.ranges import stale_ticks
from hil.config.resolved import Resolved
from hil.pacing import LockstepPacer, Pacer, RealTimePacer
from hil.ports import Clock, Ports, Recorder
from hil.stimuli.player import player_of
from hil.values import NEVER
from hil.wire.commands import CONTROLLER, OperatorCommand

SAMPLE_PATIENCE_PERIODS: Final = 1.5
"""How long a sample may be late before its tick is stepped without it."""


def make_params(config: ControllerConfig, engine: Prototype, period_ns: int) -> Params:
    """Resolve a configuration for a prototype and a tick.

    Raises: ConfigError when there is no such law, or it cannot work with the configuration
    """
    supervisor = Supervisor(config, engine, float(period_ns) * 1e-9, limit_of(config, engine))
    start = supervisor.initial()
    stroke_map = calibrate(
        config.stroke_map, engine, start.tdc_ref_m, start.load_n_s_m, start.point
    )
    table = cycle = None
    if config.cycle.drive == "controller":
        cycle = Cycle(config.cycle, engine, period_ns * 1e-9)
    if config.timing.valves == "controller":
        table = table_of(config.valves, engine.half_stroke_m, not config.running)
    laws = make_laws(config)
    return params_of(config, config, engine, period_ns, stroke_map, laws, table, cycle)


def initial_mode(config: ControllerConfig) -> Mode:
    """The mode in which a run begins; an engine of which no stroke fires is motored throughout."""
    if not config.running:
        return Mode.OFF
    return Mode.GENERATING if any(config.timing.fires) else Mode.MOTORING


def initial_state(params: Params) -> State:
    """The state before the first tick: running in the steady state, or off."""
    config = params.config
    set_points = params.supervisor.initial()
    steady_kg, valves = set_points.point.fuel_kg, None
    if params.valve_table is not None:
        valves = timing_of_valves(
            params.valve_table, set_points.tdc_ref_m, set_points.point.stroke_s, config.running
        )
    plan, film = NO_PLAN, None
    if params.port is not None:
        stroke_s = set_points.point.stroke_s
        closes_ns = params.port.closes_ns(set_points.tdc_ref_m, stroke_s)
        film = port.initial(params.port, closes_ns, round(1e9 * stroke_s))
        plan = Plan(None, None, steady_kg if config.running else 0.0, 0.0)
    return State(
        motion=Motion(tdc_m=set_points.tdc_ref_m),
        stale=0,
        operation=Operation(initial_mode(config), fired_strokes=config.start.open_strokes),
        set_points=set_points,
        fuelling=Fuelling(config.name, params.law.initial(), NO_DEMAND, (steady_kg, steady_kg)),
        plan=plan,
        pulses=(),
        valves=valves,
        film=film,
    )


def patience_ns(scenario: Resolved) -> int:
    """How long a turn waits for its sample [ns]."""
    if scenario.loop.clock == "realtime":
        return round(SAMPLE_PATIENCE_PERIODS * scenario.loop.period_ns)
    return round(scenario.loop.peer_timeout_s * 1e9)


def make_pacer(scenario: Resolved, clock: Clock | None = None) -> Pacer:
    """The plant paces: in real time patience is 1.5 periods, in lockstep the peer time-out."""
    period_ns = scenario.loop.period_ns
    if scenario.loop.clock == "realtime":
        assert clock is not None, "real time needs a clock"
        return RealTimePacer(clock, period_ns, patience_ns(scenario))
    return LockstepPacer(period_ns, patience_ns(scenario))


def oldest_ns(scenario: Resolved) -> int:
    """Age from which a sample is not acted on [ns]; in lockstep no time passes while it waits."""
    if scenario.loop.clock != "realtime":
        return NEVER
    period_ns = scenario.loop.period_ns
    return period_ns * (stale_ticks(scenario.controller.limits.stale_s, period_ns) - 1)


def schedule_of(scenario: Resolved) -> dict[int, OperatorCommand]:
    """The scenario's own operator commands by tick.

    Two in one tick follow each other in the next free one.
    """
    schedule: dict[int, OperatorCommand] = {}
    for event in scenario.events.values():
        if event.to == CONTROLLER:
            tick = round(event.at_s * scenario.loop.rate_hz)
            while tick in schedule:
                tick += 1
            schedule[tick] = event.command
    return schedule


def stimulation_of(scenario: Resolved) -> Stimulation | None:
    """The controller's stimuli, with the names of the orders that they may wait for; None: none."""
    player = player_of(scenario, CONTROLLER)
    if player is None:
        return None
    names = (name for name, event in scenario.events.items() if event.to == CONTROLLER)
    return Stimulation(player, dict(zip(schedule_of(scenario), names, strict=True)))


def make_loop(
    scenario: Resolved, ports: Ports, recorder: Recorder, pacer: Pacer | None = None
) -> ControllerLoop:
    """Put parameters, initial state and ports together; in lockstep the pacer is known.

    Raises: ConfigError when there is no such law, or it cannot work
    """
    check_names(scenario)
    params = make_params(scenario.controller, scenario.plant.believed(), scenario.loop.period_ns)
    return ControllerLoop(
        params, initial_state(params), ports=ports, pacer=pacer or make_pacer(scenario),
        recorder=recorder, schedule=schedule_of(scenario),
        status_every=scenario.loop.status_every, peer_timeout_s=scenario.loop.peer_timeout_s,
        snapshot_every=scenario.loop.snapshot_every, oldest_ns=oldest_ns(scenario),
        stimulation=stimulation_of(scenario),
    )  # fmt: skip
