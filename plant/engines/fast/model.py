"""A fast-response engine: paths from one event to the next, combustion at the dead centre."""

from __future__ import annotations

import math
from typing import Final, final

from hil.config.plant import PlantConfig
from hil.errors import ConfigError
from hil.values import Value
from plant.engines.fast import nonlinear, paths
from plant.engines.fast.combustion import Burn, energy_j
from plant.engines.fast.constants import Constants, constants_of
from plant.engines.fast.limit_cycle import limit_cycle
from plant.engines.fast.linear import CONTACT, NO_STOP, UNDERDAMPED, Segment, evaluate
from plant.engines.fast.paths import Path
from plant.engines.machine import IDLE, Machine
from plant.engines.protocol import (
    AT_DEAD_CENTRE,
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

# Smaller than this from its equilibrium, and slower, an unfired piston is at rest.
REST_M: Final = 1.0e-6
REST_M_S: Final = 1.0e-3
# Bounces against a head shrink without end; after this many parts of a tick the piston rests.
MOST_PARTS: Final = 32
# Volume at the head itself is nought; pressures are told as at this distance from it.
NEAREST_M: Final = 1.0e-4


@final
class FastState(Value):
    """What drives the piston in this stroke, and the path that it takes."""

    __slots__ = ("burn", "path")

    def __init__(self, burn: Burn, path: Path) -> None:
        self.burn = burn
        self.path = path


def build(config: PlantConfig, _period_ns: int) -> FastEngine:
    """Build the engine that a plant's configuration names."""
    prototype = config.resolved_prototype()
    constants = constants_of(prototype, config.model, config.contact_restitution)
    return FastEngine(constants, prototype.load_coefficient_n_s_m)


@final
class FastEngine(Engine):
    """One of the four models of docs/model.md."""

    def __init__(self, constants: Constants, load_coefficient_n_s_m: float) -> None:
        super().__init__(load_coefficient_n_s_m, AT_DEAD_CENTRE)
        self.constants = constants
        self._slack_n = constants.rest_stiffness_n_m * REST_M

    def begin(self, charge: Charge | None, load_n_s_m: float) -> Motion:
        """Begin at rest at mid-stroke, or come to the left dead centre of the settled motion.

        Raises: ConfigError when no settled motion stays inside the stroke
        """
        if charge is None:
            still = Motion(0.0, 0.0, 0.0, False, 0, None)
            return self._on_path(still, Burn(1, 0.0), IDLE)
        tdc_m = limit_cycle(self.constants, charge.fuel_kg, load_n_s_m).tdc_m
        if tdc_m >= self.constants.contact_m:
            raise ConfigError(f"settled motion of {tdc_m * 1e3:.3f} mm strikes the head")
        return self._on_path(Motion(-tdc_m, 0.0, 0.0, True, 0, None), Burn(-1, 0.0), IDLE)

    def coast(self, m: Motion, dt_s: float) -> Motion | None:
        """Evaluate the closed form once; None when the stroke ends in this tick, or may."""
        inner = _state(m)
        tau = m.tau_s + dt_s
        if not m.moving:
            return Motion(m.x_m, m.v_m_s, tau, False, 0, inner)
        path, direction = inner.path, inner.burn.direction
        if isinstance(path, Segment):
            if path.regime != UNDERDAMPED:
                return None
            x, v = evaluate(path, tau)
            if v * direction <= 0.0 or x * direction >= self.constants.contact_m:
                return None
        else:
            x, v, _, stop = nonlinear.advance(path, m.x_m, m.v_m_s, dt_s, direction)
            if stop != NO_STOP or abs(v) <= REST_M_S:
                return None
        return Motion(x, v, tau, True, direction, inner)

    def advance(self, m: Motion, inputs: Inputs, ahead: Ahead) -> Moved:
        """Move on to the next dead centre or contact, to what is due, or to the tick's end."""
        left = ahead.dt_s - ahead.used_s
        if ahead.part >= MOST_PARTS:
            rest = _resting(m, m.tau_s + ahead.dt_s - ahead.used_s)
            return Moved(rest, ahead.start_ns, ahead.dt_s, None, False, False, True)
        wait = max(ahead.due_s - m.tau_s, 0.0)
        span = min(left, wait)
        inner = _state(m)
        if not m.moving:
            moved = Motion(m.x_m, m.v_m_s, m.tau_s + span, False, 0, inner)
            return self._on_time(moved, inputs, ahead, span, wait <= left)
        direction = inner.burn.direction
        x, v, spent, stop = paths.advance(
            inner.path, m.x_m, m.v_m_s, m.tau_s, span,
            direction=direction, contact_m=self.constants.contact_m,
        )  # fmt: skip
        moved = Motion(x, v, m.tau_s + spent, True, direction, inner)
        if stop == NO_STOP:
            return self._on_time(moved, inputs, ahead, span, wait <= left)
        used = ahead.used_s + spent
        return self._stopped(moved, inputs.machine, ahead, used, stop == CONTACT)

    def _on_time(self, m: Motion, inputs: Inputs, ahead: Ahead, span: float, at_due: bool) -> Moved:
        """Say that the span was gone through, and whether a creeping piston has stopped by then."""
        used = ahead.dt_s if span == ahead.dt_s - ahead.used_s else ahead.used_s + span
        at_end = used >= ahead.dt_s
        if at_end and self._creeps_no_more(m, inputs.machine):
            if _state(m).burn.energy_j != 0.0:
                return self._stopped(m, inputs.machine, ahead, ahead.dt_s, False)
            rest = _resting(m, m.tau_s)
            return Moved(rest, ahead.end_ns, used, None, False, at_due, True)
        t_ns = ahead.start_ns + used * 1e9
        return Moved(m, t_ns, used, None, False, at_due, at_end)

    def _stopped(
        self, m: Motion, machine: Machine, ahead: Ahead, used: float, contact: bool
    ) -> Moved:
        """Bounce, or see that a piston whose speed has vanished is not pushed on the same way."""
        at_end = used >= ahead.dt_s
        t_ns = ahead.end_ns if used == ahead.dt_s else ahead.start_ns + used * 1e9
        burn = _state(m).burn
        if contact:
            v = -self.constants.restitution * m.v_m_s
            m = Motion(m.x_m, v, m.tau_s, True, burn.direction, m.inner)
        elif self._net_n(m, machine) * burn.direction > self._slack_n:
            onward = self._on_path(m, Burn(burn.direction, 0.0), machine)
            return Moved(onward, t_ns, used, None, False, False, at_end)
        compressed = m.x_m * burn.direction > 0.0
        stop = Stop(t_ns, m.x_m, m.tau_s, 1, int(contact), compressed, None)
        return Moved(m, t_ns, used, stop, False, False, at_end)

    def turn(self, m: Motion, machine: Machine, charge: Charge, stop: Stop) -> Motion:
        """Reverse with what burns; without it, a piston that nothing pushes rests."""
        net = self._net_n(m, machine)
        before = _state(m).burn.direction
        energy = energy_j(self.constants, charge.fuel_kg, charge.efficiency)
        c, force = machine.load_coefficient_n_s_m, machine.force_n
        burn = Burn(-before, energy, paths.latches(self.constants, energy, c, force))
        pinned = net * before > 0.0 if stop.contacts else abs(net) <= self._slack_n
        if energy == 0.0 and pinned and abs(m.v_m_s) <= REST_M_S:
            return self._on_path(Motion(m.x_m, 0.0, 0.0, False, 0, None), burn, machine)
        v = 0.0 if burn.latched else m.v_m_s
        return self._on_path(Motion(m.x_m, v, 0.0, True, burn.direction, None), burn, machine)

    def follow(self, m: Motion, machine: Machine) -> Motion:
        """Take a path for the changed machine; wake a resting piston if it is pushed."""
        burn = _state(m).burn
        if m.moving:
            return m if burn.latched else self._on_path(m, burn, machine)
        net = self._net_n(m, machine)
        inward = abs(m.x_m) < self.constants.contact_m or net * m.x_m < 0.0
        if abs(net) <= self._slack_n or not inward:
            return m
        direction = 1 if net > 0.0 else -1
        woken = Motion(m.x_m, m.v_m_s, 0.0, True, direction, None)
        return self._on_path(woken, Burn(direction, 0.0), machine)

    def stroke_s(self, m: Motion, _machine: Machine, _now_ns: int, _begun_ns: int) -> float:
        """Follow the path to its end."""
        s = _state(m)
        return paths.remaining_s(self.constants, s.burn, s.path, x=m.x_m, v=m.v_m_s, tau=m.tau_s)

    def sensed(self, m: Motion, machine: Machine) -> Sensed:
        """Gas pressures p = p0 (V0/V)^gamma + dp (Vc/V)^gamma, dp where it fired.

        dp = E CR^gamma / (A Ls)     (thesis eqs. 5.9 to 5.19, exponents corrected)
        """
        k, burn = self.constants, _state(m).burn
        size, gamma = k.half_stroke_m, k.gamma
        left = math.pow(size / max(size + m.x_m, NEAREST_M), gamma)
        right = math.pow(size / max(size - m.x_m, NEAREST_M), gamma)
        burnt = burn.energy_j / (k.area_m2 * size)
        p_left = k.p0_pa + (burnt if burn.direction > 0 else 0.0)
        p_right = k.p0_pa + (burnt if burn.direction < 0 else 0.0)
        return Sensed(p_left * left, p_right * right, power_w(m, machine))

    def _on_path(self, m: Motion, burn: Burn, machine: Machine) -> Motion:
        c, force = machine.load_coefficient_n_s_m, machine.force_n
        path = paths.path_of(self.constants, burn, c, force, x=m.x_m, v=m.v_m_s, tau=m.tau_s)
        return Motion(m.x_m, m.v_m_s, m.tau_s, m.moving, m.heading, FastState(burn, path))

    def _net_n(self, m: Motion, machine: Machine) -> float:
        return paths.net_force_n(self.constants, m.x_m, machine.force_n)

    def _creeps_no_more(self, m: Motion, machine: Machine) -> bool:
        """Tell whether a motion too damped to have a dead centre has come to its end."""
        if not m.moving or abs(m.v_m_s) > REST_M_S:
            return False
        path = _state(m).path
        if isinstance(path, Segment) and path.regime == UNDERDAMPED:
            return False
        inertia = self.constants.mass_kg * abs(paths.acceleration(path, m.x_m, m.v_m_s, m.tau_s))
        return inertia + machine.load_coefficient_n_s_m * abs(m.v_m_s) <= self._slack_n


def _state(m: Motion) -> FastState:
    inner = m.inner
    assert isinstance(inner, FastState)
    return inner


def _resting(m: Motion, tau_s: float) -> Motion:
    """Stop the piston where it is; what has burnt is spent."""
    inner = _state(m)
    spent = FastState(Burn(inner.burn.direction, 0.0), inner.path)
    return Motion(m.x_m, 0.0, tau_s, False, 0, spent)
