"""Whole trials of suture throws in a simulator: needle, tissue, thread, perception by an error model, policies."""
