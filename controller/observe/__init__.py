"""From samples to motion: what can be believed, and what happens between two ticks."""
