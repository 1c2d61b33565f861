"""What developers need: golden runs, compiled loops, generated files."""
