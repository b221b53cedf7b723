"""The sections of the page, one folder each."""
