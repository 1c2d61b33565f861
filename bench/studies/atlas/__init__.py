"""The atlas: every number that the thesis prints, made again and judged."""
