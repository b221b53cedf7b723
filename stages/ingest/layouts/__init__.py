"""Logs that are folders of files: one file per layout."""
