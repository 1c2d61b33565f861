"""Scenarios as a test suite: many cases, one verdict each."""
