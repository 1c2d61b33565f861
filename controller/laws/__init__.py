"""Piston-motion laws behind one interface: fuel for the next combustion."""

from controller.laws import (
    cascade,
    machine,
    observer,
    open_loop,
    pdf,
    predictive,
    single_loop,
)
from controller.laws.interface import Law

LAWS: dict[str, Law] = {
    module.LAW.name: module.LAW
    for module in (cascade, single_loop, open_loop, pdf, predictive, observer, machine)
}
