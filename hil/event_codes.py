"""Codes of a log's /event topic: what a scenario may wait for, forbid or put in order by name."""

from __future__ import annotations

from typing import Final

from hil.wire.messages import OPERATING_MODES

OF_THE_PLANT: Final = {
    "misfire": "a charge did not burn",
    "contact": "the piston struck a head",
    "valve-contact": "the piston struck an open valve",
    "at-rest": "the piston has come to rest",
    "in-motion": "the piston moves again",
    "disturbance": "an event of the scenario begins or ends",
    "pulse-refused": "a pulse could not be taken",
    "order-refused": "an order of the controller is not followed",
    "safe-state": "the plant has gone to its safe state",
    "safe-state-left": "the plant has left it",
}
OF_THE_CONTROLLER: Final = {
    **{f"mode {name}": f"the controller is {name}" for name in OPERATING_MODES.values()},
    "sample-late": "a sample was too late to act on",
    "sample-refused": "the first frames had no valid head",
    "sample-doubted": "a sample was not believed",
    "power-limited": "the target power cannot be had: what is in its way",
    "power-within-reach": "the target power can be had again",
    "derating": "a limit of the protection is near: what is taken back for it",
    "derating-over": "what was taken back has been given back",
    "misfire-by-pressure": "a charge has not burnt, by the peak of its cycle",
    "pressure-contradicts-motion": "peak of a cycle and motion of the piston tell two things of it",
    "load-rate-limited": "the load moves to its new value at its own rate",
}
OF_BOTH: Final = {
    "stimulus": "a stimulus of the scenario begins or ends",
    "parameters": "parameters were changed while the engine ran",
    "mark": "a mark that an operator has put into the log",
    "command": "an order over the command key was taken",
    "command-refused": "an order was refused",
    "real-time": "what the operating system granted",
    "starter-lost": "who started the process is gone",
    "log-dropped": "records found no room",
    "log-ended": "the log ends before the run",
    "log-lost": "the recorder was lost",
    "can-error": "the bus reported an error",
    "can-bus-off": "the bus interface is off the bus",
    "can-restarted": "it is on the bus again",
    "peer-without-terms": "the peer has not said by which terms it sends",
    "command-flood": "more orders came than are looked at",
}
MEANINGS: Final = {**OF_THE_PLANT, **OF_THE_CONTROLLER, **OF_BOTH}
