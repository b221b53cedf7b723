"""The steps of the pipelines, one folder each. Steps never import one another (docs/ARCHITECTURE.md)."""
