"""The detailed engines by themselves: tables, sweeps, precision."""
