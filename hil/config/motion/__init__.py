"""Configuration of level 3: what the model-based laws believe, learn and weigh."""
