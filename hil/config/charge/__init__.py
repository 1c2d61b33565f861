"""A charge: how its fuel gets in, and when it is lit."""
