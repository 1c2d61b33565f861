"""The engine: fast-response models, actuation, disturbances, sensors, and the plant process."""

import hil as _hil  # noqa: F401 (compiled modules must be found from the first import on)
