"""From a resolved scenario and given ports to the plant's parameters, state and loop."""

from __future__ import annotations

from collections.abc import Mapping

from hil.config.plant import PlantConfig
from hil.config.resolved import Resolved
from hil.pacing import LockstepPacer, Pacer, RealTimePacer
from hil.ports import Clock, Ports, Recorder
from hil.stimuli.player import player_of
from hil.wire.commands import PLANT, TimedCommand
from plant.engines import build_engine
from plant.loop import PlantLoop
from plant.rig.air import still
from plant.rig.beginning import initial_state
from plant.rig.events import Event
from plant.rig.params import PlantParams, checked_period_ns, rig_params
from plant.rig.state import PlantState


def plant_params(
    config: PlantConfig,
    period_ns: int,
    seed: int = 0,
    events: Mapping[str, TimedCommand] | None = None,
    rearm: bool = False,
) -> PlantParams:
    """Build the engine that a configuration names, and flatten the rest.

    Raises: ConfigError when the period is outside 10 us to 10 ms, or there is no such engine
    """
    engine = build_engine(config, checked_period_ns(period_ns))
    return rig_params(config, engine, period_ns, seed, dict(events or {}), rearm)


def make_params(scenario: Resolved) -> PlantParams:
    """The plant's part of a scenario."""
    events = {name: event for name, event in scenario.events.items() if event.to == PLANT}
    period_ns, rearm = scenario.loop.period_ns, scenario.safety.rearm
    return plant_params(scenario.plant, period_ns, scenario.run.seed, events, rearm)


def begin(scenario: Resolved, params: PlantParams) -> tuple[PlantState, tuple[Event, ...]]:
    """Where the scenario begins, and the events of that instant.

    Raises: ConfigError when the run cannot begin as it is asked to
    """
    controller = scenario.controller
    preset, load_n_s_m = controller.preset, controller.supervisory.load_coefficient_n_s_m
    if preset.load_coefficient_n_s_m is not None:
        load_n_s_m = preset.load_coefficient_n_s_m
    state, events = initial_state(
        params,
        preset.fuel_kg if scenario.begins == "settled" else None,
        load_n_s_m,
        preset.stroke_s or 0.0,
    )
    manifold = still(params.intake, controller.supervisory.throttle)
    return state.but(manifold=manifold), events


def patience_ns(scenario: Resolved) -> int:
    """How long a turn waits for the answer: not at all in real time [ns]."""
    realtime = scenario.loop.clock == "realtime"
    return 0 if realtime else round(scenario.loop.peer_timeout_s * 1e9)


def make_pacer(scenario: Resolved, clock: Clock | None = None) -> Pacer:
    """Real time: deadlines and the newest answer, if any. Lockstep: the answer must come."""
    period_ns = scenario.loop.period_ns
    if scenario.loop.clock == "realtime":
        assert clock is not None, "real time needs a clock"
        return RealTimePacer(clock, period_ns)
    return LockstepPacer(period_ns, patience_ns(scenario))


def make_loop(
    scenario: Resolved, ports: Ports, recorder: Recorder, pacer: Pacer | None = None
) -> PlantLoop:
    """Put parameters, initial state and ports together; in lockstep the pacer is known.

    Raises: ConfigError when the run cannot begin as it is asked to
    """
    params = make_params(scenario)
    state, events = begin(scenario, params)
    return PlantLoop(
        params, state, events, link=ports.link, pacer=pacer or make_pacer(scenario),
        recorder=recorder, status=ports.status, commands=ports.commands,
        status_every=scenario.loop.status_every,
        snapshot_every=scenario.loop.snapshot_every, player=player_of(scenario, "plant"),
    )  # fmt: skip
