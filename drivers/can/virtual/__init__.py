"""A CAN bus between processes of one machine, with a wire that takes its time."""
