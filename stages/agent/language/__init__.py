"""The checked plan language: Python syntax from a white list, interpreted by us."""
