"""Runs in one thread: stepped by hand, or to their end."""
