"""Both loops stepped in turn, with all that the plant tells and the controller reports of it."""

import math

import controller.build
import plant.build
from bench.dev.golden_cases import LOCKSTEP, Case, scenario_for
from bench.run.offline import command_of
from controller.state import Inputs
from controller.step import step as answer
from hil.rounding import nearest
from hil.wire.messages import PistonSample
from plant.rig.state import Command
from plant.rig.step import step
from plant.sample_frames import beside, winding_k
from plant.sensors import sample, sensed

WATCHED = ("plant.indicator.on", True)


class Protected:
    """One run; `deaf` tells in which ticks no sample comes."""

    def __init__(self, seconds, *changes, scenario="steady", deaf=lambda tick, x_m: False):
        self.scenario = scenario_for(Case("protection", scenario, changes), LOCKSTEP)
        self.params = plant.build.make_params(self.scenario)
        self.state, _ = plant.build.begin(self.scenario, self.params)
        self.cycles, self.strokes, self.told = [], [], []
        law = controller.build.make_params(
            self.scenario.controller, self.scenario.plant.believed(), 1_000_000
        )
        mind, command = controller.build.initial_state(law), Command()
        for tick in range(round(seconds * 1000)):
            s = self.state
            seen, third, kelvin = sample(self.params, s), beside(self.params, s), math.nan
            if tick % 64 == 63:
                kelvin = winding_k(self.params, s, tick)
            power_w = (
                math.nan if tick & 1 else float(nearest(sensed(self.params, s).electric_power_w))
            )
            inputs = Inputs(
                tick, PistonSample(seen.x_m, seen.v_m_s), None, power_w, 0, third, kelvin
            )
            if deaf(tick, seen.x_m):
                inputs = Inputs(tick, None)
            self.state, _ = step(self.params, s, command)
            mind, output = answer(law, mind, inputs)
            command = command_of(output)
            self.told += output.events
            self.cycles += [output.cycle] if output.cycle is not None else []
            self.strokes += [output.stroke] if output.stroke is not None else []
        self.mind = mind

    @property
    def codes(self):
        return [code for code, _ in self.told]

    def mean(self, of, count=10):
        """Mean of a figure of the last strokes or cycles."""
        return sum(of) / len(of) if (of := of[-count:]) else math.nan
