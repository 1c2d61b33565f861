"""Configuration: one TOML tree, read and range-checked by pydantic."""
