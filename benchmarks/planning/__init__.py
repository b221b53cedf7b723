"""Measurements of planning."""
