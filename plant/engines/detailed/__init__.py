"""The full engine: zero-dimensional gas, heat, flow, friction and machine, compiled.

Needs the extra `detailed`; nothing outside this package imports it before a model asks for it.
"""
