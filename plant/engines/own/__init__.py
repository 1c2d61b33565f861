"""Engines that users bring, as one file of Python or as a package that is installed."""
