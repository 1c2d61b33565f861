"""What a user brings: templates to begin from, and a law put through its paces."""
