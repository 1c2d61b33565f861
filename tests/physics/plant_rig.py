"""A plant with a perfect controller: right fuel, spark 1 ms before each dead centre."""

from hil.config.charge.injection import InjectorConfig
from hil.config.plant import PlantConfig
from hil.wire.pulses import PulseOrder
from plant.build import plant_params
from plant.rig.beginning import initial_state
from plant.rig.state import Command
from plant.rig.step import step

MS = 1_000_000
FLOW_US = 2000
DEAD_US = 800


def make(model, fuel_kg, *, period_ns=MS, events=None, seed=1, **config):
    """Return params whose injectors give exactly fuel_kg in a pulse of whole microseconds."""
    injector = InjectorConfig(static_flow_kg_s=fuel_kg / (FLOW_US * 1e-6))
    plant = PlantConfig(model=model, injector=injector, **config)
    return plant_params(plant, period_ns, seed, events)


class Rig:
    """Steps the plant and notes its dead centres and events."""

    def __init__(self, params, fuel_kg, load=None):
        self.params = params
        self.state, events = initial_state(params, fuel_kg, load)
        self.events = list(events)
        self.dead_centres = [self.state.dead_centre]
        self.order = self.state.machine.order
        self.fed = self.sparked = -1

    def pulses(self):
        s = self.state
        if not s.moving:
            return ()
        now_us = -(-s.tick * self.params.period_ns // 1000)
        side = 1 if s.stroke.direction > 0 else 0
        found = []
        if self.fed != s.stroke.number:
            self.fed = s.stroke.number
            found.append(PulseOrder(side, now_us % 2**20, FLOW_US + DEAD_US))
        left_s = self.params.engine.stroke_s(s.motion, s.machine, 0, 0)
        near = left_s < self.params.dt_s + 1.2e-3
        if near and self.sparked != s.stroke.number:
            self.sparked = s.stroke.number
            spark_us = now_us + max(int(left_s * 1e6) - 1000, 0)
            found.append(PulseOrder(2 + side, spark_us % 2**20, 100))
        return tuple(found)

    def tick(self, pulses=None):
        command = Command(self.order, self.pulses() if pulses is None else pulses)
        self.state, events = step(self.params, self.state, command)
        self.events += events
        if self.state.dead_centre.number != self.dead_centres[-1].number:
            self.dead_centres.append(self.state.dead_centre)

    def run(self, seconds):
        for _ in range(round(seconds / self.params.dt_s)):
            self.tick()
        return self

    def tdc_mm(self):
        return [abs(dc.x_m) * 1e3 for dc in self.dead_centres]

    def codes(self):
        return [event.code for event in self.events]
