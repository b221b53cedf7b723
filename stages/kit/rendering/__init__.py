"""Colour, depth and instance images by ray casting."""
