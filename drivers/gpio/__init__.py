"""TTL lines of real hardware."""
