"""Step `evaluate`: measure a reconstruction against the ground truth of a generated room, or count what is in it."""
