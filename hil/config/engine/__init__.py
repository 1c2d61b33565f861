"""Which engine moves the piston: its models, units, and what a user brings."""
