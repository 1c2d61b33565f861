"""Engines as Functional Mock-up Units: the contract, the import, the sources of the export."""
