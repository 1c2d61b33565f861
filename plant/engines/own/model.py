"""An engine that a user has brought: a class that knows its physics, worked as one of ours.

It derives from nothing. Its state is a tuple, position [m] and velocity [m/s] first, and a value:

    begin(x_m) -> state                        it stands there, and nothing burns
    advance(state, inputs, span_s) -> state    moved on by so much, any part of a tick
    turn(state, side, fuel_kg) -> state        at a dead centre, with what burns there at once
    light(state, side, fuel_kg) -> state       at a spark, or None where the charge does not burn
    sensed(state, machine) -> p_left_pa, p_right_pa[, electric_power_w]

Dead centres, contacts, rest and what is due are found here, from where `advance` comes to.
"""

from __future__ import annotations

import math
from typing import Any, Final, final

from hil.brought import Brought, make, settings_of
from hil.config.plant import PlantConfig
from hil.roots import bisect, falling_zero
from plant.engines.likeness import settled_tdc_m
from plant.engines.machine import Machine
from plant.engines.own.physics import OwnState, Physics, source_of
from plant.engines.protocol import (
    AT_DEAD_CENTRE,
    BY_SPARK,
    Ahead,
    Charge,
    Engine,
    Inputs,
    Motion,
    Moved,
    Sensed,
    Stop,
    power_w,
)

_NS: Final = 1e9
_LEFT: Final = 0
_RIGHT: Final = 1
_REST_M: Final = 1.0e-6
_REST_M_S: Final = 1.0e-3
"""Slower, and moving no further than that in a tick, the piston is at rest."""
_WOKEN_M_S: Final = 1.0e-4
"""A resting piston that a tick would make faster has been set off."""
_CLOSE_S: Final = 1.0e-12
"""So near is a dead centre found."""
_MOST_PARTS: Final = 32
_LONGEST_STROKE_S: Final = 0.2


def build(config: PlantConfig, period_ns: int) -> OwnEngine:
    """Make the engine that a plant's configuration brings.

    Raises: ConfigError when it cannot be made
    """
    kind, brought = source_of(config)
    return OwnEngine(config, kind, brought, period_ns)


@final
class OwnEngine(Engine):
    """The class of somebody else behind the interface of an engine."""

    def __init__(
        self,
        config: PlantConfig,
        kind: Any,  # noqa: ANN401
        brought: Brought,
        period_ns: int,
    ) -> None:
        prototype = config.resolved_prototype()
        settings = settings_of(kind, config.own.settings, "plant.own.settings", brought.path)
        self._kind = kind
        self._brought = brought
        engine = make(kind, brought, prototype, settings)
        self._physics = Physics(engine, str(brought.path.resolve()))
        self._config = config
        self._period_ns = period_ns
        self._tick_s = period_ns / _NS
        self._contact_m = prototype.half_stroke_m
        super().__init__(
            prototype.load_coefficient_n_s_m,
            BY_SPARK if self._physics.lights else AT_DEAD_CENTRE,
            every_stroke=config.own.like != "four-stroke",
        )

    def remade(self, config: PlantConfig) -> OwnEngine:
        """The same by the settings of another configuration.

        Raises: ConfigError naming a key that it does not accept
        """
        same = config.own.settings == self._config.own.settings
        return self if same else OwnEngine(config, self._kind, self._brought, self._period_ns)

    def begin(self, charge: Charge | None, load_n_s_m: float) -> Motion:
        """Begin at rest at mid-stroke, or at the left dead centre of the model that it is like.

        Raises: ConfigError when there is no such motion
        """
        if charge is None:
            return _motion(self._physics.begin(0.0), 0.0, False, 0)
        x_m = -settled_tdc_m(self._config, self._config.own.like, charge.fuel_kg, load_n_s_m)
        state = self._physics.begin(x_m)
        if self.ignition == AT_DEAD_CENTRE:  # the rig lets it turn there with its charge
            return _motion(state, 0.0, True, -1)
        lit = self._physics.light(state, _LEFT, charge.efficiency * charge.fuel_kg)
        return _motion(state if lit is None else lit, 0.0, True, 1)

    def advance(self, m: Motion, inputs: Inputs, ahead: Ahead) -> Moved:
        """Move on to the next dead centre, contact, edge or disturbance, or to the tick's end."""
        edge_ns = float(ahead.edge_ns) if self.ignition == BY_SPARK else math.inf
        until_ns = min(float(ahead.end_ns), edge_ns, ahead.due_ns)
        span_s = max(until_ns - ahead.now_ns, 0.0) / _NS
        if m.moving and span_s > 0.0 and ahead.part < _MOST_PARTS:
            moved = _state(m)
            there = self._physics.advance(moved, inputs, span_s)
            stopped = self._stopped(m, moved, there, inputs, ahead, span_s)
            if stopped is not None:
                return stopped
            m = self._onwards(there, m, inputs, (until_ns - ahead.stroke_ns) / _NS)
        else:
            m = Motion(m.x_m, m.v_m_s, m.tau_s + span_s, m.moving, m.heading, m.inner)
        return Moved(
            m, until_ns, 0.0, None, until_ns >= edge_ns, until_ns >= ahead.due_ns,
            until_ns >= ahead.end_ns,
        )  # fmt: skip

    def _stopped(
        self, m: Motion, here: tuple[Any, ...], there: tuple[Any, ...], inputs: Inputs,
        ahead: Ahead, span_s: float,
    ) -> Moved | None:  # fmt: skip
        """Find the dead centre or the contact within a span; None when there is neither."""
        heading, contacts = m.heading, 0
        if there[1] * heading <= 0.0:
            spent_s, at = self._dead_centre(here, inputs, span_s, heading)
        else:
            spent_s, at = span_s, there
        if at[0] * heading >= self._contact_m:
            spent_s, at = self._contact(here, inputs, spent_s, heading)
            contacts = 1
        elif at is there:
            return None
        t_ns = ahead.now_ns + spent_s * _NS
        lasted_s = (t_ns - ahead.stroke_ns) / _NS
        stop = Stop(t_ns, at[0], lasted_s, 1, contacts, at[0] * heading > 0.0, None)
        motion = _motion(at, lasted_s, True, heading)
        return Moved(motion, t_ns, 0.0, stop, False, False, t_ns >= ahead.end_ns)

    def _dead_centre(
        self, here: tuple[Any, ...], inputs: Inputs, span_s: float, heading: int
    ) -> tuple[float, tuple[Any, ...]]:
        """Where in a span the velocity turns, and the state there."""
        before = [0.0, float(here[1] * heading)]

        def speed(t_s: float) -> tuple[float, float]:
            v = float(self._physics.advance(here, inputs, t_s)[1] * heading)
            slope = (v - before[1]) / (t_s - before[0]) if t_s != before[0] else 0.0
            before[0], before[1] = t_s, v
            return v, slope

        t_s = falling_zero(speed, 0.0, span_s, _CLOSE_S)
        at = self._physics.advance(here, inputs, t_s)
        return t_s, (at[0], 0.0, *at[2:])

    def _contact(
        self, here: tuple[Any, ...], inputs: Inputs, span_s: float, heading: int
    ) -> tuple[float, tuple[Any, ...]]:
        """Where in a span the piston strikes the head, and the state in which it leaves it."""

        def gap_m(t_s: float) -> float:
            return self._contact_m - float(self._physics.advance(here, inputs, t_s)[0] * heading)

        t_s = bisect(gap_m, 0.0, span_s)
        at = self._physics.advance(here, inputs, t_s)
        v = -self._config.contact_restitution * at[1]
        return t_s, (heading * self._contact_m, v, *at[2:])

    def _onwards(self, there: tuple[Any, ...], m: Motion, inputs: Inputs, tau_s: float) -> Motion:
        """Enter where it has come to; a motion that has died away without a dead centre rests."""
        if abs(there[1]) <= _REST_M_S and self._stays(there, inputs):
            return _motion((there[0], 0.0, *there[2:]), tau_s, False, 0)
        return _motion(there, tau_s, True, m.heading)

    def _stays(self, state: tuple[Any, ...], inputs: Inputs) -> bool:
        """Tell whether a tick would leave a piston where it is."""
        there = self._physics.advance(state, inputs, self._tick_s)
        return bool(abs(there[0] - state[0]) <= _REST_M and abs(there[1]) <= _REST_M_S)

    def turn(self, m: Motion, machine: Machine, charge: Charge, stop: Stop) -> Motion:
        """Reverse with what burns; without it, a piston that nothing pushes rests."""
        state, side = _state(m), _RIGHT if m.heading > 0 else _LEFT
        at_once = self.ignition == AT_DEAD_CENTRE
        fuel_kg = charge.efficiency * charge.fuel_kg if at_once else 0.0
        state = self._physics.turn(state, side, fuel_kg)
        still = charge.fuel_kg == 0.0 and abs(state[1]) <= _REST_M_S
        if still and self._stays(state, _acting(machine)):
            return _motion((state[0], 0.0, *state[2:]), 0.0, False, 0)
        return _motion(state, 0.0, True, -m.heading)

    def follow(self, m: Motion, machine: Machine) -> Motion:
        """Wake a resting piston if the changed machine pushes it."""
        if m.moving:
            return m
        there = self._physics.advance(_state(m), _acting(machine), self._tick_s)
        if abs(there[1]) < _WOKEN_M_S or abs(there[0]) >= self._contact_m:
            return m
        return Motion(m.x_m, m.v_m_s, 0.0, True, 1 if there[1] > 0.0 else -1, m.inner)

    def light(self, m: Motion, side: int, t_ns: int, fuel_kg: float) -> tuple[Motion, str]:
        """Let it light the charge of a side."""
        lit = self._physics.light(_state(m), side, fuel_kg)
        if lit is None:
            return m, "no compression"
        return _motion(lit, m.tau_s, m.moving, m.heading), ""

    def stroke_s(self, m: Motion, machine: Machine, now_ns: int, begun_ns: int) -> float:
        """Run on undisturbed to the end of the stroke; 0 where a spark may still change it."""
        state, inputs = _state(m), _acting(machine)
        if self.ignition == BY_SPARK or not m.moving:
            return 0.0
        for tick in range(round(_LONGEST_STROKE_S / self._tick_s)):
            there = self._physics.advance(state, inputs, self._tick_s)
            if there[1] * m.heading <= 0.0 or there[0] * m.heading >= self._contact_m:
                spent_s, _ = self._dead_centre(state, inputs, self._tick_s, m.heading)
                return (now_ns - begun_ns) / _NS + tick * self._tick_s + spent_s
            state = there
        return 0.0

    def sensed(self, m: Motion, machine: Machine) -> Sensed:
        """Return pressures and power; a power that it does not tell is that of the machine.

        Raises: RunError naming file and line when the engine fails
        """
        left, right, *power = self._physics.sensed(_state(m), machine)
        return Sensed(left, right, power[0] if power else power_w(m, machine))


def _state(m: Motion) -> tuple[Any, ...]:
    inner = m.inner
    assert isinstance(inner, OwnState)
    return inner.of


def _motion(state: tuple[Any, ...], tau_s: float, moving: bool, heading: int) -> Motion:
    return Motion(state[0], state[1], tau_s, moving, heading, OwnState(state))


def _acting(machine: Machine) -> Inputs:
    """What acts where nothing but the machine is known."""
    return Inputs(machine, (), (0.0, 0.0), (-1, -1))
