"""What the model-based laws believe of a stroke: one interface, and a module for each maker."""
