"""Tableware: items, scenes, shapes, images from above."""
