"""Splats."""
