"""Piston-motion laws behind one interface: fuel for the next combustion."""
