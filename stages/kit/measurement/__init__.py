"""Measures against ground truth: panoptic quality, average precision, graph edit distance, meshes, poses, plots."""
