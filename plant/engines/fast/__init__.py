"""Fast-response models: closed forms and one formula between two events (docs/model.md)."""
