"""What crosses a link between plant and controller, and what it means."""
