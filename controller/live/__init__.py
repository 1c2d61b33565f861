"""What changes while the controller runs: stimuli of a scenario, parameters."""
