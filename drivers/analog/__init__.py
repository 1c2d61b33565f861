"""Analogue sensors of real hardware."""
