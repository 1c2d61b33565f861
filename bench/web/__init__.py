"""What is shown in a browser: the drawing module, its style, and how plots and data reach it."""
