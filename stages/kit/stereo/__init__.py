"""Stereo pairs in rows: are they in rows, how far apart can matches lie, matching, sub-pixel places, confidence."""
