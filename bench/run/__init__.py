"""One run: resolved, started, watched, concluded."""
