"""From logs to figures and a verdict."""
