"""The common language of the steps: one file per artifact kind, the manifest, the vocabulary.

Imports numpy and pydantic, nothing of ours (docs/ARCHITECTURE.md, floors).
"""
