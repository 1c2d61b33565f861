"""The tree of names: what can be set, and what can be seen, each declared where it belongs."""
