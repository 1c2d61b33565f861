"""A running pair in Foxglove, Lichtblick and PlotJuggler: its records, its parameters."""
