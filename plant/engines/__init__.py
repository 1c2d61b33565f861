"""Engines behind one protocol (protocol.py): each folder is one kind of physics."""
