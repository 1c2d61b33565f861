"""What a scenario leaves open, filled in by the kind of its model."""
