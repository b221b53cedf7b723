"""A rendered needle world with exact truth: needle, thread, drivers and wound pad before two cameras."""
