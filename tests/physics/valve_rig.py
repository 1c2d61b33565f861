"""The loop of plant and controller with the valves' moves noted, and the piston at each of them."""

import math

import numpy as np

import controller.build
import plant.build
from bench.run.offline import command_of
from bench.run.resolve import resolve
from controller.state import Inputs
from controller.step import step as answer
from hil.config.load import build
from hil.config.prototypes import NU
from hil.rounding import nearest
from hil.wire.messages import PistonSample
from plant.log import pack_valves
from plant.rig.state import Command
from plant.rig.step import step
from plant.sample_frames import beside
from plant.sensors import sample, sensed


class ValveRun:
    """One run on valves that the controller moves; `lost` ticks have no answer."""

    def __init__(self, model, seconds, *, valves, lost=(), name="open-loop", **tree):
        tree = {
            "plant": {"model": model, "valves": valves}, "begins": "settled",
            "run": {"duration_s": seconds},
            "controller": {"name": name, "timing": {"valves": "controller"}},
        } | tree  # fmt: skip
        self.scenario = resolve(build(tree, "test"))
        self.params = plant.build.make_params(self.scenario)
        self.state, self.events = plant.build.begin(self.scenario, self.params)
        self.dead_centres, self.moves, self.path, self.most_frames = [], [], [], 0
        self.logged = b""
        self._run(set(lost))

    def _run(self, lost):
        config = self.scenario.controller
        law = controller.build.make_params(config, NU, 1_000_000)
        mind, command = controller.build.initial_state(law), Command()
        for tick in range(self.scenario.ticks):
            s = self.state
            seen, valve = sample(self.params, s), beside(self.params, s)
            power_w = float(nearest(sensed(self.params, s).electric_power_w))
            self.path.append((tick * 1e6, s.x_m, s.v_m_s))
            self.state, events = step(self.params, s, None if tick in lost else command)
            self.events += events
            self.logged += pack_valves(self.params, tick, s, self.state)
            known = s.pulses.valves.told[1:] if s.pulses.valves.told else ()
            self.moves += self.state.pulses.valves.told[len(known) :]
            if self.state.dead_centre.number != s.dead_centre.number:
                self.dead_centres.append(self.state.dead_centre)
            inputs = Inputs(
                tick, PistonSample(seen.x_m, seen.v_m_s), None,
                math.nan if tick & 1 else power_w, 0, valve,
            )  # fmt: skip
            mind, output = answer(law, mind, inputs)
            self.most_frames = max(self.most_frames, len(output.pulses) + (valve is not None))
            command = command_of(output)
        self.mode = mind.mode.name.lower()
        self.learnt = mind.valves.learnt

    def position_m(self, t_ns):
        """Position between two ticks, by the cubic through both."""
        i = min(int(t_ns // 1e6), len(self.path) - 2)
        (t, x0, v0), (_, x1, v1) = self.path[i : i + 2]
        s, h = (t_ns - t) * 1e-6, 1e-3
        return (
            (2 * s**3 - 3 * s**2 + 1) * x0 + (s**3 - 2 * s**2 + s) * v0 * h
            + (3 * s**2 - 2 * s**3) * x1 + (s**3 - s**2) * v1 * h
        )  # fmt: skip

    def gaps_mm(self, since_s):
        """Distances from the valve's head at its moves, by (name, is_open)."""
        found = {}
        for move in self.moves:
            if move.t_ns >= since_s * 1e9:
                x = self.position_m(move.t_ns)
                gap = 20e-3 + x if move.line < 2 else 20e-3 - x
                found.setdefault((move.name, move.is_open), []).append(gap * 1e3)
        return {key: np.array(gaps) for key, gaps in found.items()}
