"""Formats of `export scene`: a folder each, found by its place."""
