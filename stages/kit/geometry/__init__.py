"""Geometry: pure functions on arrays."""
