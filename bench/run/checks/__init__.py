"""What can be told of a scenario before it is run: names, ranges, files."""
