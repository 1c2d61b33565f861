"""A running pair: watched and steered."""
