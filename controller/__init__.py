"""The layered engine controller (thesis Fig 6.1), one module a layer, and its process."""

import hil as _hil  # noqa: F401 (compiled modules must be found from the first import on)
