"""Segmentation as a service: any model behind a small HTTP protocol (docs/SEGMENTATION.md)."""
