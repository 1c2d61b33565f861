"""Stimuli of a running scenario: courses of parameters, conditions, what is in force in a tick."""
