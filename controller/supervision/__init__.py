"""What the supervisory layer knows of the engine: what it delivers, and the air that it has."""
