"""Runs from Python: `hil.run(scenario)` and what comes of it; `hil.pair` steps a loop by hand.

import hil

run = hil.run("load-decrease", plant__model="nonlinear")
run.verdict                     # "met"
run.figures["settling_s"]       # every figure of the summary
run.stroke.tdc_m                # numpy, a value a stroke [m]
run.pandas("plant.sensor")      # a topic as a pandas frame
run.expect(signal="plant.sensor.p_left_pa", max=60e5)
"""

from bench.api.result import ExpectationError, Run
from bench.api.runs import pair, resolve, run
from bench.run.memory.pair import Pair

__all__ = ["ExpectationError", "Pair", "Run", "pair", "resolve", "run"]
