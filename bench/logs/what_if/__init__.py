"""A recorded run continued with other parameters."""
