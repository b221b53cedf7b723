"""Where masks come from: each folder is a backend of `segment`, found because it lies here (docs/SEGMENTATION.md)."""
