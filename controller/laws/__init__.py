"""Piston-motion laws behind one interface: fuel for the next combustion."""

from controller.laws import cascade, open_loop, single_loop
from controller.laws.interface import Law

LAWS: dict[str, Law] = {law.name: law for law in (cascade.LAW, single_loop.LAW, open_loop.LAW)}
