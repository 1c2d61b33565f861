"""Pseudo-derivative feedback with load feed-forward, all of it through the stroke's own map.

m_fuel = q(c, X) / share,  q the charge that takes the next stroke from X to the set point

The load c that is fed forward is the commanded one, times its scale from electric power and
velocity where that is asked for; X, the dead centre ahead, is predicted from the motion and fed
back undifferentiated by its own error (hence pseudo-derivative, Mikalsen and Roskilly); the
integral of what is left sits in the shares (`charge`). Fuel is trimmed until it has flowed.
"""

from __future__ import annotations

from typing import NamedTuple

from controller.laws import charge, load_estimate
from controller.laws.charge import NOTHING_FORESEEN, Charge, Forecast
from controller.laws.engine_map import charge_for, travel
from controller.laws.interface import (
    NO_TRIM,
    Demand,
    Handover,
    Law,
    StrokeFacts,
    TickFacts,
    Trim,
)
from controller.laws.load_estimate import LoadEstimate
from hil.config.controller import ControllerConfig


class PdfState(NamedTuple):
    """Load, charge, what is foreseen of this stroke, and the load that the fuel was set for.

    end_m: dead centre predicted when the fuel was set last, 0 before
    """

    load: LoadEstimate = LoadEstimate()
    charge: Charge = Charge()
    forecast: Forecast = NOTHING_FORESEEN
    fuel_for_n_s_m: float = 0.0
    end_m: float = 0.0


def step(config: ControllerConfig, state: PdfState, facts: StrokeFacts) -> tuple[PdfState, Demand]:
    """The steady fuel for the load, until the watch trims it in the same tick."""
    fuel = charge.first_fuel(state.charge, facts)
    return state._replace(fuel_for_n_s_m=0.0, end_m=0.0), Demand(fuel, facts.point.v_mid_m_s)


def watch(config: ControllerConfig, state: PdfState, facts: TickFacts) -> tuple[PdfState, Trim]:
    """Measure the load, learn at the dead centre, trim the fuel while it can be trimmed."""
    motion = facts.motion
    load, learnt, forecast, fuel_for, end = state
    if facts.power_w == facts.power_w and config.pdf.load_from == "power":
        load = load_estimate.update(
            config.load_estimate, load, facts.power_w, motion.v_m_s, facts.load_n_s_m
        )
    elif not facts.passed.dead_centre and facts.planned_kg == 0.0:
        return state, NO_TRIM
    c = facts.load_n_s_m * load.scale
    unsure = config.pdf.load_from == "power" and load.variance > load_estimate.UNSURE
    if facts.passed.dead_centre and unsure:
        return PdfState(load, learnt), NO_TRIM
    if facts.passed.dead_centre:
        learnt, forecast = at_dead_centre(config, learnt, forecast, facts, c, end)
        return PdfState(load, learnt, forecast), NO_TRIM
    settled = facts.planned_kg == 0.0 or not learnt.known
    if settled or abs(c - fuel_for) <= config.load_estimate.retrim * c:
        return PdfState(load, learnt, forecast, fuel_for, end), NO_TRIM
    end, _ = rest_of_stroke(facts, learnt, c)
    fuel = fuel_after(facts, learnt, c, end)
    return PdfState(load, learnt, forecast, c, end), Trim(fuel)


def at_dead_centre(
    config: ControllerConfig, learnt: Charge, forecast: Forecast, facts: TickFacts, c: float,
    end_m: float,
) -> tuple[Charge, Forecast]:  # fmt: skip
    """Learn from the stroke that has ended, and foresee the one that begins.

    Parameters: end_m : dead centre that was predicted for now, 0 when none was
    """
    motion, model = facts.motion, facts.model
    fired, now = 1 - motion.side, motion.side
    if learnt.known:
        before = learnt
        learnt = charge.learn(
            config.learning, learnt, fired, facts.burnt_kg[fired], forecast, motion.tdc_m, c,
            motion.dc_t_ns, model,
        )  # fmt: skip
        if end_m > 0.0 and learnt is not before:
            learnt = charge.look_back(
                config.learning, learnt, motion.tdc_m - end_m - learnt.ahead_m
            )
    else:
        learnt = charge.align(
            config.learning, learnt, facts.model, c, facts.tdc_ref_m, motion.tdc_m, facts.burnt_kg
        )
    burnt = facts.burnt_kg[now]
    if burnt <= 0.0:
        return learnt, NOTHING_FORESEEN
    q = charge.effective(learnt, now, burnt)
    return learnt, charge.foresee(learnt.model or model, q, c, motion.tdc_m, motion.dc_t_ns)


def rest_of_stroke(facts: TickFacts, learnt: Charge, c: float) -> tuple[float, float]:
    """Where the stroke under way ends under the load c, and in how many seconds."""
    motion = facts.motion
    q = charge.effective(learnt, motion.side, facts.burnt_kg[motion.side])
    z, v = motion.direction * motion.x_m, motion.direction * motion.v_m_s
    return travel(learnt.model or facts.model, q, c, z, v, facts.tau_s)


def fuel_after(facts: TickFacts, learnt: Charge, c: float, end_m: float) -> float:
    """The fuel for the stroke from the predicted dead centre to the set point, in its limits."""
    share = learnt.share[1 - facts.motion.side]
    start = end_m + learnt.ahead_m
    model = learnt.model or facts.model
    q, _ = charge_for(model, c, start, facts.tdc_ref_m, share * facts.planned_kg)
    return min(max(q / share, facts.fuel_min_kg), facts.fuel_max_kg)


def take_over(config: ControllerConfig, handover: Handover) -> PdfState:
    """Know nothing of the load yet, and align the shares with the fuel in force."""
    return PdfState(LoadEstimate(variance=1.0), Charge(known=False))


def after_restart(state: PdfState) -> PdfState:
    """Keep what was learnt; the stroke under way teaches nothing."""
    return state._replace(forecast=NOTHING_FORESEEN, fuel_for_n_s_m=0.0, end_m=0.0)


LAW = Law("pdf", PdfState(), step, watch, take_over, after_restart, needs_model=True)
