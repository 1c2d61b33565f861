"""Seeded runs by the thousand, in parts that a kill does not cost again."""
