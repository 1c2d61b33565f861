"""What a report draws from: signals in windows and ranges, lines and modes, what changes seldom."""
