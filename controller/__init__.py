"""The layered engine controller (thesis Fig 6.1), one module a layer, and its process."""
