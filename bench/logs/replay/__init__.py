"""A recorded run through the loops of today."""
