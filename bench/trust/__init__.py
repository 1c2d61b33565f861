"""What the pair makes of losses, stalls and faults: both loops in memory, time by the tick."""
