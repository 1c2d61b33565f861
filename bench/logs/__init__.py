"""Logs compared, exported, repaired, replayed."""
