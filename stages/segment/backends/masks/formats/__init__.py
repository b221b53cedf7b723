"""Formats of masks: a file here that declares FORMAT is one more."""
