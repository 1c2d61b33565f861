"""What a scenario says as a test: expectations, stimuli, cases."""
