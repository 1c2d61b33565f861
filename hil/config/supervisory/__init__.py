"""Set points from a target power, and the maps that tell what an engine delivers."""
