"""Level 1: the operating mode, from a table that reads aloud, and what the table looks at."""
