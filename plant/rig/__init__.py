"""What does not depend on which engine it is: orders, pulses, disturbances, strokes, contact."""
