"""CAN buses: load, faults, monitor."""
