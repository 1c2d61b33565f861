"""Level 3, piston motion: laws, what they believe of a stroke, and the choice among them."""
