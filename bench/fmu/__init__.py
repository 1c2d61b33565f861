"""Functional Mock-up Units: ours to export, others to look at."""
