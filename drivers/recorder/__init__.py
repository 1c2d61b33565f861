"""From a loop to a log on the disk: ring, process, file."""
