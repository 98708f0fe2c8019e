"""The float64 NumPy tracer: the oracle of the tests, and the tracer of the pure-Python edition."""

from .trace import render_reference

__all__ = ["render_reference"]
