"""Adapters behind the ports: links, recorder, clock."""
