"""Per-frame segmentation: geometric segments of the depth, panoptic segments of a backend, and their fusion."""
