"""The engine: fast-response models, actuation, disturbances, sensors, and the plant process."""
