"""The float64 NumPy tracer: the oracle of the tests, and the tracer of the pure-Python edition."""
