"""Measures: panoptic quality, average precision, edit distance, intervals, tables."""
