"""The kinds of lobes that surfaces are sums of."""

from .table import CLOSURES, KINDS, LARGEST, LEAST_IOR, Closure, Parameter

__all__ = ["CLOSURES", "KINDS", "LARGEST", "LEAST_IOR", "Closure", "Parameter"]
