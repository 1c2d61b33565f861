"""Level 4: fuel mass and motion to injection and spark edges, predicted ahead to 1 us."""
